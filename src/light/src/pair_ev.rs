//! How much darker a photograph is than another of the same scene: [`PairEv`].

use super::curve::GAMMA;
use darkqa_ground::types::Rgb;

/// Weights of red, green and blue in the luminance of linear sRGB (ITU-R BT.709).
const LUMINANCE: [f64; 3] = [0.2126, 0.7152, 0.0722];

/// How much darker a photograph is than another of the same scene, in EV. The two need not be aligned, nor of one size.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PairEv {
    /// log₂ of the ratio of the mean linear luminances.
    pub mean: f64,
    /// Median over the pixels of log₂ of the ratio of their luminances, where neither is 0; of images of two sizes log₂ of the ratio
    /// of their medians. `None` if that is not known.
    pub median: Option<f64>,
    /// The drop with which [`expose`](super::expose) makes the bright image as dark: the mean, with light as the power 2.2 of codes.
    pub synthesis: f64,
}

impl PairEv {
    /// Measures a pair, the bright image first; `None` if one of them is black, or both are.
    ///
    /// Luminance is that of linear sRGB (IEC 61966-2-1), so that the number is that of shutter and gain: exact to 0.03 EV up to 9 EV.
    /// Noise that is clipped at black makes the dark image brighter than its exposure, so that above 6 EV the drop of a noisy
    /// image comes out too small. The paper's synthesis takes the power 2.2 instead, which differs near black: in its light, a real
    /// pair of LOL-v2 that is 3.59 EV apart is 4.08 EV apart.
    #[must_use]
    pub fn measure(normal: &Rgb, low: &Rgb) -> Option<Self> {
        let (bright, dark) = (luminance(normal, srgb), luminance(low, srgb));
        let ev = |bright: f64, dark: f64| {
            (bright > 0.0 && dark > 0.0).then(|| libm::log2(bright / dark))
        };
        let is_of_one_size = (normal.height(), normal.width()) == (low.height(), low.width());
        let power = |image| mean(&luminance(image, |code| libm::pow(code, GAMMA)));
        Some(Self {
            mean: ev(mean(&bright), mean(&dark))?,
            synthesis: ev(power(normal), power(low))?,
            median: if is_of_one_size {
                let ratios = bright.iter().zip(&dark);
                median(
                    ratios
                        .filter_map(|(bright, dark)| ev(*bright, *dark))
                        .collect(),
                )
            } else {
                median(bright)
                    .zip(median(dark))
                    .and_then(|(bright, dark)| ev(bright, dark))
            },
        })
    }
}

/// The mean linear luminance of an image, from 0 to 1; 0 for an image without pixels.
#[must_use]
pub fn mean_luminance(image: &Rgb) -> f64 {
    mean(&luminance(image, srgb))
}

/// The light of a code from 0 to 1, by the transfer function of sRGB (IEC 61966-2-1).
fn srgb(code: f64) -> f64 {
    if code <= 0.04045 {
        code / 12.92
    } else {
        libm::pow((code + 0.055) / 1.055, 2.4)
    }
}

/// The luminance of each pixel, with this light of codes from 0 to 1.
fn luminance(image: &Rgb, light: impl Fn(f64) -> f64) -> Vec<f64> {
    let linear: [f64; 256] = std::array::from_fn(|code| light(code as f64 / 255.0));
    image
        .samples()
        .chunks_exact(3)
        .map(|pixel| {
            pixel
                .iter()
                .zip(LUMINANCE)
                .map(|(code, weight)| weight * linear[usize::from(*code)])
                .sum::<f64>()
        })
        .collect()
}

/// The mean; 0 without numbers.
fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

/// The upper median; `None` without numbers.
fn median(mut values: Vec<f64>) -> Option<f64> {
    let middle = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, f64::total_cmp).1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::expose_by;

    fn scene() -> Rgb {
        let samples =
            (0..96 * 128 * 3_u32).map(|i| (40 + (i.wrapping_mul(2_654_435_761) >> 8) % 200) as u8);
        Rgb::new(96, 128, samples.collect()).unwrap()
    }

    /// The image with `ev` EV less light, rounded to 8 bits with a dither, so that dark codes keep their mean.
    fn darker(image: &Rgb, ev: f64) -> Rgb {
        let mut dark = image.clone();
        for (place, code) in dark.samples_mut().iter_mut().enumerate() {
            let light = srgb(f64::from(*code) / 255.0) * libm::exp2(-ev);
            let exact = if light <= 0.003_130_8 {
                255.0 * 12.92 * light
            } else {
                255.0 * (1.055 * libm::pow(light, 1.0 / 2.4) - 0.055)
            };
            let dither =
                f64::from((place as u32).wrapping_mul(2_246_822_519) >> 8) / f64::from(1 << 24);
            *code = (exact + dither).floor() as u8;
        }
        dark
    }

    #[test]
    fn the_drop_of_an_exposure_is_given_back() {
        for drop in [0.5, 2.0, 3.6, 6.0, 9.0] {
            let ev = PairEv::measure(&scene(), &darker(&scene(), drop)).unwrap();
            assert!((ev.mean - drop).abs() < 0.03, "{drop}: {ev:?}");
        }
    }

    #[test]
    fn synthesis_is_as_dark_by_its_own_drop() {
        for drop in [0.5, 2.0, 3.6, 6.0] {
            let ev = PairEv::measure(&scene(), &expose_by(&scene(), drop)).unwrap();
            assert!((ev.synthesis - drop).abs() < 0.03, "{drop}: {ev:?}");
        }
        // Near black the two laws differ.
        let ev = PairEv::measure(&scene(), &expose_by(&scene(), 6.0)).unwrap();
        assert!(ev.mean < 5.5, "{ev:?}");
    }

    #[test]
    fn the_same_image_has_none_and_swapped_ones_a_negative_one() {
        let (normal, low) = (scene(), darker(&scene(), 3.0));
        let same = PairEv {
            mean: 0.0,
            median: Some(0.0),
            synthesis: 0.0,
        };
        assert_eq!(PairEv::measure(&normal, &normal), Some(same));
        let swapped = PairEv::measure(&low, &normal).unwrap();
        assert!((swapped.mean + 3.0).abs() < 0.03, "{swapped:?}");
    }

    #[test]
    fn another_tone_curve_shows_in_the_median() {
        let mut low = darker(&scene(), 3.0);
        for code in low.samples_mut().iter_mut().step_by(40) {
            *code = 255;
        }
        let ev = PairEv::measure(&scene(), &low).unwrap();
        assert!(ev.median.unwrap() - ev.mean > 0.2, "{ev:?}");
    }

    #[test]
    fn sizes_may_differ_and_black_images_have_no_exposure() {
        let small = Rgb::new(1, 2, vec![128; 6]).unwrap();
        let large = Rgb::new(4, 4, vec![64; 48]).unwrap();
        let ev = PairEv::measure(&small, &large).unwrap();
        let exact = libm::log2(srgb(128.0 / 255.0) / srgb(64.0 / 255.0));
        assert!((ev.mean - exact).abs() < 1e-9 && (ev.median.unwrap() - exact).abs() < 1e-9);
        let black = Rgb::black(2, 2);
        assert_eq!(PairEv::measure(&small, &black), None);
        assert_eq!(PairEv::measure(&black, &small), None);
    }
}
