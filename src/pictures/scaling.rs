//! Scaling of images before they are sent: [`Scaling`].
//!
//! Bilinear scaling of images, as in OpenCV: [`bilinear`].
//!
//! Downscaling of images to a maximum side: [`fit`].

use std::borrow::Cow;
use std::num::NonZeroU32;

use image::{ImageBuffer, imageops};
use serde::Serialize;

use super::payload::{image_error, side};
use darkqa_base::error::Result;
use darkqa_base::types::Rgb;

/// How an image is scaled before it is sent.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Scaling {
    /// Not scaled.
    Never,
    /// Reduced to this many pixels on the longer side, if it has more.
    MaxSide(NonZeroU32),
    /// Enlarged or reduced to this many pixels on the longer side.
    LongerSide(usize),
}

impl Scaling {
    /// Width and height of an image after scaling, from its original width and height, in pixels.
    #[must_use]
    pub fn size(self, width: u32, height: u32) -> (usize, usize) {
        match self {
            Self::Never => (width as usize, height as usize),
            Self::MaxSide(side) => {
                let (width, height) = fitted_size(width, height, side);
                (width as usize, height as usize)
            }
            Self::LongerSide(side) => {
                let [height, width] = bilinear_size(height as usize, width as usize, side);
                (width, height)
            }
        }
    }

    /// Scales an image.
    ///
    /// # Errors
    /// If a side is too long for any image format, or the result does not fit into memory.
    pub fn scale(self, image: &Rgb) -> Result<Cow<'_, Rgb>> {
        match self {
            Self::MaxSide(side) => fit(image, side),
            Self::LongerSide(side) if image.height().max(image.width()) != side => {
                bilinear(image, side).map(Cow::Owned)
            }
            Self::Never | Self::LongerSide(_) => Ok(Cow::Borrowed(image)),
        }
    }
}

/// The weight 1.0 in OpenCV's fixed point (`INTER_RESIZE_COEF_SCALE`).
const ONE: f32 = 2048.0;

/// The two source pixels (indices) of an output pixel along one axis, and their weights.
#[derive(Debug, Clone, Copy)]
struct ScalingTap {
    indices: [usize; 2],
    weights: [i32; 2],
}

/// Scales an image so that its longer side has `side` pixels, as `cv2.resize(image, None, fx=f, fy=f)` with
/// f = side / max(height, width). The image is not smoothed first, so that its noise is kept.
///
/// The arithmetic follows `resizeGeneric_` for 8-bit images with `INTER_LINEAR` (OpenCV 4,
/// modules/imgproc/src/resize.cpp). Downscaled images equal those of OpenCV 5.0 bit for bit; in upscaled images, fewer
/// than one sample in a thousand differs, by one code.
///
/// # Errors
/// If the samples of the result do not fit into memory.
pub fn bilinear(image: &Rgb, side: usize) -> Result<Rgb> {
    let (height, width) = (image.height(), image.width());
    if height.max(width) == side {
        return Ok(image.clone());
    }
    let factor = side as f64 / height.max(width) as f64;
    let columns = taps(width, factor);
    let rows = taps(height, factor);
    let mut samples = Vec::with_capacity(rows.len() * columns.len() * 3);
    // The last two interpolated source rows, with their indices. The next output row often needs one of them again.
    let mut cached = [const { (usize::MAX, Vec::new()) }; 2];
    for tap in &rows {
        let [above, below] = tap.indices;
        if cached[0].0 != above {
            if cached[1].0 == above {
                cached.swap(0, 1);
            } else {
                interpolate_row(image, above, &columns, &mut cached[0].1);
                cached[0].0 = above;
            }
        }
        if below != above && cached[1].0 != below {
            interpolate_row(image, below, &columns, &mut cached[1].1);
            cached[1].0 = below;
        }
        let below = usize::from(below != above);
        let [first, second] = tap.weights;
        samples.extend(cached[0].1.iter().zip(&cached[below].1).map(|(above, below)| {
            let sum = ((first * (above >> 4)) >> 16) + ((second * (below >> 4)) >> 16);
            ((sum + 2) >> 2).clamp(0, 255) as u8
        }));
    }
    Rgb::new(rows.len(), columns.len(), samples)
}

/// The height and width of an image after its longer side is scaled to `side` pixels.
#[must_use]
fn bilinear_size(height: usize, width: usize, side: usize) -> [usize; 2] {
    let factor = side as f64 / height.max(width) as f64;
    [height, width].map(|length| scale_length(length, factor))
}

fn scale_length(length: usize, factor: f64) -> usize {
    ((length as f64 * factor).round_ties_even() as usize).max(1)
}

/// The taps of all output pixels along a side of `length` source pixels.
fn taps(length: usize, factor: f64) -> Vec<ScalingTap> {
    let count = scale_length(length, factor);
    let last = length - 1;
    (0..count)
        .map(|index: usize| {
            let position = ((index as f64 + 0.5) / factor - 0.5) as f32;
            let floor = position.floor();
            let (first, fraction) = match floor {
                floor if floor < 0.0 => (0, 0.0),
                floor if floor as usize >= last => (last, 0.0),
                floor => (floor as usize, position - floor),
            };
            ScalingTap {
                indices: [first, (first + 1).min(last)],
                weights: [1.0 - fraction, fraction].map(|weight| (weight * ONE).round_ties_even() as i32),
            }
        })
        .collect()
}

/// Interpolates one source row at the output columns, into `out`.
fn interpolate_row(image: &Rgb, row: usize, columns: &[ScalingTap], out: &mut Vec<i32>) {
    let width = 3 * image.width();
    let line = &image.samples()[row * width..][..width];
    out.clear();
    for tap in columns {
        let [left, right] = tap.indices.map(|column| 3 * column);
        let [first, second] = tap.weights;
        for channel in 0..3 {
            let (a, b) = (line[left + channel], line[right + channel]);
            out.push(first * i32::from(a) + second * i32::from(b));
        }
    }
}

/// Width and height of an image after [`fit`], in pixels: unchanged, or reduced.
#[must_use]
pub fn fitted_size(width: u32, height: u32, max_side: NonZeroU32) -> (u32, u32) {
    let (longer, max) = (u64::from(width.max(height)), u64::from(max_side.get()));
    if longer <= max {
        return (width, height);
    }
    let [width, height] = [width, height].map(|side| ((u64::from(side) * max + longer / 2) / longer).max(1) as u32);
    (width, height)
}

/// Reduces an image by a Lanczos filter (3 lobes) if its longer side has more than `max_side` pixels.
///
/// # Errors
/// If a side is too long for any format.
pub fn fit(image: &Rgb, max_side: NonZeroU32) -> Result<Cow<'_, Rgb>> {
    let (width, height) = (side(image.width())?, side(image.height())?);
    let fitted = fitted_size(width, height, max_side);
    if fitted == (width, height) {
        return Ok(Cow::Borrowed(image));
    }
    let source = ImageBuffer::<image::Rgb<u8>, _>::from_raw(width, height, image.samples())
        .ok_or_else(|| image_error("its samples do not fill its sides"))?;
    let (width, height) = fitted;
    let smaller = imageops::resize(&source, width, height, imageops::FilterType::Lanczos3);
    Rgb::new(height as usize, width as usize, smaller.into_raw()).map(Cow::Owned)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An image of pseudo-random samples.
    fn noise(height: usize, width: usize) -> Rgb {
        let mut state = 12_345_u32;
        let samples = (0..height * width * 3).map(|_| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 24) as u8
        });
        Rgb::new(height, width, samples.collect()).unwrap()
    }

    #[test]
    fn sizes_equal_those_of_opencv() {
        for (from, side, to) in [
            ([1080, 1920], 512, [288, 512]),
            ([968, 1296], 512, [382, 512]),
            ([333, 777], 512, [219, 512]),
            ([1, 5], 512, [102, 512]),
            ([3, 1000], 100, [1, 100]),
        ] {
            let image = bilinear(&Rgb::black(from[0], from[1]), side).unwrap();
            assert_eq!([image.height(), image.width()], to);
        }
    }

    #[test]
    fn pixels_equal_those_of_opencv() {
        // cv2 5.0.0 on the same images: the sum of all samples, and the first and last ones.
        let golden = [
            ([90, 160], 48, 495_481, [83, 169, 120, 114, 67, 102], [99, 111, 119, 56, 225, 99]),
            ([121, 81], 50, 625_372, [97, 168, 85, 177, 113, 104], [138, 135, 96, 203, 141, 68]),
            ([64, 64], 32, 391_554, [110, 93, 130, 169, 99, 160], [126, 135, 159, 140, 136, 51]),
        ];
        for (from, side, sum, first, last) in golden {
            let result = bilinear(&noise(from[0], from[1]), side).unwrap();
            let samples = result.samples();
            let total: u64 = samples.iter().map(|code| u64::from(*code)).sum();
            assert_eq!((total, &samples[..6], &samples[samples.len() - 6..]), (sum, &first[..], &last[..]), "{from:?}");
        }
        let same = noise(7, 9);
        assert_eq!(bilinear(&same, 9).unwrap(), same);
    }

    #[test]
    fn images_shrink_to_the_side_and_never_grow() {
        let image = Rgb::black(30, 60);
        for (max_side, expected) in [(60, (60, 30)), (100, (60, 30)), (20, (20, 10)), (1, (1, 1))] {
            let fitted = fit(&image, NonZeroU32::new(max_side).unwrap()).unwrap();
            assert_eq!((fitted.width(), fitted.height()), expected);
        }
        let grey = Rgb::new(40, 40, vec![128; 4800]).unwrap();
        let fitted = fit(&grey, NonZeroU32::new(13).unwrap()).unwrap();
        assert!(fitted.samples().iter().all(|sample| *sample == 128));
    }
}
