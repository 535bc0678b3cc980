//! Exposure difference between two photographs of the same scene: [`PairEv`].

use super::curve::GAMMA;
use darkqa_base::types::Rgb;

/// Weights of red, green and blue in the luminance of linear sRGB (ITU-R BT.709).
const LUMINANCE: [f64; 3] = [0.2126, 0.7152, 0.0722];

/// Exposure difference between two photographs of the same scene, in EV; positive if the second is darker. The
/// photographs may be misaligned and differ in size.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PairEv {
    /// log₂ of the ratio of the mean linear luminances, bright to dark.
    pub mean: f64,
    /// Median of the per-pixel log₂ luminance ratios, without pixels that are black in either image. For images of
    /// different sizes, log₂ of the ratio of the median luminances. `None` if no ratio is defined.
    pub median: Option<f64>,
    /// Exposure drop with which [`expose`](super::expose) makes the bright image as dark as the other one: like `mean`,
    /// but with light computed as code^2.2.
    pub synthesis: f64,
}

impl PairEv {
    /// Measures a pair, the bright image first; `None` if at least one image is black.
    ///
    /// Luminance is linear sRGB (IEC 61966-2-1), so that `mean` matches the change of shutter time and gain, within
    /// 0.03 EV up to 9 EV. Noise that is clipped at black brightens the dark image: above 6 EV, `mean` is too small for
    /// noisy images. The paper's synthesis uses the power 2.2 instead, which differs near black: for a real pair of
    /// LOL-v2, `mean` is 3.59 EV and `synthesis` 4.08 EV.
    #[must_use]
    pub fn measure(normal: &Rgb, low: &Rgb) -> Option<Self> {
        let (bright, dark) = (luminance(normal, srgb_to_linear), luminance(low, srgb_to_linear));
        let is_same_size = (normal.height(), normal.width()) == (low.height(), low.width());
        let [gamma_bright, gamma_dark] =
            [normal, low].map(|image| mean(&luminance(image, |code| libm::pow(code, GAMMA))));
        Some(Self {
            mean: ev_difference(mean(&bright), mean(&dark))?,
            synthesis: ev_difference(gamma_bright, gamma_dark)?,
            median: if is_same_size {
                median(bright.iter().zip(&dark).filter_map(|(bright, dark)| ev_difference(*bright, *dark)).collect())
            } else {
                median(bright).zip(median(dark)).and_then(|(bright, dark)| ev_difference(bright, dark))
            },
        })
    }
}

/// log₂ of the ratio of two luminances; `None` if one of them is 0.
fn ev_difference(bright: f64, dark: f64) -> Option<f64> {
    (bright > 0.0 && dark > 0.0).then(|| libm::log2(bright / dark))
}

/// Mean linear luminance of an image, from 0 to 1; 0 for an image without pixels.
#[must_use]
pub fn mean_luminance(image: &Rgb) -> f64 {
    mean(&luminance(image, srgb_to_linear))
}

/// Converts an sRGB code to linear light, both from 0 to 1 (IEC 61966-2-1).
fn srgb_to_linear(code: f64) -> f64 {
    if code <= 0.04045 { code / 12.92 } else { libm::pow((code + 0.055) / 1.055, 2.4) }
}

/// Luminance of each pixel. `to_linear` converts a code to linear light, both from 0 to 1.
fn luminance(image: &Rgb, to_linear: impl Fn(f64) -> f64) -> Vec<f64> {
    let linear: [f64; 256] = std::array::from_fn(|code| to_linear(code as f64 / 255.0));
    image
        .samples()
        .chunks_exact(3)
        .map(|pixel| pixel.iter().zip(LUMINANCE).map(|(code, weight)| weight * linear[usize::from(*code)]).sum::<f64>())
        .collect()
}

/// Mean; 0 for an empty slice.
fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

/// Upper median; `None` for an empty vector.
fn median(mut values: Vec<f64>) -> Option<f64> {
    let middle = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, f64::total_cmp).1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::expose_by;

    /// Pseudo-random image without black pixels.
    fn scene() -> Rgb {
        let samples = (0..96 * 128 * 3_u32).map(|i| (40 + (i.wrapping_mul(2_654_435_761) >> 8) % 200) as u8);
        Rgb::new(96, 128, samples.collect()).unwrap()
    }

    /// Darkens an image by `ev` EV. A dither before rounding to 8 bits preserves the mean of dark codes.
    fn darker(image: &Rgb, ev: f64) -> Rgb {
        let mut dark = image.clone();
        for (index, code) in dark.samples_mut().iter_mut().enumerate() {
            let light = srgb_to_linear(f64::from(*code) / 255.0) * libm::exp2(-ev);
            let exact = if light <= 0.003_130_8 {
                255.0 * 12.92 * light
            } else {
                255.0 * (1.055 * libm::pow(light, 1.0 / 2.4) - 0.055)
            };
            let dither = f64::from((index as u32).wrapping_mul(2_246_822_519) >> 8) / f64::from(1 << 24);
            *code = (exact + dither).floor() as u8;
        }
        dark
    }

    #[test]
    fn mean_recovers_exposure_drop() {
        for drop in [0.5, 2.0, 3.6, 6.0, 9.0] {
            let ev = PairEv::measure(&scene(), &darker(&scene(), drop)).unwrap();
            assert!((ev.mean - drop).abs() < 0.03, "{drop}: {ev:?}");
        }
    }

    #[test]
    fn synthesis_recovers_synthetic_drop() {
        for drop in [0.5, 2.0, 3.6, 6.0] {
            let ev = PairEv::measure(&scene(), &expose_by(&scene(), drop)).unwrap();
            assert!((ev.synthesis - drop).abs() < 0.03, "{drop}: {ev:?}");
        }
        // Near black, sRGB and the power 2.2 differ.
        let ev = PairEv::measure(&scene(), &expose_by(&scene(), 6.0)).unwrap();
        assert!(ev.mean < 5.5, "{ev:?}");
    }

    #[test]
    fn identical_images_differ_by_zero() {
        let same = PairEv { mean: 0.0, median: Some(0.0), synthesis: 0.0 };
        assert_eq!(PairEv::measure(&scene(), &scene()), Some(same));
    }

    #[test]
    fn swapped_images_have_negative_drop() {
        let swapped = PairEv::measure(&darker(&scene(), 3.0), &scene()).unwrap();
        assert!((swapped.mean + 3.0).abs() < 0.03, "{swapped:?}");
    }

    #[test]
    fn bright_spots_lower_only_mean() {
        let mut low = darker(&scene(), 3.0);
        for code in low.samples_mut().iter_mut().step_by(40) {
            *code = 255;
        }
        let ev = PairEv::measure(&scene(), &low).unwrap();
        assert!(ev.median.unwrap() - ev.mean > 0.2, "{ev:?}");
    }

    #[test]
    fn image_sizes_may_differ() {
        let small = Rgb::new(1, 2, vec![128; 6]).unwrap();
        let large = Rgb::new(4, 4, vec![64; 48]).unwrap();
        let ev = PairEv::measure(&small, &large).unwrap();
        let exact = libm::log2(srgb_to_linear(128.0 / 255.0) / srgb_to_linear(64.0 / 255.0));
        assert!((ev.mean - exact).abs() < 1e-9 && (ev.median.unwrap() - exact).abs() < 1e-9);
    }

    #[test]
    fn black_images_have_no_drop() {
        let grey = Rgb::new(1, 2, vec![128; 6]).unwrap();
        let black = Rgb::black(2, 2);
        assert_eq!(PairEv::measure(&grey, &black), None);
        assert_eq!(PairEv::measure(&black, &grey), None);
    }
}
