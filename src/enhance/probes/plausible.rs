//! Plausibility of an enhanced image, compared with the dark one: [`judge`].
//!
//! The rules detect outputs that are decoded in a wrong way: another range, the wrong output, swapped colours or
//! dimensions. They do not judge the quality of an enhancement. Their thresholds were set on 9 trained models with 25
//! dark images each, so that none of these models is flagged; `src/docs/enhance.md` lists the faults that they find and
//! miss.

use std::fmt;

use serde::{Deserialize, Serialize};

use crate::conventions::LUMA;
use crate::planes::Planes;
use darkqa_base::types::{Flaw, Rgb};

/// Maximum mean luma, in codes, of a degraded image whose enhancement is judged; measured. On brighter images the rules
/// flag good models.
pub const DARK: f64 = 64.0;
/// Maximum longer side, in pixels, of the images that are judged: that of the images on which the thresholds were set.
const JUDGED_SIDE: usize = 160;
/// Share of the pixels that count as the darkest.
const DARKEST_SHARE: f64 = 0.01;
/// Factor by which the ratio of the darkest pixels to the mean must exceed that of the dark frame for a haze; chosen.
/// Dimming hardly changes the ratio, because the curve of the codes is nearly a power, and noise changes it less than
/// this factor.
const HAZE_RATIO: f64 = 1.5;
/// Mean difference between the channels of blocks, in codes, above which a dark frame is coloured; chosen above the
/// effect of noise.
const MIN_COLOUR: f64 = 1.0;
/// Mean difference between the channels of blocks, in codes, below which an output is grey; chosen so that only equal
/// channels pass.
const MAX_GREY: f64 = 0.1;
/// Side of the blocks whose means are compared, in pixels; chosen, to average out noise.
const BLOCK: usize = 4;

/// Severity of a flaw.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Gravity {
    /// The output cannot be an enhanced image.
    Impossible,
    /// Some models have this flaw even with the right convention.
    Doubtful,
}

/// Flaw of one output, with the measured figure.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(super) struct MeasuredFlaw {
    pub(super) flaw: Flaw,
    pub(super) gravity: Gravity,
    /// Figure that the rule compares with its threshold.
    pub(super) figure: f64,
}

impl fmt::Display for MeasuredFlaw {
    /// The finding as it follows "the images": `are flat (their brightness varies by 0.2 of 255)`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let figure = self.figure;
        let percent = 100.0 * figure;
        write!(f, "{} (", self.flaw.words())?;
        match self.flaw {
            Flaw::Nan | Flaw::Range => write!(f, "{percent:.0} % of the values"),
            Flaw::Flat => write!(f, "brightness varies by {figure:.1} of 255"),
            Flaw::Unlit => write!(f, "mean brightness {figure:+.1} of 255"),
            Flaw::White => write!(f, "{percent:.0} % of the pixels"),
            Flaw::Inverted => write!(f, "rank correlation {figure:.2}"),
            Flaw::Shuffled => write!(f, "{figure:.2} of the edges agree, 1 at best"),
            Flaw::Hue => write!(f, "cosine {figure:.2}"),
            Flaw::Grey => write!(f, "channels differ by {figure:.1} of 255"),
            Flaw::Haze => write!(f, "99 % of the pixels are above {figure:.0} of 255"),
        }?;
        f.write_str(")")
    }
}

/// Decoded output of a model before clamping and rounding: packed RGB samples in codes of 0..255.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct UnclampedImage {
    pub(super) height: usize,
    pub(super) width: usize,
    /// The samples, height × width × 3.
    pub(super) samples: Vec<f32>,
}

impl UnclampedImage {
    /// An image of NaN, for an output whose values cannot be decoded.
    pub(crate) fn not_a_number([height, width]: [usize; 2]) -> Self {
        Self { height, width, samples: vec![f32::NAN; height * width * 3] }
    }

    /// The codes of an 8-bit image.
    pub(super) fn from_rgb(image: &Rgb) -> Self {
        Self {
            height: image.height(),
            width: image.width(),
            samples: image.samples().iter().map(|byte| f32::from(*byte)).collect(),
        }
    }

    /// The codes of an 8-bit image, downscaled by an integer factor to a longer side of at most [`JUDGED_SIDE`] pixels.
    /// Each sample is the mean of a square; incomplete squares at the right and bottom are left out.
    pub(super) fn downscaled(image: &Rgb) -> Self {
        let longer = image.height().max(image.width());
        let factor = longer.div_ceil(JUDGED_SIDE);
        let [height, width] = [image.height(), image.width()].map(|side| side / factor);
        if factor == 1 || height == 0 || width == 0 {
            return Self::from_rgb(image);
        }
        let mut samples = vec![0.0; height * width * 3];
        for (y, line) in image.samples().chunks_exact(3 * image.width()).take(height * factor).enumerate() {
            let sums = &mut samples[y / factor * width * 3..][..width * 3];
            let squares = line.chunks_exact(3 * factor);
            for (sum, square) in sums.chunks_exact_mut(3).zip(squares) {
                for pixel in square.chunks_exact(3) {
                    for (sum, byte) in sum.iter_mut().zip(pixel) {
                        *sum += f32::from(*byte);
                    }
                }
            }
        }
        let pixels = (factor * factor) as f32;
        for sum in &mut samples {
            *sum /= pixels;
        }
        Self { height, width, samples }
    }

    /// The codes of a planar RGB image.
    pub(crate) fn from_planes(planes: &Planes) -> Self {
        let pixels = planes.height * planes.width;
        Self {
            height: planes.height,
            width: planes.width,
            samples: (0..pixels)
                .flat_map(|pixel| [0, 1, 2].map(|channel| 255.0 * planes.samples[channel * pixels + pixel]))
                .collect(),
        }
    }

    /// The image clamped and rounded to 8 bits; NaN becomes black.
    pub(super) fn to_rgb(&self) -> Rgb {
        let mut image = Rgb::black(self.height, self.width);
        image
            .samples_mut()
            .iter_mut()
            .zip(&self.samples)
            .for_each(|(byte, code)| *byte = code.round().clamp(0.0, 255.0) as u8);
        image
    }

    /// Statistics of the brightness and of the clamped samples.
    pub(super) fn facts(&self) -> Facts {
        let luma = self.luma().samples;
        let clipped = self.samples.iter().filter(|code| !(0.0..=255.0).contains(*code));
        Facts {
            brightness: mean(&luma),
            darkest: percentile(&luma, 0.01),
            brightest: percentile(&luma, 0.99),
            clipped: clipped.count() as f64 / self.samples.len().max(1) as f64,
        }
    }

    fn luma(&self) -> ChannelPlane {
        let luma = self
            .samples
            .chunks_exact(3)
            .map(|pixel| pixel.iter().zip(LUMA).map(|(code, weight)| weight * f64::from(code.clamp(0.0, 255.0))).sum());
        ChannelPlane { width: self.width, samples: luma.collect() }
    }

    /// Means of red, green and blue of each block, in codes.
    fn channel_blocks(&self) -> [Vec<f64>; 3] {
        [0, 1, 2].map(|channel| {
            let samples =
                self.samples.iter().skip(channel).step_by(3).map(|code| f64::from(code.clamp(0.0, 255.0))).collect();
            let width = self.width;
            ChannelPlane { width, samples }.blocks().samples
        })
    }

    /// Difference between red and blue of each block, relative to its brightness. The 3 codes added to the divisor
    /// suppress black blocks.
    fn warmth(&self) -> Vec<f64> {
        let [red, green, blue] = self.channel_blocks();
        red.iter()
            .zip(&green)
            .zip(&blue)
            .map(|((red, green), blue)| (red - blue) / (red + green + blue + 3.0))
            .collect()
    }

    /// Mean difference between the largest and the smallest channel of blocks, in codes.
    fn colour(&self) -> f64 {
        let [red, green, blue] = self.channel_blocks();
        let differences: Vec<f64> = red
            .iter()
            .zip(&green)
            .zip(&blue)
            .map(|((red, green), blue)| red.max(*green).max(*blue) - red.min(*green).min(*blue))
            .collect();
        mean(&differences)
    }
}

/// Statistics of an image, in codes of 0..255.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Facts {
    /// Mean luma.
    pub brightness: f64,
    /// 1st percentile of luma.
    pub darkest: f64,
    /// 99th percentile of luma.
    pub brightest: f64,
    /// Share of the samples outside 0..255.
    pub clipped: f64,
}

/// Mean luma of an image, in codes of 0..255.
pub fn brightness(image: &Rgb) -> f64 {
    let mut sums = [0_u64; 3];
    for pixel in image.samples().chunks_exact(3) {
        for (sum, byte) in sums.iter_mut().zip(pixel) {
            *sum += u64::from(*byte);
        }
    }
    let pixels = (image.height() * image.width()) as f64;
    sums.iter().zip(LUMA).map(|(sum, weight)| weight * *sum as f64).sum::<f64>() / pixels
}

/// Maximum range of brightness, in codes, of an image that shows nothing, without its darkest and brightest 1 %;
/// chosen.
const MAX_EMPTY_RANGE: f64 = 1.0;

/// True if an image shows nothing, such as a black photograph: the right output for it has no content either, so it
/// tests no enhancer.
pub fn shows_nothing(image: &Rgb) -> bool {
    let luma = UnclampedImage::downscaled(image).luma().samples;
    percentile(&luma, 1.0 - DARKEST_SHARE) - percentile(&luma, DARKEST_SHARE) <= MAX_EMPTY_RANGE
}

/// First flaw found in an output for a dark image of the same size; `None` if the output is plausible.
pub(super) fn judge(dark: &UnclampedImage, output: &UnclampedImage) -> Option<MeasuredFlaw> {
    let not_finite = share(&output.samples, |value| !value.is_finite());
    if not_finite > 0.0 {
        return impossible(Flaw::Nan, not_finite);
    }
    let outside = share(&output.samples, |value| !(-25.5..=280.5).contains(&value));
    if outside > 0.2 {
        return impossible(Flaw::Range, outside);
    }
    let (before, after) = (dark.luma(), output.luma());
    let deviation = after.deviation();
    if deviation < 1.5 {
        return impossible(Flaw::Flat, deviation);
    }
    let (was, is) = (mean(&before.samples), mean(&after.samples));
    if is - was < 2.0 {
        let figure = is - was;
        return if is < was && is < 8.0 { impossible(Flaw::Unlit, figure) } else { doubtful(Flaw::Unlit, figure) };
    }
    let bright = after.samples.iter().filter(|luma| **luma >= 254.0).count() as f64;
    let white = bright / after.samples.len() as f64;
    if white > 0.8 {
        return doubtful(Flaw::White, white);
    }
    if let Some(found) = structure(&before.blocks(), &after.blocks()) {
        return Some(found);
    }
    let (was, is) = (dark.warmth(), output.warmth());
    let strength = dot_product(&was, &was);
    let cosine = dot_product(&was, &is) / (strength * dot_product(&is, &is)).sqrt();
    if (strength / was.len() as f64).sqrt() > 0.06 && cosine < -0.25 {
        return impossible(Flaw::Hue, cosine);
    }
    let [was, is] = [dark, output].map(UnclampedImage::colour);
    if was > MIN_COLOUR && is < MAX_GREY {
        return doubtful(Flaw::Grey, is);
    }
    let darkest = percentile(&after.samples, DARKEST_SHARE);
    // A pale room has no dark pixels either, but the darkest pixels are near the mean in its dark frame, too.
    let [was, is] = [&before.samples, &after.samples]
        .map(|plane| percentile(plane, DARKEST_SHARE) / mean(plane).max(f64::MIN_POSITIVE));
    if darkest > 100.0 && is > HAZE_RATIO * was {
        return doubtful(Flaw::Haze, darkest);
    }
    None
}

/// The verdict on an impossible output, always `Some`.
#[expect(clippy::unnecessary_wraps, reason = "returned by rules that may find nothing")]
fn impossible(flaw: Flaw, figure: f64) -> Option<MeasuredFlaw> {
    Some(MeasuredFlaw { flaw, gravity: Gravity::Impossible, figure })
}

/// The verdict on a doubtful output, always `Some`.
#[expect(clippy::unnecessary_wraps, reason = "returned by rules that may find nothing")]
fn doubtful(flaw: Flaw, figure: f64) -> Option<MeasuredFlaw> {
    Some(MeasuredFlaw { flaw, gravity: Gravity::Doubtful, figure })
}

/// Share of the values that satisfy a condition.
fn share(values: &[f32], condition: impl Fn(f32) -> bool) -> f64 {
    values.iter().filter(|value| condition(**value)).count() as f64 / values.len() as f64
}

fn dot_product(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Flaw of an output whose blocks do not follow those of its input in brightness.
fn structure(before: &ChannelPlane, after: &ChannelPlane) -> Option<MeasuredFlaw> {
    let order = correlation(&ranks(&before.samples), &ranks(&after.samples));
    if order < -0.3 {
        return impossible(Flaw::Inverted, order);
    }
    if order >= 0.5 {
        return None;
    }
    let (was, is) = (before.steps(), after.steps());
    let sizes: Vec<f64> = was.iter().map(|step| step.abs()).collect();
    let strong = percentile(&sizes, 0.75);
    let agreement: Vec<f64> =
        was.iter().zip(&is).filter(|(was, _)| was.abs() >= strong).map(|(was, is)| sign(*was) * sign(*is)).collect();
    let agreement = mean(&agreement);
    if agreement < 0.35 {
        return impossible(Flaw::Shuffled, agreement);
    }
    None
}

/// Sign of a number; 0 for 0.
fn sign(number: f64) -> f64 {
    if number == 0.0 { 0.0 } else { number.signum() }
}

/// One channel of an image.
struct ChannelPlane {
    width: usize,
    samples: Vec<f64>,
}

impl ChannelPlane {
    /// Means of blocks of [`BLOCK`] × [`BLOCK`] pixels, without incomplete blocks. An image smaller than a block is
    /// returned unchanged.
    fn blocks(&self) -> Self {
        let height = self.samples.len() / self.width;
        let [rows, columns] = [height, self.width].map(|side| side / BLOCK);
        if rows == 0 || columns == 0 {
            return Self { width: self.width, samples: self.samples.clone() };
        }
        let mut samples = vec![0.0; rows * columns];
        for (y, line) in self.samples.chunks_exact(self.width).enumerate() {
            let Some(sums) = samples.chunks_exact_mut(columns).nth(y / BLOCK) else {
                break;
            };
            for (sum, block) in sums.iter_mut().zip(line.chunks_exact(BLOCK)) {
                *sum += block.iter().sum::<f64>() / (BLOCK * BLOCK) as f64;
            }
        }
        Self { width: columns, samples }
    }

    /// Differences between vertical neighbours, then those between horizontal neighbours.
    fn steps(&self) -> Vec<f64> {
        let below = self.samples.get(self.width..).unwrap_or_default();
        let down = self.samples.iter().zip(below).map(|(a, b)| b - a);
        let right =
            self.samples.chunks_exact(self.width).flat_map(|line| line.windows(2).map(|pair| pair[1] - pair[0]));
        down.chain(right).collect()
    }

    /// Standard deviation.
    fn deviation(&self) -> f64 {
        let mean = mean(&self.samples);
        let squares = self.samples.iter().map(|sample| (sample - mean).powi(2));
        (squares.sum::<f64>() / self.samples.len() as f64).sqrt()
    }
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

/// Ranks of values; ties are ranked in order of appearance, as when the thresholds were set.
fn ranks(values: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|a, b| values[*a].total_cmp(&values[*b]));
    let mut ranks = vec![0.0; values.len()];
    for (rank, place) in order.into_iter().enumerate() {
        ranks[place] = rank as f64;
    }
    ranks
}

/// Pearson's correlation coefficient; 0 if one side does not vary.
fn correlation(a: &[f64], b: &[f64]) -> f64 {
    let (mean_a, mean_b) = (mean(a), mean(b));
    let (mut covariance, mut variance_a, mut variance_b) = (0.0, 0.0, 0.0);
    for (a, b) in a.iter().zip(b) {
        let (a, b) = (a - mean_a, b - mean_b);
        covariance += a * b;
        variance_a += a * a;
        variance_b += b * b;
    }
    if variance_a * variance_b > 0.0 { covariance / (variance_a * variance_b).sqrt() } else { 0.0 }
}

/// Quantile for a share of the values, linearly interpolated (numpy's default).
fn percentile(values: &[f64], share: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let Some(last) = sorted.len().checked_sub(1) else {
        return 0.0;
    };
    let place = share * last as f64;
    let below = place.floor() as usize;
    let above = (below + 1).min(last);
    sorted[below] + (place - below as f64) * (sorted[above] - sorted[below])
}

#[cfg(test)]
mod tests;
