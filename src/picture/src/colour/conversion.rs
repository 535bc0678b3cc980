//! Conversion of codes and light from other RGB colour spaces to sRGB: [`Conversion`].

use super::curve::ToneCurve;
use super::primaries::{Matrix, times};
use super::srgb::{EIGHT, SIXTEEN, SrgbCodes};

/// Conversion of RGB colours to sRGB: a tone curve per channel to linear light, a matrix to the primaries of sRGB, and the sRGB curve.
/// White stays white, and colours outside the gamut of sRGB are clipped (relative colorimetric).
///
/// Computed in double precision, because a library that uses the vector instructions of the machine gives codes that differ by one between
/// machines.
#[derive(Debug)]
pub(crate) struct Conversion {
    curves: [ToneCurve; 3],
    matrix: Matrix,
}

impl Conversion {
    pub(super) fn new(curves: [ToneCurve; 3], matrix: Matrix) -> Self {
        Self { curves, matrix }
    }

    /// True if the conversion changes each of 17 × 17 × 17 evenly spaced colours by at most one 8-bit code.
    pub(super) fn is_identity(&self) -> bool {
        let grid: Vec<f64> = (0..17).map(|i| f64::from(i) / 16.0).collect();
        let light: Vec<Vec<f64>> = self
            .curves
            .iter()
            .map(|curve| grid.iter().map(|value| curve.light(*value)).collect())
            .collect();
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

    /// The linear light of each code from 0 to `max`, per channel.
    fn tables(&self, max: u32) -> [Vec<f64>; 3] {
        self.curves.each_ref().map(|curve| {
            (0..=max)
                .map(|code| curve.light(f64::from(code) / f64::from(max)))
                .collect()
        })
    }

    /// The sRGB codes of the light of one pixel.
    fn encode(&self, lights: [f64; 3], codes: &SrgbCodes) -> [u32; 3] {
        times(self.matrix, lights).map(|light| codes.encode(light))
    }
}
