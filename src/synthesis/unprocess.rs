//! sRGB → RAW: the inverse of a camera's image processing ([`unprocess`], Brooks et al. 2019).

use std::sync::LazyLock;

use rayon::prelude::*;

use super::bayer::{Bayer, Plane, RawRow};
use super::camera::CameraState;
use super::curve;
use super::lanes::{Isa, Kernel, LANES, Lanes};
use crate::types::Rgb;

/// The noise-free RAW image from which a camera in this state would make `clean`.
///
/// An odd height or width is made even by repeating the last row or column.
#[must_use]
pub fn unprocess(clean: &Rgb, state: &CameraState) -> Bayer {
    let unprocess = Unprocess::new(state, Isa::best());
    let mut raw = Bayer::covering(clean.height(), clean.width());
    raw.lines_mut().enumerate().for_each(|(row, mut line)| {
        unprocess.fill(clean, row, &mut line);
        line.repeat_edges();
    });
    raw
}

/// Linear light of each 8-bit code: inverse tone curve, then gamma expansion.
static LINEAR_LIGHT: LazyLock<[f32; 256]> = LazyLock::new(|| {
    std::array::from_fn(|code| {
        curve::gamma_expand(curve::inverse_smoothstep(code as f64 / 255.0)) as f32
    })
});

/// Conversion of pixels to RAW for one camera, ready for any row.
#[derive(Debug)]
pub(super) struct Unprocess {
    filters: [Filter; 4],
    isa: Isa,
}

/// Conversion of linear sRGB to the samples of one plane.
#[derive(Debug, Clone, Copy)]
struct Filter {
    /// Weights of red, green and blue in the plane's camera channel.
    channel: [f32; 3],
    /// Weights of red, green and blue in the mean of the camera's channels.
    grey: [f32; 3],
    /// 1 / (white balance · brightness).
    inverse_gain: f32,
}

impl Unprocess {
    pub(super) fn new(state: &CameraState, isa: Isa) -> Self {
        let matrix = &state.rgb_to_camera;
        let grey = [0, 1, 2].map(|i| ((matrix[0][i] + matrix[1][i] + matrix[2][i]) / 3.0) as f32);
        let filters = Plane::ALL.map(|plane| {
            let (row, balance) = match plane {
                Plane::R => (0, state.red_gain),
                Plane::Gr | Plane::Gb => (1, 1.0),
                Plane::B => (2, state.blue_gain),
            };
            Filter {
                channel: matrix[row].map(|value| value as f32),
                grey,
                inverse_gain: (1.0 / (balance * state.rgb_gain)) as f32,
            }
        });
        Self { filters, isa }
    }

    /// Fills a sensor row from the pixels of `clean`.
    pub(super) fn fill(&self, clean: &Rgb, row: usize, line: &mut RawRow<'_>) {
        let width = clean.width();
        let pixels = clean.samples()[row.min(clean.height() - 1) * width * 3..]
            .as_chunks::<3>()
            .0;
        for (parity, samples) in line.planes().into_iter().enumerate() {
            self.isa.run(PlaneRow {
                filter: self.filters[Plane::at(row, parity) as usize],
                pixels: &pixels[..width],
                parity,
                samples,
            });
        }
    }
}

/// Sites of one plane in one row, with the pixels of that row.
struct PlaneRow<'a> {
    filter: Filter,
    pixels: &'a [[u8; 3]],
    parity: usize,
    samples: &'a mut [Lanes<f32>],
}

impl Kernel for PlaneRow<'_> {
    #[inline(always)]
    fn run(self) {
        let linear = &*LINEAR_LIGHT;
        for (index, samples) in self.samples.iter_mut().enumerate() {
            let mut light = [[0.0; LANES]; 3];
            let first = (2 * LANES * index).min(self.pixels.len() - 1);
            let pixels = &self.pixels[first..];
            if pixels.len() >= 2 * LANES {
                // The usual case: all pixels are inside the image, so the edge is not checked for each of them.
                for (lane, pair) in pixels.as_chunks::<2>().0[..LANES].iter().enumerate() {
                    for channel in 0..3 {
                        light[channel][lane] = linear[usize::from(pair[self.parity][channel])];
                    }
                }
            } else {
                for lane in 0..LANES {
                    let pixel = pixels[(2 * lane + self.parity).min(pixels.len() - 1)];
                    for channel in 0..3 {
                        light[channel][lane] = linear[usize::from(pixel[channel])];
                    }
                }
            }
            *samples = self.filter.samples(&light);
        }
    }
}

impl Filter {
    /// Samples of colours in linear sRGB: white balance and brightness are undone, and the result is clipped to [0, 1].
    ///
    /// Highlights are preserved: between a grey of 0.9 and 1 the gain goes to 1, so that white stays white (Brooks et al.
    /// 2019, `safe_invert_gains`).
    #[inline(always)]
    fn samples(&self, [red, green, blue]: &[Lanes<f32>; 3]) -> Lanes<f32> {
        let mut samples = [0.0; LANES];
        for i in 0..LANES {
            let product = |row: [f32; 3]| row[0] * red[i] + row[1] * green[i] + row[2] * blue[i];
            let above = (product(self.grey) - 0.9) * 10.0;
            let highlight = if above > 0.0 { above } else { 0.0 };
            let mask = highlight * highlight;
            let faded = mask + (1.0 - mask) * self.inverse_gain;
            let gain = if faded > self.inverse_gain {
                faded
            } else {
                self.inverse_gain
            };
            let sample = product(self.channel) * gain;
            let sample = if sample > 0.0 { sample } else { 0.0 };
            samples[i] = if sample < 1.0 { sample } else { 1.0 };
        }
        samples
    }
}

#[cfg(test)]
mod tests {
    use super::super::camera::tests::median;
    use super::*;

    fn flat(code: u8, height: usize, width: usize) -> Bayer {
        let clean = Rgb::new(height, width, vec![code; height * width * 3]).unwrap();
        unprocess(&clean, &median())
    }

    #[test]
    fn grey_is_divided_by_the_gains_of_its_plane() {
        let raw = flat(128, 4, 4);
        let light = f64::from(LINEAR_LIGHT[128]);
        for row in 0..4 {
            for column in 0..4 {
                let gain = match Plane::at(row, column) {
                    Plane::R => 2.15 * 1.25,
                    Plane::Gr | Plane::Gb => 1.25,
                    Plane::B => 1.7 * 1.25,
                };
                let sample = f64::from(raw.sample(row, column));
                assert!((sample - light / gain).abs() < 1e-7);
            }
        }
    }

    #[test]
    fn white_is_preserved() {
        for row in 0..2 {
            for column in 0..2 {
                let sample = flat(255, 2, 2).sample(row, column);
                assert!((sample - 1.0).abs() < 1e-6);
            }
        }
    }

    #[test]
    fn the_last_row_and_column_of_an_odd_image_are_repeated() {
        let samples: Vec<u8> = (0..27).map(|i| i * 9).collect();
        let odd = Rgb::new(3, 3, samples.clone()).unwrap();
        let pixel =
            |row: usize, column: usize| &samples[(row.min(2) * 3 + column.min(2)) * 3..][..3];
        let padded = (0..16).flat_map(|i| pixel(i / 4, i % 4).to_vec()).collect();
        let even = Rgb::new(4, 4, padded).unwrap();
        assert_eq!(unprocess(&odd, &median()), unprocess(&even, &median()));
    }
}
