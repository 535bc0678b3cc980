//! sRGB → RAW: the inverse of a camera's image processing ([`unprocess`], Brooks et al. 2019).

use std::sync::LazyLock;

use rayon::prelude::*;

use super::bayer::{Bayer, Plane, RawRow};
use crate::camera::CameraState;
use crate::clean::{self, Clean};
use crate::draws::{LANES, Lanes, Piecewise};
use darkqa_base::types::images::{Isa, Kernel};

/// Makes the noise-free RAW image from which a camera in this state would make `clean`.
///
/// An odd height or width is made even by repeating the last row or column.
#[must_use]
pub fn unprocess<'a>(clean: impl Into<Clean<'a>>, state: &CameraState) -> Bayer {
    unprocess_with_headroom(clean, state, 0.0)
}

/// [`unprocess`] for a sensor that saturates this many EV above white; the headroom only affects linear scene light.
pub fn unprocess_with_headroom<'a>(clean: impl Into<Clean<'a>>, state: &CameraState, headroom_ev: f64) -> Bayer {
    let clean = clean.into();
    let headroom = libm::exp2(headroom_ev) as f32;
    let unprocess = Unprocess::new(state, Isa::best()).with_headroom(headroom);
    let mut raw = Bayer::covering(clean.height(), clean.width());
    raw.lines_mut().enumerate().for_each(|(row, mut line)| {
        unprocess.fill(clean, row, &mut line);
        line.repeat_edges();
    });
    raw
}

/// Conversion of the samples of one pixel format to linear scene light and sensor samples.
trait ToSceneLight {
    /// Sample type of the clean image.
    type Sample: Copy;

    /// Light in front of the camera: inverse tone curve, then gamma expansion.
    fn light(&self, sample: Self::Sample) -> f32;

    /// Sensor samples of one plane for these colours.
    #[inline(always)]
    fn samples(&self, filter: &Filter, light: &[Lanes<f32>; 3]) -> Lanes<f32> {
        filter.samples(light)
    }
}

/// Light of each 8-bit code in front of the camera.
static LINEAR_LIGHT: LazyLock<[f32; 256]> = LazyLock::new(|| {
    std::array::from_fn(|code| clean::gamma_expand(clean::inverse_smoothstep(code as f64 / 255.0)) as f32)
});

/// Codes of 8 bits.
impl ToSceneLight for &[f32; 256] {
    type Sample = u8;

    #[inline(always)]
    fn light(&self, code: u8) -> f32 {
        self[usize::from(code)]
    }
}

/// Light of each 16-bit code in front of the camera.
static LINEAR_LIGHT_16: LazyLock<Box<[f32; 65_536]>> = LazyLock::new(|| {
    let light: Vec<f32> = (0..=u16::MAX)
        .map(|code| clean::gamma_expand(clean::inverse_smoothstep(f64::from(code) / 65_535.0)) as f32)
        .collect();
    light.try_into().unwrap_or_else(|_| unreachable!("there are 65 536 codes"))
});

/// Codes of 16 bits.
impl ToSceneLight for &[f32; 65_536] {
    type Sample = u16;

    #[inline(always)]
    fn light(&self, code: u16) -> f32 {
        self[usize::from(code)]
    }
}

/// Linear scene light, for a sensor that saturates at `headroom`.
struct LinearScene {
    headroom: f32,
}

impl ToSceneLight for LinearScene {
    type Sample = f32;

    #[inline(always)]
    fn light(&self, light: f32) -> f32 {
        light
    }

    /// Highlights are not preserved, because white is not special in scene light.
    #[inline(always)]
    fn samples(&self, filter: &Filter, light: &[Lanes<f32>; 3]) -> Lanes<f32> {
        filter.plain_samples(light, self.headroom)
    }
}

/// Light in front of the camera for display light.
static INVERSE_TONE: LazyLock<InverseToneTable> = LazyLock::new(InverseToneTable::new);

/// Smallest light, and smallest distance from white, in the tables: 2⁻³¹. Smaller values count as black or white.
const MIN_LIGHT: f32 = 1.0 / 2_147_483_648.0;

/// Tables from display light in [0, 1] to light in front of the camera, with the same curve as for codes.
#[derive(Debug)]
struct InverseToneTable {
    /// Table by light, for light below ½.
    dark: Piecewise,
    /// Table by the distance from white, where the inverse tone curve is as steep as a square root at 0.
    bright: Piecewise,
}

impl InverseToneTable {
    fn new() -> Self {
        Self {
            dark: Piecewise::new(-31, |light| scene_light(zero_if_negligible(light))),
            bright: Piecewise::new(-31, |distance| scene_light(1.0 - zero_if_negligible(distance))),
        }
    }
}

/// Light in front of the camera for display light.
fn scene_light(display_light: f64) -> f64 {
    // Not `gamma_compress`, whose floor would make all darker light equal.
    let display = libm::pow(display_light.max(0.0), 1.0 / clean::GAMMA);
    clean::gamma_expand(clean::inverse_smoothstep(display))
}

fn zero_if_negligible(x: f64) -> f64 {
    if x > f64::from(MIN_LIGHT) { x } else { 0.0 }
}

/// Display light; light above 1 counts as 1.
impl ToSceneLight for &InverseToneTable {
    type Sample = f32;

    #[inline(always)]
    fn light(&self, light: f32) -> f32 {
        let at_least = |x: f32| if x > MIN_LIGHT { x } else { MIN_LIGHT };
        if light < 0.5 { self.dark.at(at_least(light)) } else { self.bright.at(at_least(1.0 - light)) }
    }
}

/// Conversion of pixels to RAW for one camera, prepared for any row.
#[derive(Debug)]
pub(super) struct Unprocess {
    filters: [Filter; 4],
    /// Scene light at which the sensor saturates; 1 is white. Codes have no light above white.
    headroom: f32,
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
        Self { filters, headroom: 1.0, isa }
    }

    /// Sets the scene light at which the sensor saturates; 1 is white.
    pub(super) fn with_headroom(self, headroom: f32) -> Self {
        Self { headroom, ..self }
    }

    /// Fills a sensor row from the pixels of `clean`.
    pub(super) fn fill(&self, clean: Clean<'_>, row: usize, line: &mut RawRow<'_>) {
        let (row_of_pixels, width) = (row.min(clean.height() - 1), clean.width());
        let samples = row_of_pixels * width * 3..(row_of_pixels + 1) * width * 3;
        match clean {
            Clean::Codes(codes) => {
                self.fill_from(&*LINEAR_LIGHT, &codes.samples()[samples], row, line);
            }
            Clean::Rgb16Image(codes) => {
                let curve: &[f32; 65_536] = &LINEAR_LIGHT_16;
                self.fill_from(curve, &codes.samples()[samples], row, line);
            }
            Clean::Light(light) => {
                self.fill_from(&*INVERSE_TONE, &light.samples()[samples], row, line);
            }
            Clean::Scene(light) => {
                let scene = LinearScene { headroom: self.headroom };
                self.fill_from(scene, &light.samples()[samples], row, line);
            }
        }
    }

    /// Fills a sensor row from the samples of a row of pixels.
    #[expect(clippy::needless_pass_by_value, reason = "a reference or one number")]
    fn fill_from<U: ToSceneLight>(&self, to_light: U, row_of_pixels: &[U::Sample], row: usize, line: &mut RawRow<'_>) {
        let pixels = row_of_pixels.as_chunks::<3>().0;
        for (parity, samples) in line.planes().into_iter().enumerate() {
            self.isa.run(PlaneRow {
                to_light: &to_light,
                filter: self.filters[Plane::at(row, parity) as usize],
                pixels,
                parity,
                samples,
            });
        }
    }
}

/// Sites of one plane in one row, with the pixels of that row.
struct PlaneRow<'a, U: ToSceneLight> {
    to_light: &'a U,
    filter: Filter,
    pixels: &'a [[U::Sample; 3]],
    parity: usize,
    samples: &'a mut [Lanes<f32>],
}

impl<U: ToSceneLight> Kernel for PlaneRow<'_, U> {
    #[inline(always)]
    fn run(self) {
        let to_light = self.to_light;
        for (index, samples) in self.samples.iter_mut().enumerate() {
            let mut light = [[0.0; LANES]; 3];
            let first = (2 * LANES * index).min(self.pixels.len() - 1);
            let pixels = &self.pixels[first..];
            if pixels.len() >= 2 * LANES {
                // The usual case: all pixels are inside the image, so the edge is not checked for each of them.
                for (lane, pair) in pixels.as_chunks::<2>().0[..LANES].iter().enumerate() {
                    for channel in 0..3 {
                        light[channel][lane] = to_light.light(pair[self.parity][channel]);
                    }
                }
            } else {
                for lane in 0..LANES {
                    let pixel = pixels[(2 * lane + self.parity).min(pixels.len() - 1)];
                    for channel in 0..3 {
                        light[channel][lane] = to_light.light(pixel[channel]);
                    }
                }
            }
            *samples = to_light.samples(&self.filter, &light);
        }
    }
}

impl Filter {
    /// Samples of colours in linear sRGB: white balance and brightness are undone, and the result is clipped to [0, 1].
    ///
    /// Highlights are preserved: between a grey of 0.9 and 1 the gain goes to 1, so that white stays white (Brooks et
    /// al. 2019, `safe_invert_gains`).
    #[inline(always)]
    fn samples(&self, [red, green, blue]: &[Lanes<f32>; 3]) -> Lanes<f32> {
        let mut samples = [0.0; LANES];
        for i in 0..LANES {
            let product = |row: [f32; 3]| row[0] * red[i] + row[1] * green[i] + row[2] * blue[i];
            let above = (product(self.grey) - 0.9) * 10.0;
            let highlight = if above > 0.0 { above } else { 0.0 };
            let mask = highlight * highlight;
            let faded = mask + (1.0 - mask) * self.inverse_gain;
            let gain = if faded > self.inverse_gain { faded } else { self.inverse_gain };
            let sample = product(self.channel) * gain;
            let sample = if sample > 0.0 { sample } else { 0.0 };
            samples[i] = if sample < 1.0 { sample } else { 1.0 };
        }
        samples
    }

    /// [`Self::samples`] without preserved highlights, for light that may be brighter than white; clipped to [0,
    /// `headroom`].
    #[inline(always)]
    fn plain_samples(&self, [red, green, blue]: &[Lanes<f32>; 3], headroom: f32) -> Lanes<f32> {
        let mut samples = [0.0; LANES];
        let row = self.channel;
        for i in 0..LANES {
            let product = row[0] * red[i] + row[1] * green[i] + row[2] * blue[i];
            let sample = product * self.inverse_gain;
            let sample = if sample > 0.0 { sample } else { 0.0 };
            samples[i] = if sample < headroom { sample } else { headroom };
        }
        samples
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::tests::median;
    use darkqa_base::types::{Light, Rgb};

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
        let padded = (0..16)
            .flat_map(|i: usize| {
                let (row, column) = ((i / 4).min(2), (i % 4).min(2));
                samples[(row * 3 + column) * 3..][..3].to_vec()
            })
            .collect();
        let even = Rgb::new(4, 4, padded).unwrap();
        assert_eq!(unprocess(&odd, &median()), unprocess(&even, &median()));
    }

    /// Every code, in the channels of 16 × 16 pixels in three orders.
    fn codes() -> Rgb {
        Rgb::new(16, 16, (0..256).flat_map(|i: u32| [i as u8, (i * 101) as u8, 255 - i as u8]).collect()).unwrap()
    }

    /// Display light of a code plus `more` codes.
    fn display_light(code: u8, more: f64) -> f32 {
        libm::pow(((f64::from(code) + more) / 255.0).clamp(0.0, 1.0), 2.2) as f32
    }

    fn light(image: &Rgb, more: f64) -> Light {
        let samples = image.samples().iter().map(|code| display_light(*code, more)).collect();
        Light::new(image.height(), image.width(), samples).unwrap()
    }

    fn max_difference(one: &Bayer, other: &Bayer) -> f32 {
        (0..one.height())
            .flat_map(|row| (0..one.width()).map(move |at| (row, at)))
            .map(|(row, at)| (one.sample(row, at) - other.sample(row, at)).abs())
            .fold(0.0, f32::max)
    }

    #[test]
    fn light_of_codes_gives_the_same_raw_image() {
        let (codes, state) = (codes(), median());
        let raw = unprocess(&codes, &state);
        let exact = light(&codes, 0.0);
        assert!(max_difference(&raw, &unprocess(&exact, &state)) < 2e-6);
        // A difference of a twentieth of a code is detected.
        let other = light(&codes, 0.05);
        assert!(max_difference(&raw, &unprocess(&other, &state)) > 1e-4);
    }

    #[test]
    fn light_follows_the_formula_between_the_codes_and_at_both_ends() {
        let table = &*INVERSE_TONE;
        for (ends, expected) in [(0.0, LINEAR_LIGHT[0]), (1.0, 1.0), (1.5, 1.0), (1e-12, 0.0)] {
            assert!((table.light(ends) - expected).abs() < 1e-9, "{ends}");
        }
        let mut last = 0.0;
        for step in 0..=200_000 {
            let at = (f64::from(step) / 200_000.0).powi(3) as f32;
            let display = libm::pow(f64::from(at), 1.0 / clean::GAMMA);
            let expected = clean::gamma_expand(clean::inverse_smoothstep(display));
            let found = table.light(at);
            let off = (f64::from(found) - expected).abs();
            // Light below the smallest one is black.
            assert!(at <= 2.0 * MIN_LIGHT || off < 1e-7 + 4e-6 * expected, "{at}: {off}");
            assert!(found >= last, "{at}");
            last = found;
        }
    }
}
