//! RAW → sRGB: the simple image processing of the paper ([`Developer`]).
//!
//! Two steps are not in the list of the paper. First, the brightness gain is applied again: the paper names only white
//! balance, but calls the processing "an inverse operation of unprocessing", which divides by this gain. Second, light
//! is clipped to [0, 1] before demosaicing and after the matrix, as in the code of Brooks et al. 2019 (`process.py`),
//! so that negative noise becomes black. The module `departures` measures both effects.
//!
//! The steps: white balance and brightness gains, clip; bilinear demosaic; camera → sRGB, clip; exposure drop; gamma
//! compression; 8 bit. Because (2^−ΔEV · x)^(1/2.2) is 2^(−ΔEV/2.2) · x^(1/2.2), the drop is applied as a factor after
//! the gamma compression, and all steps before it are shared by all levels.

use std::sync::LazyLock;

use super::bayer::{self, Bayer, Plane, RawRow, Sites};
use crate::camera::CameraState;
use crate::curve;
use crate::draws::{LANES, Lanes, Piecewise};
use crate::noise_profile::Tone;
use darkqa_base::types::images::{Isa, Kernel};

/// Gamma compression of light from 2⁻³¹ up; light below 10⁻⁸ is treated as 10⁻⁸.
static GAMMA: LazyLock<Piecewise> = LazyLock::new(|| Piecewise::new(-31, curve::gamma_compress));

/// Light of display values from 2⁻³⁰ up.
static LIGHT: LazyLock<Piecewise> = LazyLock::new(|| Piecewise::new(-30, curve::gamma_expand));

/// Smallest display value in the table of light, 2⁻³⁰.
const DARKEST_DISPLAY: f32 = 1.0 / 1_073_741_824.0;

/// Smallest light in the table, 2⁻³¹: black, which is code 0 at every level.
const DARKEST: f32 = 1.0 / 2_147_483_648.0;

/// 2^23: adding it to a number from 0 to 255 leaves the nearest whole number in the lowest byte.
const ROUND: f32 = 8_388_608.0;

/// The light of a display value in [0, 1].
#[inline(always)]
fn expand(light: &Piecewise, display: f32) -> f32 {
    light.at(if display > DARKEST_DISPLAY { display } else { DARKEST_DISPLAY })
}

/// Image processing of one camera, prepared for any row.
#[derive(Debug)]
pub(crate) struct Developer {
    /// Gain of each Bayer plane: white balance times brightness.
    gains: [f32; 4],
    /// Matrix from camera colours to linear sRGB.
    matrix: [[f32; 3]; 3],
    tone: Tone,
    /// Light at which the sensor saturates, in EV above white.
    headroom_ev: f64,
    /// Light at which the sensor saturates; 1 is white.
    headroom: f32,
    isa: Isa,
}

impl Developer {
    pub(crate) fn new(state: &CameraState, tone: Tone, isa: Isa) -> Self {
        Self {
            gains: [state.red_gain, 1.0, 1.0, state.blue_gain].map(|balance| (balance * state.rgb_gain) as f32),
            matrix: state.camera_to_rgb.map(|row| row.map(|value| value as f32)),
            tone,
            headroom_ev: 0.0,
            headroom: 1.0,
            isa,
        }
    }

    /// Prepares for linear scene light and a sensor that saturates this many EV above white. Display values are then in
    /// units of the saturation, and no tone curve is applied before the drop.
    pub(super) fn for_linear_light(self, headroom_ev: f64) -> Self {
        let tone = match self.tone {
            Tone::BeforeEv => Tone::None,
            tone => tone,
        };
        Self { tone, headroom_ev, headroom: libm::exp2(headroom_ev) as f32, ..self }
    }

    /// The factor of an exposure drop on display values.
    pub(crate) fn factor(&self, drop_ev: f64) -> f32 {
        curve::display_factor(drop_ev - self.headroom_ev) as f32
    }

    /// Multiplies a sensor row by the white-balance and brightness gains and clips it between 0 and the sensor's
    /// saturation.
    pub(crate) fn balance(&self, row: usize, line: &mut RawRow<'_>) {
        for (parity, samples) in line.planes().into_iter().enumerate() {
            let gain = self.gains[Plane::at(row, parity) as usize];
            self.isa.run(WhiteBalance { gain, most: self.headroom, samples });
        }
    }

    /// Writes the display values in [0, 1] of a row of pixels before the exposure drop, as red, green, blue of each
    /// pixel. `values` may be shorter than the row.
    ///
    /// `row` is an index into `balanced`. The first and last row are mirrored; if `balanced` is a part of an image, it
    /// must also contain the rows next to those asked for.
    pub(crate) fn display(&self, balanced: &Bayer, row: usize, values: &mut [f32]) {
        let last = balanced.height() - 1;
        let rows = [if row == 0 { 1 } else { row - 1 }, row, if row == last { row - 1 } else { row + 1 }];
        self.isa.run(Display { developer: self, rows: rows.map(|row| balanced.sites(row)), row, values });
    }

    /// Writes the 8-bit codes of display values after an exposure drop with this [`Developer::factor`].
    pub(crate) fn encode(&self, display: &[f32], factor: f32, codes: &mut [u8]) {
        self.isa.run(Encode { display, factor, tone: self.tone, codes });
    }

    /// Writes the linear light of display values after an exposure drop. [`Developer::encode`] writes the same as
    /// rounded codes.
    pub(super) fn expand(&self, display: &[f32], factor: f32, light: &mut [f32]) {
        self.isa.run(Expand { display, factor, tone: self.tone, light });
    }
}

struct WhiteBalance<'a> {
    gain: f32,
    most: f32,
    samples: &'a mut [Lanes<f32>],
}

impl Kernel for WhiteBalance<'_> {
    #[inline(always)]
    fn run(self) {
        for sample in self.samples.as_flattened_mut() {
            let balanced = *sample * self.gain;
            let balanced = if balanced > 0.0 { balanced } else { 0.0 };
            *sample = if balanced < self.most { balanced } else { self.most };
        }
    }
}

/// Clips to [0, 1].
#[inline(always)]
fn clip(x: f32) -> f32 {
    let x = if x > 0.0 { x } else { 0.0 };
    if x < 1.0 { x } else { 1.0 }
}

struct Display<'a> {
    developer: &'a Developer,
    /// The rows above, at and below `row`.
    rows: [Sites<'a>; 3],
    row: usize,
    values: &'a mut [f32],
}

impl Kernel for Display<'_> {
    #[inline(always)]
    fn run(self) {
        let gamma = &*GAMMA;
        let scale = 1.0 / self.developer.headroom;
        let mut colours = [[[0.0; LANES]; 3]; 2];
        for (index, values) in self.values.chunks_mut(6 * LANES).enumerate() {
            bayer::demosaic(self.rows, self.row, index, &mut colours);
            self.developer.to_linear_srgb(&mut colours, scale);
            for channel in colours.as_flattened_mut() {
                *channel = gamma.lanes(channel);
            }
            let [[er, eg, eb], [or, og, ob]] = &colours;
            let mut pairs = [[0.0; 6]; LANES];
            for (lane, pair) in pairs.iter_mut().enumerate() {
                *pair = [er[lane], eg[lane], eb[lane], or[lane], og[lane], ob[lane]];
            }
            values.copy_from_slice(&pairs.as_flattened()[..values.len()]);
            if self.developer.tone == Tone::BeforeEv {
                for value in values {
                    *value = curve::smoothstep(*value);
                }
            }
        }
    }
}

impl Developer {
    /// Converts camera colours to linear sRGB in units of the sensor's saturation, clipped to [`DARKEST`] to 1. `scale`
    /// is 1 / that unit.
    #[inline(always)]
    fn to_linear_srgb(&self, colours: &mut bayer::Colours, scale: f32) {
        let [red, green, blue] = self.matrix;
        for [r, g, b] in colours {
            for i in 0..LANES {
                let camera = [r[i], g[i], b[i]];
                let product = |row: [f32; 3]| {
                    let x = row[0] * camera[0] + row[1] * camera[1] + row[2] * camera[2];
                    let x = x * scale;
                    let x = if x > DARKEST { x } else { DARKEST };
                    if x < 1.0 { x } else { 1.0 }
                };
                r[i] = product(red);
                g[i] = product(green);
                b[i] = product(blue);
            }
        }
    }
}

struct Encode<'a> {
    display: &'a [f32],
    /// Factor of the exposure drop on display values.
    factor: f32,
    tone: Tone,
    codes: &'a mut [u8],
}

impl Kernel for Encode<'_> {
    #[inline(always)]
    fn run(self) {
        let codes = self.codes.iter_mut().zip(self.display);
        if self.tone == Tone::AfterEv {
            for (code, value) in codes {
                let display = curve::smoothstep(clip(value * self.factor));
                *code = (display * 255.0 + ROUND).to_bits() as u8;
            }
        } else {
            let scale = 255.0 * self.factor;
            for (code, value) in codes {
                let scaled = value * scale;
                let scaled = if scaled < 255.0 { scaled } else { 255.0 };
                *code = (scaled + ROUND).to_bits() as u8;
            }
        }
    }
}

struct Expand<'a> {
    display: &'a [f32],
    /// Factor of the exposure drop on display values.
    factor: f32,
    tone: Tone,
    light: &'a mut [f32],
}

impl Kernel for Expand<'_> {
    #[inline(always)]
    fn run(self) {
        let table = &*LIGHT;
        for (light, value) in self.light.iter_mut().zip(self.display) {
            let display = clip(value * self.factor);
            *light = expand(
                table,
                match self.tone {
                    Tone::AfterEv => curve::smoothstep(display),
                    Tone::None | Tone::BeforeEv => display,
                },
            );
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::tests::median;
    use darkqa_base::types::Severity;

    fn developer(tone: Tone) -> Developer {
        Developer::new(&median(), tone, Isa::best())
    }

    /// Comparison with the order of operations of the paper, except for light at the edge between two codes.
    #[test]
    fn codes_follow_the_formula_of_the_paper() {
        for level in Severity::LADDER {
            let factor = curve::light_factor(level.value());
            let light: Vec<f32> = (0..=300_000).map(|step| step as f32 / 300_000.0).collect();
            let display: Vec<f32> = light.iter().map(|x| GAMMA.at(x.max(DARKEST))).collect();
            let mut codes = vec![0; light.len()];
            let developer = developer(Tone::None);
            developer.encode(&display, developer.factor(level.value()), &mut codes);
            for (light, code) in light.iter().zip(codes) {
                let expected = curve::gamma_compress(factor * f64::from(*light));
                let edge = (expected * 255.0 + 0.5).fract();
                if edge > 1e-3 && edge < 1.0 - 1e-3 {
                    assert_eq!(code, curve::to_code(expected), "{level:?} at {light}");
                }
            }
        }
    }

    #[test]
    fn black_and_white_have_the_expected_codes() {
        let ends = Severity::LADDER.map(|level| {
            let mut codes = [7; 2];
            let display = [GAMMA.at(DARKEST), GAMMA.at(1.0)];
            let developer = developer(Tone::None);
            developer.encode(&display, developer.factor(level.value()), &mut codes);
            codes
        });
        assert_eq!(ends, [[0, 136], [0, 72], [0, 39], [0, 24], [0, 15]]);
        let mut codes = [0; 2];
        let developer = developer(Tone::None);
        developer.encode(&[0.9, 1.0], developer.factor(-3.0), &mut codes);
        assert_eq!(codes, [255, 255]);
    }

    #[test]
    fn gains_are_applied_to_their_planes_and_clipped() {
        let mut raw = Bayer::covering(2, 4);
        for row in 0..2 {
            let mut line = raw.line_mut(row);
            for plane in line.planes() {
                plane[0][..2].copy_from_slice(&[0.1, if row == 0 { -0.1 } else { 0.9 }]);
            }
            developer(Tone::None).balance(row, &mut line);
            line.repeat_edges();
        }
        let expected = [[0.1 * 2.15 * 1.25, 0.1 * 1.25, 0.0, 0.0], [0.1 * 1.25, 0.1 * 1.7 * 1.25, 1.0, 1.0]];
        for (row, expected) in expected.iter().enumerate() {
            for (column, expected) in expected.iter().enumerate() {
                let found = raw.sample(row, column);
                assert!((found - expected).abs() < 1e-6, "{row}, {column}: {found}");
            }
        }
    }
}
