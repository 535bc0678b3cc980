//! Codes of other colours → sRGB codes: [`Conversion`].

use super::curve::ToneCurve;
use super::primaries::{Matrix, times};
use super::srgb::{EIGHT, SIXTEEN, SrgbCodes};

/// The conversion of three channels: a curve each to linear light, a matrix to the primaries of sRGB, and the curve of sRGB.
/// White stays white, and colours that sRGB does not have are clipped (relative colorimetric).
///
/// It is computed here in double precision, because a library takes what instructions a machine has, and then its codes differ
/// by one between machines.
#[derive(Debug)]
pub(crate) struct Conversion {
    curves: [ToneCurve; 3],
    matrix: Matrix,
}

impl Conversion {
    pub(super) fn new(curves: [ToneCurve; 3], matrix: Matrix) -> Self {
        Self { curves, matrix }
    }

    /// Whether all of 17 × 17 × 17 evenly spaced colours change by one code of 255 at most.
    pub(super) fn is_identity(&self) -> bool {
        let grid: Vec<f64> = (0..17).map(|i| f64::from(i) / 16.0).collect();
        let light: Vec<Vec<f64>> = self
            .curves
            .iter()
            .map(|curve| grid.iter().map(|value| curve.light(*value)).collect())
            .collect();
        // 16-bit codes show parts of a code.
        let is_near = |light: f64, value: f64| {
            let code = f64::from(SIXTEEN.encode(light)) / 65_535.0;
            (code - value).abs() * 255.0 <= 1.0
        };
        (0..17 * 17 * 17).all(|i| {
            let at = [i / 289, i / 17 % 17, i % 17];
            let lights = [0, 1, 2].map(|channel| light[channel][at[channel]]);
            let converted = times(self.matrix, lights);
            (0..3).all(|channel| is_near(converted[channel], grid[at[channel]]))
        })
    }

    /// Converts 8-bit samples, red, green and blue of each pixel.
    pub(crate) fn convert_8(&self, samples: &mut [u8]) {
        let tables = self.tables(255);
        let convert = |pixel: [u8; 3]| {
            let lights = [0, 1, 2].map(|i| tables[i][usize::from(pixel[i])]);
            self.codes(lights, &EIGHT).map(|code| code as u8)
        };
        for pixel in samples.as_chunks_mut::<3>().0 {
            *pixel = convert(*pixel);
        }
    }

    /// Converts 16-bit samples, red, green and blue of each pixel.
    pub(crate) fn convert_16(&self, samples: &mut [u16]) {
        let tables = self.tables(65_535);
        let convert = |pixel: [u16; 3]| {
            let lights = [0, 1, 2].map(|i| tables[i][usize::from(pixel[i])]);
            self.codes(lights, &SIXTEEN).map(|code| code as u16)
        };
        for pixel in samples.as_chunks_mut::<3>().0 {
            *pixel = convert(*pixel);
        }
    }

    /// Converts linear light, red, green and blue of each pixel. Colours that the primaries of sRGB do not reach are clipped.
    pub(crate) fn convert_light(&self, samples: &mut [f32]) {
        for pixel in samples.as_chunks_mut::<3>().0 {
            let light = times(self.matrix, pixel.map(f64::from));
            *pixel = light.map(|light| light.clamp(0.0, f64::from(f32::MAX)) as f32);
        }
    }

    /// The light of each code from 0 to `most`, by channel.
    fn tables(&self, most: u32) -> [Vec<f64>; 3] {
        self.curves.each_ref().map(|curve| {
            let codes = 0..=most;
            codes
                .map(|code| curve.light(f64::from(code) / f64::from(most)))
                .collect()
        })
    }

    fn codes(&self, lights: [f64; 3], codes: &SrgbCodes) -> [u32; 3] {
        times(self.matrix, lights).map(|light| codes.encode(light))
    }
}
