//! Burnt-out images, in which most pixels are white although those of the degraded image differ: [`burnt_out`].

use crate::conventions::LUMA;
use darkqa_base::types::Rgb;

/// Least luma of a white pixel, in codes (chosen: 255 with a rounding error).
const WHITE: f64 = 254.0;
/// Least share of white pixels in a burnt-out image; chosen.
const MIN_WHITE: f64 = 0.5;
/// Least share of pixels that are white but were clearly darker than the brightest ones; chosen. A white page is white
/// again when it is enhanced, and has no detail to lose.
const MIN_LOST: f64 = 0.25;
/// Ratio to the brightest pixels of the degraded image below which a pixel is clearly darker, in codes; chosen above
/// usual noise.
const DARKER: f64 = 0.8;
/// Share of the pixels that count as the brightest.
const BRIGHTEST_SHARE: f64 = 0.01;

/// Share of the white pixels of an enhanced image that is burnt out; `None` if it is not. The images have the same
/// size.
#[must_use]
pub fn burnt_out([degraded, enhanced]: [&Rgb; 2]) -> Option<f64> {
    let pixels = enhanced.samples().len() / 3;
    let is_white: Vec<bool> = lumas(enhanced).map(|luma| luma >= WHITE).collect();
    let white = is_white.iter().filter(|is_white| **is_white).count();
    let share = white as f64 / pixels.max(1) as f64;
    if share < MIN_WHITE {
        return None;
    }
    let before: Vec<f64> = lumas(degraded).collect();
    let rank = (before.len() as f64 * (1.0 - BRIGHTEST_SHARE)) as usize;
    let mut sorted = before.clone();
    let (_, brightest, _) = sorted.select_nth_unstable_by(rank.min(pixels - 1), f64::total_cmp);
    let limit = DARKER * *brightest;
    let lost = before.iter().zip(&is_white).filter(|(luma, is_white)| **is_white && **luma < limit).count();
    (lost as f64 >= MIN_LOST * pixels as f64).then_some(share)
}

/// Luma of each pixel, in codes.
fn lumas(image: &Rgb) -> impl Iterator<Item = f64> {
    image
        .samples()
        .as_chunks::<3>()
        .0
        .iter()
        .map(|pixel| pixel.iter().zip(LUMA).map(|(code, weight)| weight * f64::from(*code)).sum())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A grey image of 100 × 100 pixels by the number of the pixel.
    fn grey(code: impl Fn(usize) -> u8) -> Rgb {
        let samples = (0..10_000).flat_map(|pixel| [code(pixel); 3]).collect();
        Rgb::new(100, 100, samples).unwrap()
    }

    #[test]
    fn a_white_image_of_a_scene_is_burnt_out() {
        let scene = grey(|pixel| (20 + pixel % 100) as u8);
        let white = grey(|pixel| if pixel % 100 < 3 { 200 } else { 255 });
        let share = burnt_out([&scene, &white]).unwrap();
        assert!((share - 0.97).abs() < 1e-9, "{share}");
    }

    #[test]
    fn a_good_image_is_not_burnt_out() {
        let scene = grey(|pixel| (20 + pixel % 100) as u8);
        let good = grey(|pixel| (2 * (20 + pixel % 100)) as u8);
        assert_eq!(burnt_out([&scene, &good]), None);
        // A third of the pixels is clipped.
        let bright = grey(|pixel| (3 * (20 + pixel % 100)).min(255) as u8);
        assert_eq!(burnt_out([&scene, &bright]), None);
        assert_eq!(burnt_out([&scene, &Rgb::black(100, 100)]), None);
    }

    /// Noise of 10 % around the code of white, with a few words in black.
    #[test]
    fn a_white_page_is_not_burnt_out() {
        let dark = grey(|pixel| if pixel % 10 == 0 { 10 } else { (122 + pixel * 7 % 28) as u8 });
        let page = grey(|pixel| if pixel % 10 == 0 { 20 } else { 255 });
        assert_eq!(burnt_out([&dark, &page]), None);
    }
}
