//! Conversion of 16-bit codes and linear light to the 8-bit codes of the undarkened image: [`from_rgb16`],
//! [`from_linear`].

use std::sync::LazyLock;

use super::image::{Light, Rgb, Rgb16Image};

/// Exponent between codes and light, as in the exposure drop (DarkQA, eqs. 1 and 3): the undarkened image equals a drop
/// of 0 EV.
const GAMMA: f64 = 2.2;

/// Rounds 16-bit codes to the nearest 8-bit codes.
pub(super) fn from_rgb16(codes: &Rgb16Image) -> Rgb {
    let nearest = codes.samples().iter().map(|code| ((u32::from(*code) + 128) / 257) as u8);
    new_image(codes.height(), codes.width(), nearest)
}

/// The codes floor(255 · min(1, L)^(1/2.2) + ½) of light L.
pub(super) fn from_linear(light: &Light) -> Rgb {
    /// Lower bound of the light of each code from 1 to 255.
    static STEPS: LazyLock<[f64; 255]> =
        LazyLock::new(|| std::array::from_fn(|below| libm::pow((below as f64 + 0.5) / 255.0, GAMMA)));
    let steps = &*STEPS;
    let codes = light.samples().iter().map(|light| steps.partition_point(|step| *step <= f64::from(*light)) as u8);
    new_image(light.height(), light.width(), codes)
}

fn new_image(height: usize, width: usize, codes: impl Iterator<Item = u8>) -> Rgb {
    let mut image = Rgb::black(height, width);
    for (sample, code) in image.samples_mut().iter_mut().zip(codes) {
        *sample = code;
    }
    image
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sixteen_bits_become_the_nearest_eight() {
        let codes: Vec<u16> = (0..=65_535).chain([0, 0]).collect();
        let image = from_rgb16(&Rgb16Image::new(1, codes.len() / 3, codes.clone()).unwrap());
        for (code, shown) in codes.iter().zip(image.samples()) {
            let expected = (f64::from(*code) / 257.0).round();
            assert!((f64::from(*shown) - expected).abs() < 0.5, "{code}");
        }
    }

    #[test]
    fn light_becomes_codes_by_the_power_of_the_exposure_drop() {
        let lights: Vec<f32> = (0..30_000).map(|i| (i as f32 / 20_000.0).powi(2)).collect();
        let image = from_linear(&Light::new(100, 100, lights.clone()).unwrap());
        for (light, shown) in lights.iter().zip(image.samples()) {
            let value = 255.0 * f64::from(*light).min(1.0).powf(1.0 / 2.2) + 0.5;
            // Between two codes both are right.
            if (value - value.round()).abs() > 1e-9 {
                assert!((f64::from(*shown) - value.floor()).abs() < 0.5, "{light}");
            }
        }
        assert_eq!(image.samples()[..2], [0, 0]);
        assert_eq!(image.samples()[29_999], 255);
    }
}
