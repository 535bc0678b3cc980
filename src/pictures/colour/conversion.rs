//! Conversion of codes and light from other RGB colour spaces to sRGB: [`Conversion`].
//!
//! Tone curves from channel values to linear light: [`ToneCurve`].
//!
//! Primaries and white points of RGB colour spaces ([`Primaries`]), and 3 × 3 matrices ([`Matrix`]).
//!
//! Tone curve of sRGB (IEC 61966-2-1): values to linear light ([`light`]), and light to codes ([`SrgbCodes`]).

use std::sync::LazyLock;

use moxcms::ToneReprCurve;

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

/// Luminance of diffuse white in HDR, which becomes the white of sRGB, in cd/m² (BT.2408-7, section 2.2).
pub(super) const WHITE_NITS: f64 = 203.0;

/// A tone curve from values in [0, 1] to linear light, in [0, 1] except for PQ.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum ToneCurve {
    /// The curve of sRGB.
    Srgb,
    /// The curve of PQ (BT.2100-2, table 4), in units of [`WHITE_NITS`].
    Pq,
    /// The curve of HLG (BT.2100-2, table 5), to the light of the scene; 1 is the peak.
    Hlg,
    /// A power function with this exponent.
    Gamma(f64),
    /// At least two equally spaced values of light, interpolated linearly.
    Table(Vec<f64>),
    /// The segmented curve of ICC.1:2022, section 10.18, with its parameters g, a, b, c, d, e and f.
    Segments([f64; 7]),
}

impl ToneCurve {
    /// Converts a curve of an ICC profile.
    ///
    /// # Errors
    /// If a number is not finite, or the number of parameters is unknown.
    pub(super) fn from_profile(curve: &ToneReprCurve) -> Result<Self, String> {
        let numbers = match curve {
            ToneReprCurve::Lut(table) => match table[..] {
                [] => return Ok(Self::Gamma(1.0)),
                // An unsigned fixed-point number with 8 integer and 8 fractional bits.
                [gamma] => return Ok(Self::Gamma(f64::from(gamma) / 256.0)),
                _ => {
                    return Ok(Self::Table(table.iter().map(|value| f64::from(*value) / 65_535.0).collect()));
                }
            },
            ToneReprCurve::Parametric(numbers) => numbers,
        };
        if numbers.iter().any(|number| !number.is_finite()) {
            return Err("a curve of the ICC profile has a number that is not finite".to_owned());
        }
        let numbers: Vec<f64> = numbers.iter().map(|number| f64::from(*number)).collect();
        Ok(Self::Segments(match numbers[..] {
            [g] => [g, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0],
            [g, a, b] => [g, a, b, 0.0, -b / a, 0.0, 0.0],
            [g, a, b, c] => [g, a, b, 0.0, -b / a, c, c],
            [g, a, b, c, d] => [g, a, b, c, d, 0.0, 0.0],
            [g, a, b, c, d, e, f] => [g, a, b, c, d, e, f],
            _ => return Err("a curve of the ICC profile has an unknown form".to_owned()),
        }))
    }

    /// Linear light of a value in [0, 1], clamped to [0, 1] except for PQ.
    pub(super) fn light(&self, value: f64) -> f64 {
        let light = match self {
            Self::Srgb => light(value),
            Self::Pq => return pq(value) / WHITE_NITS,
            Self::Hlg => hlg(value),
            Self::Gamma(gamma) => libm::pow(value, *gamma),
            Self::Table(values) => interpolate(values, value),
            Self::Segments([g, a, b, c, d, e, f]) => {
                if value >= *d {
                    libm::pow((a * value + b).max(0.0), *g) + e
                } else {
                    c * value + f
                }
            }
        };
        // NaN becomes 0, too.
        if light > 0.0 { light.min(1.0) } else { 0.0 }
    }
}

impl ToneCurve {
    /// True for a curve that profiles of BT.709 have: the inverse of the camera's curve, or the gamma of 1.961 that
    /// approximates it. Its codes differ from that curve by at most one 8-bit sRGB code (chosen).
    pub(super) fn is_video(&self) -> bool {
        let is_near = |other: fn(f64) -> f64| {
            (0..=64).map(|i| f64::from(i) / 64.0).all(|value| {
                let [found, expected] =
                    [self.light(value), other(value)].map(|light| f64::from(SIXTEEN.encode(light)) / 257.0);
                (found - expected).abs() <= 1.0
            })
        };
        is_near(bt709) || is_near(|value| libm::pow(value, 1.961))
    }
}

/// Luminance of a value of PQ, in cd/m² (BT.2100-2, table 4).
fn pq(value: f64) -> f64 {
    const M1: f64 = 2610.0 / 16_384.0;
    const M2: f64 = 2523.0 / 32.0;
    const C1: f64 = 3424.0 / 4096.0;
    const C2: f64 = 2413.0 / 128.0;
    const C3: f64 = 2392.0 / 128.0;
    let power = libm::pow(value, 1.0 / M2);
    10_000.0 * libm::pow((power - C1).max(0.0) / (C2 - C3 * power), 1.0 / M1)
}

/// Light of the scene of a value of HLG (BT.2100-2, table 5).
fn hlg(value: f64) -> f64 {
    const A: f64 = 0.178_832_77;
    const B: f64 = 0.284_668_92;
    const C: f64 = 0.559_910_73;
    if value <= 0.5 { value * value / 3.0 } else { (libm::exp((value - C) / A) + B) / 12.0 }
}

/// Linear light of a value by the inverse of the curve of BT.709-6, item 1.2.
fn bt709(value: f64) -> f64 {
    const ALPHA: f64 = 1.099_296_826_809_44;
    const BETA: f64 = 0.018_053_968_510_807;
    if value < 4.5 * BETA { value / 4.5 } else { libm::pow((value + ALPHA - 1.0) / ALPHA, 1.0 / 0.45) }
}

/// Interpolates linearly between at least two equally spaced values, at a position in [0, 1].
pub(super) fn interpolate(values: &[f64], at: f64) -> f64 {
    let position = at * (values.len() - 1) as f64;
    let low = (position as usize).min(values.len() - 2);
    let fraction = position - low as f64;
    values[low] + fraction * (values[low + 1] - values[low])
}

/// A 3 × 3 matrix, row by row.
pub(crate) type Matrix = [[f64; 3]; 3];

/// The identity matrix.
pub(super) const IDENTITY: Matrix = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// XYZ of D50, the white of ICC profiles (ICC.1:2022, section 7.2.16).
pub(super) const D50: [f64; 3] = [0.9642, 1.0, 0.8249];

/// Matrix of the Bradford chromatic adaptation, from XYZ to cone responses (Lam 1985).
const BRADFORD: Matrix = [[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]];

/// CIE 1931 x and y of the primaries and of white.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Primaries {
    pub red: [f64; 2],
    pub green: [f64; 2],
    pub blue: [f64; 2],
    pub white: [f64; 2],
}

impl Primaries {
    /// The points of red, green, blue and white.
    pub(crate) fn points(&self) -> [[f64; 2]; 4] {
        [self.red, self.green, self.blue, self.white]
    }

    /// Primaries of sRGB and BT.709 (IEC 61966-2-1).
    pub(crate) const SRGB: Self =
        Self { red: [0.64, 0.33], green: [0.30, 0.60], blue: [0.15, 0.06], white: [0.3127, 0.3290] };

    /// Primaries of Display P3 (SMPTE EG 432-1).
    pub(super) const DISPLAY_P3: Self =
        Self { red: [0.680, 0.320], green: [0.265, 0.690], blue: [0.150, 0.060], white: [0.3127, 0.3290] };

    /// Primaries of BT.2020, table 3.
    pub(super) const BT2020: Self =
        Self { red: [0.708, 0.292], green: [0.170, 0.797], blue: [0.131, 0.046], white: [0.3127, 0.3290] };

    /// Primaries of digital cinema (SMPTE RP 431-2).
    pub(super) const DCI_P3: Self = Self { white: [0.314, 0.351], ..Self::DISPLAY_P3 };

    /// Primaries of NTSC of 1953 (BT.470, system M), with illuminant C.
    pub(super) const BT470_M: Self =
        Self { red: [0.67, 0.33], green: [0.21, 0.71], blue: [0.14, 0.08], white: [0.310, 0.316] };

    /// Primaries of PAL and SECAM (BT.470, systems B and G; BT.601 of 625 lines).
    pub(super) const BT470_BG: Self = Self { green: [0.29, 0.60], ..Self::SRGB };

    /// Primaries of NTSC (SMPTE 170M and 240M; BT.601 of 525 lines).
    pub(super) const SMPTE_170M: Self =
        Self { red: [0.630, 0.340], green: [0.310, 0.595], blue: [0.155, 0.070], white: [0.3127, 0.3290] };

    /// Primaries of film with illuminant C (H.273, table 2, number 8).
    pub(super) const FILM: Self =
        Self { red: [0.681, 0.319], green: [0.243, 0.692], blue: [0.145, 0.049], white: [0.310, 0.316] };

    /// Primaries of EBU Tech. 3213 (H.273, table 2, number 22).
    pub(super) const EBU_3213: Self =
        Self { red: [0.630, 0.340], green: [0.295, 0.605], blue: [0.155, 0.077], white: [0.3127, 0.3290] };

    /// Shares of red, green and blue in the luminance of white.
    pub(super) fn luminance(self) -> [f64; 3] {
        // Each column has luminance 1.
        let columns = transpose([self.red, self.green, self.blue].map(xyz_from_xy));
        times(inverse(columns), xyz_from_xy(self.white))
    }

    /// The matrix from linear light with these primaries to XYZ, with white adapted to D50.
    fn to_xyz(self) -> Matrix {
        let columns = transpose([self.red, self.green, self.blue].map(xyz_from_xy));
        let white = xyz_from_xy(self.white);
        let amounts = self.luminance();
        let scaled = columns.map(|row| [0, 1, 2].map(|i| row[i] * amounts[i]));
        let (from, to) = (times(BRADFORD, white), times(BRADFORD, D50));
        let scale = [0, 1, 2].map(|i| BRADFORD[i].map(|value| value * to[i] / from[i]));
        product(product(inverse(BRADFORD), scale), scaled)
    }

    /// The matrix from linear light with these primaries to linear light with the primaries of sRGB. White stays white.
    pub(crate) fn to_srgb(self) -> Matrix {
        if self == Self::SRGB {
            return IDENTITY;
        }
        xyz_to_srgb(self.to_xyz())
    }
}

/// The matrix from a linear RGB space to linear sRGB. `to_xyz` is the matrix from that space to XYZ with white at D50.
pub(super) fn xyz_to_srgb(to_xyz: Matrix) -> Matrix {
    product(inverse(Primaries::SRGB.to_xyz()), to_xyz)
}

/// XYZ of a point with luminance 1.
fn xyz_from_xy([x, y]: [f64; 2]) -> [f64; 3] {
    [x / y, 1.0, (1.0 - x - y) / y]
}

fn transpose(m: Matrix) -> Matrix {
    [0, 1, 2].map(|i| [0, 1, 2].map(|j| m[j][i]))
}

/// The product of a matrix and a column vector.
pub(crate) fn times(m: Matrix, v: [f64; 3]) -> [f64; 3] {
    m.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

fn product(a: Matrix, b: Matrix) -> Matrix {
    transpose(transpose(b).map(|column| times(a, column)))
}

/// The inverse by Cramer's rule; not finite for a singular matrix.
fn inverse(m: Matrix) -> Matrix {
    let determinant: f64 = (0..3).map(|i| m[0][i] * cofactor(m, 0, i)).sum();
    [0, 1, 2].map(|i| [0, 1, 2].map(|j| cofactor(m, j, i) / determinant))
}

/// The cofactor of an element: the signed determinant of the matrix without its row and column.
fn cofactor(m: Matrix, row: usize, column: usize) -> f64 {
    // In this cyclic order, the determinant has the right sign.
    const OTHERS: [[usize; 2]; 3] = [[1, 2], [2, 0], [0, 1]];
    let (r, c) = (OTHERS[row], OTHERS[column]);
    m[r[0]][c[0]] * m[r[1]][c[1]] - m[r[0]][c[1]] * m[r[1]][c[0]]
}

/// Linear light of an sRGB value in [0, 1].
pub(super) fn light(value: f64) -> f64 {
    if value <= 0.04045 { value / 12.92 } else { libm::pow((value + 0.055) / 1.055, 2.4) }
}

/// Lookup table from linear light to the nearest sRGB code.
pub(super) struct SrgbCodes {
    /// Lower limit in light of each code from 1: halfway, in codes, to the code below.
    lower_limits: Vec<f64>,
    /// Code of the lower end of each of [`Self::BINS`] equal bins of [0, 1], and of 1.
    first_codes: Vec<u32>,
}

/// Lookup table for 8-bit codes.
pub(super) static EIGHT: LazyLock<SrgbCodes> = LazyLock::new(|| SrgbCodes::up_to(255));

/// Lookup table for 16-bit codes.
static SIXTEEN: LazyLock<SrgbCodes> = LazyLock::new(|| SrgbCodes::up_to(65_535));

impl SrgbCodes {
    /// Number of bins that narrow the search; chosen.
    const BINS: usize = 4096;

    fn up_to(max: u32) -> Self {
        let lower_limits: Vec<f64> = (1..=max).map(|code| light((f64::from(code) - 0.5) / f64::from(max))).collect();
        let first_codes = (0..=Self::BINS)
            .map(|bin| {
                let darkest = bin as f64 / Self::BINS as f64;
                lower_limits.partition_point(|limit| *limit <= darkest) as u32
            })
            .collect();
        Self { lower_limits, first_codes }
    }

    /// The code nearest to a value of light, which is clamped to [0, 1].
    pub(super) fn encode(&self, light: f64) -> u32 {
        let light = light.clamp(0.0, 1.0);
        let bin = (light * Self::BINS as f64) as usize;
        let first = self.first_codes[bin];
        let last = self.first_codes[(bin + 1).min(Self::BINS)];
        let limits = &self.lower_limits[first as usize..last as usize];
        first + limits.partition_point(|limit| *limit <= light) as u32
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

    fn segments(numbers: &[f32]) -> ToneReprCurve {
        ToneReprCurve::Parametric(numbers.to_vec())
    }

    fn table(numbers: &[u16]) -> ToneReprCurve {
        ToneReprCurve::Lut(numbers.to_vec())
    }

    #[test]
    fn curves_of_profiles_follow_the_specification() {
        let srgb = [2.4, 1.0 / 1.055, 0.055 / 1.055, 1.0 / 12.92, 0.04045];
        for (curve, at, expected) in [
            (table(&[]), 0.3, 0.3),
            (table(&[512]), 0.5, 0.25),
            (table(&[0, 65_535]), 0.3, 0.3),
            (table(&[0, 0, 65_535]), 0.75, 0.5),
            (table(&[0, 0, 65_535]), 1.0, 1.0),
            (segments(&[2.0]), 0.5, 0.25),
            (segments(&[2.0, 2.0, -0.5]), 0.5, 0.25),
            (segments(&[2.0, 2.0, -0.5]), 0.2, 0.0),
            (segments(&[2.0, 2.0, -0.5, 0.125]), 0.2, 0.125),
            (segments(&[2.0, 2.0, -0.5, 0.125]), 0.5, 0.375),
            (segments(&srgb), 0.03, 0.03 / 12.92),
            (segments(&srgb), 0.5, super::light(0.5)),
            (segments(&[2.0, 1.0, 0.0, 0.5, 0.4, 0.01, 0.02]), 0.2, 0.12),
            (segments(&[2.0, 1.0, 0.0, 0.5, 0.4, 0.01, 0.02]), 0.5, 0.26),
        ] {
            let found = ToneCurve::from_profile(&curve).unwrap().light(at);
            assert!((found - expected).abs() < 1e-7, "{curve:?} at {at}: {found}");
        }
        for (curve, at) in [(segments(&[-1.0]), 0.0), (segments(&[2.0, 9.0, 0.0]), 1.0)] {
            let clipped = ToneCurve::from_profile(&curve).unwrap().light(at);
            assert!((clipped - 1.0).abs() < f64::EPSILON);
        }
        assert!(ToneCurve::from_profile(&segments(&[f32::NAN])).is_err());
        assert!(ToneCurve::from_profile(&segments(&[1.0, 1.0])).is_err());
    }

    #[test]
    fn the_bt709_curve_is_continuous() {
        let join = 4.5 * 0.018_053_968_510_807;
        let step = bt709(join + 1e-9) - bt709(join - 1e-9);
        assert!(step.abs() < 1e-8, "{step}");
        // With the rounded constants 1.099 and 0.018 it is 0.25959.
        assert!((bt709(0.5) - 0.25959).abs() < 2e-4, "{}", bt709(0.5));
    }

    #[test]
    fn curves_of_video_are_recognized() {
        let camera = [1.0 / 0.45, 1.0 / 1.099, 0.099 / 1.099, 1.0 / 4.5, 0.081];
        for (curve, expected) in [
            (segments(&camera), true),
            (table(&[502]), true),
            (segments(&[1.961]), true),
            (table(&[461]), false),
            (table(&[563]), false),
            (table(&[512]), false),
            (segments(&[2.4, 1.0 / 1.055, 0.055 / 1.055, 1.0 / 12.92, 0.04045]), false),
        ] {
            let found = ToneCurve::from_profile(&curve).unwrap();
            assert_eq!(found.is_video(), expected, "{curve:?}");
        }
    }

    /// PQ: SMPTE ST 2084, 0.508078 for 100 cd/m². HLG: half the signal is a twelfth of the peak.
    #[test]
    fn hdr_curves_have_the_values_of_their_standards() {
        for (value, nits) in [(0.0, 0.0), (0.508_078, 100.0), (0.751_827, 1000.0), (1.0, 10_000.0)] {
            assert!((pq(value) - nits).abs() <= nits * 1e-4, "{value}: {}", pq(value));
        }
        for (value, light) in [(0.0, 0.0), (0.5, 1.0 / 12.0), (0.500_001, 1.0 / 12.0), (1.0, 1.0)] {
            assert!((hlg(value) - light).abs() < 1e-5, "{value}: {}", hlg(value));
        }
    }

    fn assert_close(found: Matrix, expected: Matrix, tolerance: f64) {
        for (found, expected) in found.as_flattened().iter().zip(expected.as_flattened()) {
            assert!((found - expected).abs() < tolerance, "{found} {expected}");
        }
    }

    /// The values that profiles of sRGB state (sRGB2014.icc of the ICC).
    #[test]
    fn srgb_has_the_colorants_of_its_profiles() {
        let expected = [[0.43607, 0.38515, 0.14307], [0.22249, 0.71687, 0.06061], [0.01392, 0.09708, 0.71410]];
        assert_close(Primaries::SRGB.to_xyz(), expected, 3e-4);
        assert_close(xyz_to_srgb(Primaries::SRGB.to_xyz()), IDENTITY, 1e-12);
    }

    /// The matrix of CSS Color 4, section 18, from linear Display P3 to linear sRGB.
    #[test]
    fn display_p3_has_the_matrix_of_css() {
        let expected = [
            [1.224_940_2, -0.224_940_4, 0.0],
            [-0.042_056_9, 1.042_057_1, 0.0],
            [-0.019_637_6, -0.078_636_1, 1.098_273_6],
        ];
        assert_close(Primaries::DISPLAY_P3.to_srgb(), expected, 1e-5);
    }

    /// BT.2087-0, table 2 (inverse), and BT.2020-2, table 4.
    #[test]
    fn bt2020_has_the_matrix_and_luminance_of_its_standards() {
        let expected = [[1.660_5, -0.587_6, -0.072_8], [-0.124_6, 1.132_9, -0.008_3], [-0.018_2, -0.100_6, 1.118_7]];
        assert_close(Primaries::BT2020.to_srgb(), expected, 1e-4);
        let shares = Primaries::BT2020.luminance();
        for (share, expected) in shares.iter().zip([0.2627, 0.6780, 0.0593]) {
            assert!((share - expected).abs() < 1e-4, "{shares:?}");
        }
    }

    #[test]
    fn an_inverse_undoes_a_matrix() {
        assert_close(product(BRADFORD, inverse(BRADFORD)), IDENTITY, 1e-14);
    }

    #[test]
    fn light_is_encoded_to_the_nearest_code() {
        for (codes, max) in [(&*EIGHT, 255), (&*SIXTEEN, 65_535)] {
            for code in 0..=max {
                for offset in [-0.499, 0.0, 0.499] {
                    let near = (f64::from(code) + offset).clamp(0.0, f64::from(max));
                    assert_eq!(codes.encode(light(near / f64::from(max))), code);
                }
            }
            assert_eq!([codes.encode(-1.0), codes.encode(2.0)], [0, max]);
        }
    }
}
