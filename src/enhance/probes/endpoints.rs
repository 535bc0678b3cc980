//! Mean output of a model for black and for white input: [`Endpoints`].

use std::ops::Range;

use super::plausible::UnclampedImage;
use darkqa_base::types::Rgb;

/// Height and width, in pixels, of the black and white test image if the model accepts any size; equal to the first
/// size of the probe.
pub(super) const SIZE: [usize; 2] = [96, 144];

/// Mean output of a model for black and for white, in codes of 0..255.
///
/// With the right value ranges, a low-light enhancer keeps black nearly black and white nearly white. Measured on 9
/// trained models: the distances add up to at most 20 codes (RUAS); with wrong ranges that still give plausible images,
/// mostly to 100 and more.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Endpoints {
    pub(super) black: f64,
    pub(super) white: f64,
    /// Sum of the two mean distances of the channels from 0 and 255.
    pub(super) distance: f64,
}

/// Maximum [`Endpoints::distance`], in codes, at which black and white count as preserved. Chosen.
const MAX_DISTANCE: f64 = 50.0;

impl Endpoints {
    /// True if black stays nearly black and white nearly white.
    pub(super) fn are_near(self) -> bool {
        self.distance <= MAX_DISTANCE
    }

    /// Means of the output for [`black_and_white`], in the middle of each half.
    pub(super) fn from_codes(codes: &UnclampedImage) -> Self {
        let half = codes.width / 2;
        let quarter = half / 4;
        let black = channel_means(codes, quarter..half - quarter);
        let white = channel_means(codes, half + quarter..codes.width - quarter);
        Self {
            black: mean(black),
            white: mean(white),
            distance: mean(black.map(f64::abs)) + mean(white.map(|code| (code - 255.0).abs())),
        }
    }
}

/// Means of red, green and blue in these columns of the middle half of the rows, in codes.
fn channel_means(codes: &UnclampedImage, columns: Range<usize>) -> [f64; 3] {
    let UnclampedImage { height, width, .. } = *codes;
    let rows = height / 4..(height - height / 4).max(1);
    let pixels = rows.len() * columns.len();
    let mut sums = [0.0; 3];
    for row in rows {
        let row = &codes.samples[3 * row * width..][..3 * width];
        for pixel in row[3 * columns.start..3 * columns.end].chunks_exact(3) {
            for (sum, sample) in sums.iter_mut().zip(pixel) {
                *sum += f64::from(*sample);
            }
        }
    }
    sums.map(|sum| sum / pixels.max(1) as f64)
}

fn mean(channels: [f64; 3]) -> f64 {
    channels.iter().sum::<f64>() / 3.0
}

/// An image with a black left half and a white right half. Both are in one image, because some models stretch an image
/// to its darkest and brightest pixels.
pub(super) fn black_and_white([height, width]: [usize; 2]) -> Rgb {
    let mut image = Rgb::black(height, width);
    for row in image.samples_mut().chunks_exact_mut(3 * width) {
        row[3 * (width / 2)..].fill(u8::MAX);
    }
    image
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn black_and_white_have_their_own_codes() {
        let codes = UnclampedImage::from_rgb(&black_and_white([96, 144]));
        let expected = Endpoints { black: 0.0, white: 255.0, distance: 0.0 };
        assert_eq!(Endpoints::from_codes(&codes), expected);
    }

    #[test]
    fn smallest_images_have_finite_endpoints() {
        for size in [[1, 1], [1, 2], [2, 1]] {
            let codes = UnclampedImage::from_rgb(&black_and_white(size));
            assert!(Endpoints::from_codes(&codes).distance.is_finite(), "{size:?}");
        }
    }
}
