//! RAW → sRGB: the simple image processing of the paper ([`balance`], then [`render`] at a level).
//!
//! Per pixel it needs sums and products alone; the curves are in the thresholds of an [`Encoder`].

use rayon::prelude::*;

use super::bayer::{Bayer, Plane};
use super::camera::CameraState;
use super::curve;
use super::profile::Tone;
use crate::types::{DarkLevel, Rgb};

/// White balance and brightness gains, clipped to [0, 1].
pub fn balance(raw: &mut Bayer, state: &CameraState) {
    let gains = [state.red_gain, 1.0, 1.0, state.blue_gain]
        .map(|balance| (balance * state.rgb_gain) as f32);
    raw.rows_mut().enumerate().for_each(|(row, line)| {
        for (column, sample) in line.iter_mut().enumerate() {
            let gain = gains[Plane::at(row, column) as usize];
            *sample = (*sample * gain).clamp(0.0, 1.0);
        }
    });
}

/// Develops a balanced RAW image into `dark`, which it covers: bilinear demosaic, camera → sRGB, clip, exposure drop,
/// gamma compression, tone curve, 8 bit.
pub fn render(balanced: &Bayer, state: &CameraState, tone: Tone, level: DarkLevel, dark: &mut Rgb) {
    let encoder = Encoder::new(level, tone);
    let matrix = state.camera_to_rgb.map(|row| row.map(|value| value as f32));
    let width = dark.width();
    dark.samples_mut()
        .par_chunks_mut(3 * width)
        .enumerate()
        .for_each_init(
            || vec![[0.0; 3]; width],
            |pixels, (row, samples)| {
                balanced.demosaic_row(row, pixels);
                for (codes, camera) in samples.as_chunks_mut::<3>().0.iter_mut().zip(pixels) {
                    for (code, row) in codes.iter_mut().zip(&matrix) {
                        let light = row[0] * camera[0] + row[1] * camera[1] + row[2] * camera[2];
                        *code = encoder.code(light.clamp(0.0, 1.0));
                    }
                }
            },
        );
}

/// Linear light → 8-bit code at a level, as a search for the last threshold that the light reaches.
///
/// Thresholds say exactly where each code begins, so that no resolution of a table enters the result.
#[derive(Debug, Clone)]
pub struct Encoder {
    /// The least light of each code; above the last code, infinity.
    thresholds: [f32; 257],
    /// The code at the lower end of each of `CELLS` equal cells of [0, 1], and at 1.
    first: Vec<u8>,
}

const CELLS: usize = 4096;

impl Encoder {
    /// The encoder of a level: ((c − ½) / 255)^2.2 · 2^ΔEV is where code c begins (DarkQA, eqs. 2 and 3 inverted), or
    /// where it begins behind a tone curve.
    #[must_use]
    pub fn new(level: DarkLevel, tone: Tone) -> Self {
        let left = curve::light_left(level.exposure_drop());
        let mut thresholds = [0.0; 257];
        for (code, threshold) in thresholds.iter_mut().enumerate().skip(1) {
            let display = (code as f64 - 0.5) / 255.0;
            let light = match tone {
                Tone::None => curve::gamma_expand(display) / left,
                Tone::AfterEv => curve::gamma_expand(curve::inverse_smoothstep(display)) / left,
                Tone::BeforeEv => {
                    let before = curve::gamma_compress(curve::gamma_expand(display) / left);
                    if before > 1.0 {
                        f64::INFINITY
                    } else {
                        curve::gamma_expand(curve::inverse_smoothstep(before))
                    }
                }
            };
            *threshold = light as f32;
        }
        thresholds[256] = f32::INFINITY;
        let begins_by = |light: f32| thresholds.partition_point(|threshold| *threshold <= light);
        let first = (0..=CELLS)
            .map(|cell| (begins_by(cell as f32 / CELLS as f32) - 1) as u8)
            .collect();
        Self { thresholds, first }
    }

    /// The code of some light in [0, 1].
    #[must_use]
    pub fn code(&self, light: f32) -> u8 {
        let cell = (light * CELLS as f32) as usize;
        let mut code = self.first[cell.min(CELLS)];
        while light >= self.thresholds[usize::from(code) + 1] {
            code += 1;
        }
        code
    }
}

#[cfg(test)]
mod tests {
    use super::super::camera::tests::median;
    use super::*;

    /// Against the paper's own order of operations, but where light lies on the very edge between two codes.
    #[test]
    fn the_encoder_is_the_papers_formula() {
        for level in DarkLevel::ALL {
            let encoder = Encoder::new(level, Tone::None);
            let left = curve::light_left(level.exposure_drop());
            let display = |light: f32| curve::gamma_compress(left * f64::from(light)) * 255.0;
            for step in 0..=300_000 {
                let light = step as f32 / 300_000.0;
                let edge = (display(light) + 0.5).fract();
                if edge > 1e-4 && edge < 1.0 - 1e-4 {
                    let due = curve::to_code(display(light) / 255.0);
                    assert_eq!(encoder.code(light), due, "{level:?} at {light}");
                }
            }
        }
    }

    #[test]
    fn the_encoder_takes_its_ends() {
        let ends = DarkLevel::ALL.map(|level| {
            let encoder = Encoder::new(level, Tone::None);
            (encoder.code(0.0), encoder.code(1.0))
        });
        assert_eq!(ends, [(0, 136), (0, 72), (0, 39), (0, 24), (0, 15)]);
    }

    #[test]
    fn gains_are_applied_to_their_planes_and_clipped() {
        let mut raw = Bayer::covering(2, 4);
        raw.rows_mut()
            .for_each(|line| line.copy_from_slice(&[0.1, 0.1, -0.1, 0.9]));
        balance(&mut raw, &median());
        let due = [
            [0.1 * 2.15 * 1.25, 0.1 * 1.25],
            [0.1 * 1.25, 0.1 * 1.7 * 1.25],
        ];
        for (row, due) in due.iter().enumerate() {
            let line = raw.row(row);
            assert!(
                due.iter()
                    .zip(line)
                    .all(|(due, found)| (due - found).abs() < 1e-6)
            );
            assert!(line[2].abs() < f32::EPSILON);
            assert!((line[3] - 1.0).abs() < f32::EPSILON);
        }
    }
}
