//! Plausibility of an enhanced image, given the dark one: [`judge`].
//!
//! The rules find outputs that are decoded in the wrong way: another range, the wrong output, swapped colours or dimensions. They do not
//! judge the quality of an enhancement. Their thresholds were set on 9 trained models and 25 dark images each, so that none of these models
//! is flagged; `src/docs/enhance.md` lists the faults that they find and miss.

use std::fmt;

use serde::{Deserialize, Serialize};

use crate::conventions::LUMA;
use crate::planes::Planes;
use darkqa_ground::types::{Flaw, Rgb};

/// Largest mean luma, in codes, of an image that is judged: on bright images the rules flag good models. Measured.
pub const DARK: f64 = 64.0;
/// Longer side of the images that are judged, in pixels: that of the images from which the thresholds come.
const JUDGED_SIDE: usize = 160;
/// Share of the pixels that count as the darkest.
const DARKEST_SHARE: f64 = 0.01;
/// How much nearer to the mean the darkest pixels must be than in the dark frame, as a ratio, for a haze. UnclampedImage of light that is dimmed
/// keep their ratios, as their curve is nearly a power. Chosen: noise moves the ratio less.
const HAZE_RATIO: f64 = 1.5;
/// Mean difference of the channels of blocks, in codes, above which a dark frame has colours, and below which an output has none. Chosen:
/// noise of single pixels does not reach the first, and only three equal channels stay below the second.
const MIN_COLOUR: f64 = 1.0;
const MAX_GREY: f64 = 0.1;
/// Side of the blocks whose means are compared, in pixels; chosen, so that noise is averaged out.
const BLOCK: usize = 4;

/// Whether a flaw rules out an enhanced image, or only makes it doubtful.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Gravity {
    /// It can be no enhanced image.
    Impossible,
    /// Some models do that, if the user states how they are fed and read.
    Doubtful,
}

/// Flaw of one output, with the figure that shows it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(super) struct Verdict {
    pub(super) flaw: Flaw,
    pub(super) gravity: Gravity,
    /// The figure that the flaw's rule compares.
    pub(super) figure: f64,
}

impl fmt::Display for Verdict {
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

/// An output of a model: red, green and blue of each pixel in codes of 0..255, neither clamped nor rounded.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct UnclampedImage {
    pub(super) height: usize,
    pub(super) width: usize,
    /// The samples, height × width × 3.
    pub(super) samples: Vec<f32>,
}

impl UnclampedImage {
    /// UnclampedImage of this height and width that are no numbers: those of an output whose values cannot be an image.
    pub(crate) fn not_a_number([height, width]: [usize; 2]) -> Self {
        Self {
            height,
            width,
            samples: vec![f32::NAN; height * width * 3],
        }
    }

    /// The codes of an image of bytes.
    pub(super) fn from_rgb(image: &Rgb) -> Self {
        Self {
            height: image.height(),
            width: image.width(),
            samples: image
                .samples()
                .iter()
                .map(|byte| f32::from(*byte))
                .collect(),
        }
    }

    /// The codes of an image, reduced by a whole factor to at most [`JUDGED_SIDE`] pixels: each sample is the mean of a square. The
    /// rest at the right and below is left out.
    pub(super) fn downscaled(image: &Rgb) -> Self {
        let longer = image.height().max(image.width());
        let factor = longer.div_ceil(JUDGED_SIDE);
        let [height, width] = [image.height(), image.width()].map(|side| side / factor);
        if factor == 1 || height == 0 || width == 0 {
            return Self::from_rgb(image);
        }
        let mut samples = vec![0.0; height * width * 3];
        for (y, line) in image
            .samples()
            .chunks_exact(3 * image.width())
            .take(height * factor)
            .enumerate()
        {
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
        Self {
            height,
            width,
            samples,
        }
    }

    /// The codes of an image of floats.
    pub(crate) fn from_planes(planes: &Planes) -> Self {
        let pixels = planes.height * planes.width;
        let samples = (0..pixels).flat_map(|pixel| {
            [0, 1, 2].map(|channel| 255.0 * planes.samples[channel * pixels + pixel])
        });
        Self {
            height: planes.height,
            width: planes.width,
            samples: samples.collect(),
        }
    }

    /// The codes as an image, clamped and rounded; values that are not numbers are black.
    pub(super) fn to_rgb(&self) -> Rgb {
        let mut image = Rgb::black(self.height, self.width);
        image
            .samples_mut()
            .iter_mut()
            .zip(&self.samples)
            .for_each(|(byte, code)| *byte = code.round().clamp(0.0, 255.0) as u8);
        image
    }

    /// Figures of the brightness and of what clamping cuts off.
    pub(super) fn facts(&self) -> Facts {
        let luma = self.luma().samples;
        let clipped = self
            .samples
            .iter()
            .filter(|code| !(0.0..=255.0).contains(*code));
        Facts {
            brightness: mean(&luma),
            darkest: percentile(&luma, 0.01),
            brightest: percentile(&luma, 0.99),
            clipped: clipped.count() as f64 / self.samples.len().max(1) as f64,
        }
    }

    fn luma(&self) -> Plane {
        let luma = self.samples.chunks_exact(3).map(|pixel| {
            pixel
                .iter()
                .zip(LUMA)
                .map(|(code, weight)| weight * f64::from(code.clamp(0.0, 255.0)))
                .sum()
        });
        Plane {
            width: self.width,
            samples: luma.collect(),
        }
    }

    /// Means of red, green and blue of each block, in codes.
    fn channel_blocks(&self) -> [Vec<f64>; 3] {
        [0, 1, 2].map(|channel| {
            let samples = self
                .samples
                .iter()
                .skip(channel)
                .step_by(3)
                .map(|code| f64::from(code.clamp(0.0, 255.0)))
                .collect();
            let width = self.width;
            Plane { width, samples }.blocks().samples
        })
    }

    /// Red less blue of each block, relative to its light; 3 codes keep black blocks from counting.
    fn warmth(&self) -> Vec<f64> {
        let [red, green, blue] = self.channel_blocks();
        red.iter()
            .zip(&green)
            .zip(&blue)
            .map(|((red, green), blue)| (red - blue) / (red + green + blue + 3.0))
            .collect()
    }

    /// Mean difference between the largest and the smallest channel of the blocks, in codes.
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

/// Figures of an image, in codes of 0..255.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Facts {
    /// Mean luma.
    pub brightness: f64,
    /// The 1st and the 99th percentile of luma.
    pub darkest: f64,
    pub brightest: f64,
    /// Share of the samples that were beyond 0..255.
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
    sums.iter()
        .zip(LUMA)
        .map(|(sum, weight)| weight * *sum as f64)
        .sum::<f64>()
        / pixels
}

/// First flaw that is found in an output for a dark image of the same size; `None` if the output is plausible.
pub(super) fn judge(dark: &UnclampedImage, made: &UnclampedImage) -> Option<Verdict> {
    let count = made.samples.len() as f64;
    let share = |is: &dyn Fn(&f32) -> bool| {
        made.samples.iter().filter(|value| is(value)).count() as f64 / count
    };
    let impossible = |flaw, figure| Some(verdict(flaw, Gravity::Impossible, figure));
    let doubtful = |flaw, figure| Some(verdict(flaw, Gravity::Doubtful, figure));
    let unfinished = share(&|value| !value.is_finite());
    if unfinished > 0.0 {
        return impossible(Flaw::Nan, unfinished);
    }
    let outside = share(&|value| !(-25.5..=280.5).contains(value));
    if outside > 0.2 {
        return impossible(Flaw::Range, outside);
    }
    let (before, after) = (dark.luma(), made.luma());
    let deviation = after.deviation();
    if deviation < 1.5 {
        return impossible(Flaw::Flat, deviation);
    }
    let (was, is) = (mean(&before.samples), mean(&after.samples));
    if is - was < 2.0 {
        let figure = is - was;
        return if is < was && is < 8.0 {
            impossible(Flaw::Unlit, figure)
        } else {
            doubtful(Flaw::Unlit, figure)
        };
    }
    let bright = after.samples.iter().filter(|luma| **luma >= 254.0).count() as f64;
    let white = bright / after.samples.len() as f64;
    if white > 0.8 {
        return doubtful(Flaw::White, white);
    }
    if let Some(found) = structure(&before.blocks(), &after.blocks()) {
        return Some(found);
    }
    let (was, is) = (dark.warmth(), made.warmth());
    let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let strength = product(&was, &was);
    let cosine = product(&was, &is) / (strength * product(&is, &is)).sqrt();
    if (strength / was.len() as f64).sqrt() > 0.06 && cosine < -0.25 {
        return impossible(Flaw::Hue, cosine);
    }
    let [was, is] = [dark, made].map(UnclampedImage::colour);
    if was > MIN_COLOUR && is < MAX_GREY {
        return doubtful(Flaw::Grey, is);
    }
    let darkest = percentile(&after.samples, DARKEST_SHARE);
    // A pale room has no dark pixel either: in its dark frame, too, the darkest pixels are near to the mean.
    let [was, is] = [&before.samples, &after.samples]
        .map(|plane| percentile(plane, DARKEST_SHARE) / mean(plane).max(f64::MIN_POSITIVE));
    (darkest > 100.0 && is > HAZE_RATIO * was)
        .then(|| verdict(Flaw::Haze, Gravity::Doubtful, darkest))
}

fn verdict(flaw: Flaw, gravity: Gravity, figure: f64) -> Verdict {
    Verdict {
        flaw,
        gravity,
        figure,
    }
}

/// Whether the blocks of an output follow those of its input.
fn structure(before: &Plane, after: &Plane) -> Option<Verdict> {
    let impossible = |flaw, figure| Some(verdict(flaw, Gravity::Impossible, figure));
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
    let sign = |step: f64| if step == 0.0 { 0.0 } else { step.signum() };
    let agreement: Vec<f64> = was
        .iter()
        .zip(&is)
        .filter(|(was, _)| was.abs() >= strong)
        .map(|(was, is)| sign(*was) * sign(*is))
        .collect();
    let agreement = mean(&agreement);
    if agreement < 0.35 {
        return impossible(Flaw::Shuffled, agreement);
    }
    None
}

/// One channel of an image.
struct Plane {
    width: usize,
    samples: Vec<f64>,
}

impl Plane {
    /// Means of blocks of [`BLOCK`] × [`BLOCK`] pixels; the rest at the right and below is left out. An image smaller than a
    /// block stays as it is.
    fn blocks(&self) -> Self {
        let height = self.samples.len() / self.width;
        let [rows, columns] = [height, self.width].map(|side| side / BLOCK);
        if rows == 0 || columns == 0 {
            return Self {
                width: self.width,
                samples: self.samples.clone(),
            };
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
        Self {
            width: columns,
            samples,
        }
    }

    /// Differences between neighbours, downwards and then to the right.
    fn steps(&self) -> Vec<f64> {
        let below = self.samples.get(self.width..).unwrap_or_default();
        let down = self.samples.iter().zip(below).map(|(a, b)| b - a);
        let right = self
            .samples
            .chunks_exact(self.width)
            .flat_map(|line| line.windows(2).map(|pair| pair[1] - pair[0]));
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

/// Ranks of values; equal values keep their order, as in the images from which the thresholds come.
fn ranks(values: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|a, b| values[*a].total_cmp(&values[*b]));
    let mut ranks = vec![0.0; values.len()];
    for (rank, place) in order.into_iter().enumerate() {
        ranks[place] = rank as f64;
    }
    ranks
}

/// Pearson's correlation; 0 if one side does not vary.
fn correlation(a: &[f64], b: &[f64]) -> f64 {
    let (mean_a, mean_b) = (mean(a), mean(b));
    let pairs = a.iter().zip(b).map(|(a, b)| (a - mean_a, b - mean_b));
    let (mut both, mut of_a, mut of_b) = (0.0, 0.0, 0.0);
    for (a, b) in pairs {
        both += a * b;
        of_a += a * a;
        of_b += b * b;
    }
    if of_a * of_b > 0.0 {
        both / (of_a * of_b).sqrt()
    } else {
        0.0
    }
}

/// The value at a share of the sorted values, between two of them interpolated (numpy's default).
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
