//! Conversion of codes and light from other RGB colour spaces to sRGB: [`Conversion`].

use super::curve::{ToneCurve, WHITE_NITS, interpolate};
use super::primaries::{Matrix, times};
use super::srgb::{EIGHT, SIXTEEN, SrgbCodes};

/// Conversion of RGB colours to sRGB: a tone curve per channel to linear light, a matrix to the primaries of sRGB, and
/// the sRGB curve. White stays white, and colours outside the gamut of sRGB are clipped (relative colorimetric), as is
/// light above white in HDR.
///
/// Computed in double precision, because a library that uses the vector instructions of the machine gives codes that
/// differ by one between machines.
#[derive(Debug)]
pub(crate) struct Conversion {
    curves: [ToneCurve; 3],
    matrix: Matrix,
    /// The step from the light of the scene to that of the display, for HLG.
    pub(super) ootf: Option<Ootf>,
}

/// The opto-optical transfer of HLG: from the light of the scene to that of the nominal display with a peak of 1000
/// cd/m² (BT.2100-2, table 5).
#[derive(Debug)]
pub(crate) struct Ootf {
    /// Shares of the channels in the luminance.
    luminance: [f64; 3],
    /// Gain for equally spaced square roots of the luminance from 0 to 1. The square root spaces dark values as densely
    /// as the eye sees them; interpolation changes light by less than a millionth of white.
    gains: Vec<f64>,
}

impl Ootf {
    /// Peak of the nominal display, in cd/m².
    const PEAK_NITS: f64 = 1000.0;
    /// Exponent of the luminance for that display.
    const GAMMA: f64 = 1.2;
    /// Number of gains, less one; chosen.
    const STEPS: usize = 4096;

    pub(super) fn new(luminance: [f64; 3]) -> Self {
        Self {
            luminance,
            gains: (0..=Self::STEPS)
                .map(|step| {
                    let root = step as f64 / Self::STEPS as f64;
                    Self::gain(root * root)
                })
                .collect(),
        }
    }

    /// Factor from the light of the scene to that of the display in units of diffuse white. 1 of the scene is the peak.
    fn gain(luminance: f64) -> f64 {
        Self::PEAK_NITS / WHITE_NITS * libm::pow(luminance, Self::GAMMA - 1.0)
    }

    /// Light of the display in units of diffuse white.
    fn displayed(&self, scene: [f64; 3]) -> [f64; 3] {
        let [r, g, b] = self.luminance;
        let luminance = r * scene[0] + g * scene[1] + b * scene[2];
        let gain = interpolate(&self.gains, luminance.clamp(0.0, 1.0).sqrt());
        scene.map(|light| light * gain)
    }
}

impl Conversion {
    pub(super) fn new(curves: [ToneCurve; 3], matrix: Matrix) -> Self {
        Self { curves, matrix, ootf: None }
    }

    /// True if the conversion changes each of 17 × 17 × 17 evenly spaced colours by at most one 8-bit code.
    pub(super) fn is_identity(&self) -> bool {
        let grid: Vec<f64> = (0..17).map(|i| f64::from(i) / 16.0).collect();
        let light: Vec<Vec<f64>> =
            self.curves.iter().map(|curve| grid.iter().map(|value| curve.light(*value)).collect()).collect();
        (0..17 * 17 * 17).all(|i| {
            let point = [i / 289, i / 17 % 17, i % 17];
            let lights = [0, 1, 2].map(|channel| light[channel][point[channel]]);
            let converted = times(self.matrix, lights);
            (0..3).all(|channel| {
                // 16-bit codes resolve fractions of an 8-bit code.
                let value = f64::from(SIXTEEN.encode(converted[channel])) / 65_535.0;
                (value - grid[point[channel]]).abs() * 255.0 <= 1.0
            })
        })
    }

    /// Converts interleaved 8-bit RGB samples.
    pub(crate) fn convert_8(&self, samples: &mut [u8]) {
        let tables = self.tables(255);
        for pixel in samples.as_chunks_mut::<3>().0 {
            let lights = [0, 1, 2].map(|i| tables[i][usize::from(pixel[i])]);
            *pixel = self.encode(lights, &EIGHT).map(|code| code as u8);
        }
    }

    /// Converts interleaved 16-bit RGB samples.
    pub(crate) fn convert_16(&self, samples: &mut [u16]) {
        let tables = self.tables(65_535);
        for pixel in samples.as_chunks_mut::<3>().0 {
            let lights = [0, 1, 2].map(|i| tables[i][usize::from(pixel[i])]);
            *pixel = self.encode(lights, &SIXTEEN).map(|code| code as u16);
        }
    }

    /// Converts interleaved linear RGB light. Colours outside the gamut of sRGB are clipped.
    pub(crate) fn convert_light(&self, samples: &mut [f32]) {
        for pixel in samples.as_chunks_mut::<3>().0 {
            let light = times(self.matrix, pixel.map(f64::from));
            *pixel = light.map(|light| light.clamp(0.0, f64::from(f32::MAX)) as f32);
        }
    }

    /// Linear light with the primaries of sRGB of one pixel, from the light of its codes. White is 1.
    fn srgb_light(&self, lights: [f64; 3]) -> [f64; 3] {
        let displayed = match &self.ootf {
            None => lights,
            Some(ootf) => ootf.displayed(lights),
        };
        times(self.matrix, displayed)
    }

    /// The linear light of each code from 0 to `max`, per channel.
    pub(crate) fn tables(&self, max: u32) -> [Vec<f64>; 3] {
        self.curves
            .each_ref()
            .map(|curve| (0..=max).map(|code| curve.light(f64::from(code) / f64::from(max))).collect())
    }

    /// The 8-bit sRGB codes of one pixel, from the light of its codes, and whether a channel is above white.
    pub(crate) fn encode_8(&self, lights: [f64; 3]) -> ([u8; 3], bool) {
        let light = self.srgb_light(lights);
        let is_clipped = light.iter().any(|light| *light > 1.0 + Self::ROUNDING);
        (light.map(|light| EIGHT.encode(light) as u8), is_clipped)
    }

    /// Rounding of light that does not count as above white (chosen).
    const ROUNDING: f64 = 1e-3;

    /// The sRGB codes of the light of one pixel.
    fn encode(&self, lights: [f64; 3], codes: &SrgbCodes) -> [u32; 3] {
        self.srgb_light(lights).map(|light| codes.encode(light))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_gains_of_hlg_are_exact_enough() {
        let ootf = Ootf::new([0.2627, 0.6780, 0.0593]);
        for step in 0..=100_000 {
            let scene = f64::from(step) / 100_000.0;
            let [_, found, _] = ootf.displayed([scene; 3]);
            let expected = scene * Ootf::gain(scene);
            assert!((found - expected).abs() < 1e-6, "{scene}: {found}, not {expected}");
        }
    }
}
