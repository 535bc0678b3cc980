//! A clean frame in one of four pixel formats: [`Clean`].
//!
//! Conversion between 8-bit codes and linear display light: [`display_light`] and [`encode`].
//!
//! Curves between sRGB codes and linear light, and their inverses.
//!
//! Every transcendental function comes from `libm`, so that the results are the same bits on every machine.

use std::sync::LazyLock;

use darkqa_base::types::images::{Isa, Kernel};
use darkqa_base::types::{Light, Pixels, Rgb, Rgb16Image};

/// A clean frame, from which degraded images are made.
#[derive(Debug, Clone, Copy)]
pub enum Clean<'a> {
    /// 8-bit sRGB codes.
    Codes(&'a Rgb),
    /// 16-bit sRGB codes.
    Rgb16Image(&'a Rgb16Image),
    /// Linear light of a display, not rounded to codes; a code is 255 · L^(1/2.2). Light above 1 counts as 1.
    Light(&'a Light),
    /// Linear light in front of the camera, before any tone curve. White is 1; light may be brighter.
    Scene(&'a Light),
}

impl Clean<'_> {
    /// The height in pixels.
    #[must_use]
    pub fn height(self) -> usize {
        match self {
            Self::Codes(codes) => codes.height(),
            Self::Rgb16Image(codes) => codes.height(),
            Self::Light(light) | Self::Scene(light) => light.height(),
        }
    }

    /// The width in pixels.
    #[must_use]
    pub fn width(self) -> usize {
        match self {
            Self::Codes(codes) => codes.width(),
            Self::Rgb16Image(codes) => codes.width(),
            Self::Light(light) | Self::Scene(light) => light.width(),
        }
    }
}

impl Clean<'_> {
    /// Replaces the pixels by light of the same kind: scene light if this is scene light, else display light.
    #[must_use]
    pub fn with_light(self, light: &Light) -> Clean<'_> {
        match self {
            Self::Scene(_) => Clean::Scene(light),
            Self::Codes(_) | Self::Rgb16Image(_) | Self::Light(_) => Clean::Light(light),
        }
    }
}

impl<'a> From<&'a Rgb> for Clean<'a> {
    fn from(codes: &'a Rgb) -> Self {
        Self::Codes(codes)
    }
}

impl<'a> From<&'a Pixels> for Clean<'a> {
    fn from(pixels: &'a Pixels) -> Self {
        match pixels {
            Pixels::Codes8(codes) => Self::Codes(codes),
            Pixels::Rgb16Image(codes) => Self::Rgb16Image(codes),
            Pixels::Light(light) => Self::Scene(light),
        }
    }
}

impl<'a> From<&'a Light> for Clean<'a> {
    fn from(light: &'a Light) -> Self {
        Self::Light(light)
    }
}

/// Linear light of each 8-bit code on a display (DarkQA, eq. 1).
static DISPLAY_LIGHT: LazyLock<[f32; 256]> =
    LazyLock::new(|| std::array::from_fn(|code| gamma_expand(code as f64 / 255.0) as f32));

/// Returns the linear light of each 8-bit code on a display.
#[must_use]
pub(crate) fn display_light() -> &'static [f32; 256] {
    &DISPLAY_LIGHT
}

/// Writes the nearest code of each light, ⌊255 · L^(1/2.2) + ½⌋ (DarkQA, eq. 3). Light above 1 counts as 1.
pub(crate) fn encode(light: &[f32], codes: &mut [u8], isa: Isa) {
    isa.run(Encode { light, codes });
}

/// Pieces per octave of light: a power of two, large enough for at most one edge between two codes in each piece.
const PIECES_PER_OCTAVE: usize = 128;

/// Number of low bits of a single-precision number that give its position within a piece.
const OFFSET_BITS: u32 = 23 - PIECES_PER_OCTAVE.ilog2();

/// Octaves of the table: 20 from 2⁻²⁰ to 1, and one that begins at 1. The edge between codes 0 and 1 is at light 1.16 ·
/// 2⁻²⁰.
const OCTAVES: usize = 21;

/// Smallest light in the table, 2⁻²⁰. Darker light has the same code, 0.
const DARKEST: f32 = 1.0 / 1_048_576.0;

/// Codes by light, for pieces of equal width within each octave.
static TABLE: LazyLock<Box<[TablePiece]>> = LazyLock::new(|| {
    (0..(OCTAVES * PIECES_PER_OCTAVE) as u32)
        .map(|index| {
            let start = f32::from_bits(DARKEST.to_bits() + (index << OFFSET_BITS));
            let code = (255.0 * libm::pow(f64::from(start), 1.0 / GAMMA) + 0.5).floor();
            TablePiece { next: round_up(libm::pow((code + 0.5) / 255.0, GAMMA)), code: code as u32 }
        })
        .collect()
});

/// Rounds `x` up to single precision.
fn round_up(x: f64) -> f32 {
    let nearest = x as f32;
    if f64::from(nearest) < x { nearest.next_up() } else { nearest }
}

/// Codes of the light in one piece of the table.
#[derive(Debug, Clone, Copy)]
struct TablePiece {
    /// Smallest light with the next code.
    next: f32,
    /// Code at the start of the piece.
    code: u32,
}

struct Encode<'a> {
    light: &'a [f32],
    codes: &'a mut [u8],
}

impl Kernel for Encode<'_> {
    #[inline(always)]
    fn run(self) {
        let table = &**TABLE;
        for (code, light) in self.codes.iter_mut().zip(self.light) {
            let light = if *light > DARKEST { *light } else { DARKEST };
            let light = if light < 1.0 { light } else { 1.0 };
            let index = (light.to_bits() - DARKEST.to_bits()) >> OFFSET_BITS;
            let piece = table[index as usize % table.len()];
            *code = (piece.code + u32::from(light >= piece.next)) as u8;
        }
    }
}

/// Exponent that approximates the sRGB curve (DarkQA, eqs. 1 and 3).
pub const GAMMA: f64 = 2.2;

/// Smallest base of the powers (DarkQA, ε of eq. 1).
const FLOOR: f64 = 1e-8;

/// Linear light of a display value in [0, 1] (DarkQA, eq. 1).
#[must_use]
pub fn gamma_expand(display: f64) -> f64 {
    libm::pow(display.max(FLOOR), GAMMA)
}

/// The display value of linear light in [0, 1] (DarkQA, eq. 3).
#[must_use]
pub fn gamma_compress(linear: f64) -> f64 {
    libm::pow(linear.max(FLOOR), 1.0 / GAMMA)
}

/// The inverse of the tone curve 3x² − 2x³, for values in [0, 1] (Brooks et al. 2019, `inverse_smoothstep`).
#[must_use]
pub fn inverse_smoothstep(display: f64) -> f64 {
    let display = display.clamp(0.0, 1.0);
    0.5 - libm::sin(libm::asin(1.0 - 2.0 * display) / 3.0)
}

/// Factor 2^−ΔEV on linear light (DarkQA, eq. 2).
#[cfg(test)]
#[must_use]
pub fn light_factor(drop_ev: f64) -> f64 {
    libm::exp2(-drop_ev)
}

/// Factor 2^(−ΔEV/2.2) on display values: the exposure drop after gamma compression (DarkQA, eqs. 2 and 3).
#[must_use]
pub fn display_factor(drop_ev: f64) -> f64 {
    libm::exp2(-drop_ev / GAMMA)
}

/// The tone curve 3x² − 2x³, for values in [0, 1].
#[inline(always)]
#[must_use]
pub fn smoothstep(display: f32) -> f32 {
    display * display * (3.0 - 2.0 * display)
}

/// The nearest 8-bit code of a display value, which is clamped to [0, 1]. Truncation would add a bias of half a code, 7
/// % of a grey at L5.
#[cfg(test)]
#[must_use]
pub fn to_code(display: f64) -> u8 {
    (255.0 * display.clamp(0.0, 1.0) + 0.5).floor() as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    fn encode_all(light: &[f32]) -> Vec<u8> {
        let mut codes = vec![7; light.len()];
        encode(light, &mut codes, Isa::best());
        codes
    }

    #[test]
    fn encode_inverts_display_light() {
        let all: Vec<u8> = (0..=255).collect();
        assert_eq!(encode_all(display_light()), all);
    }

    /// Checks both sides of every edge between two codes, and a million values in [0, 1].
    #[test]
    fn light_has_the_nearest_code() {
        for code in 0..255 {
            let edge = round_up(libm::pow((code as f64 + 0.5) / 255.0, 2.2));
            let light = [edge.next_down(), edge];
            assert_eq!(encode_all(&light), [code as u8, code as u8 + 1]);
        }
        let light: Vec<f32> = (0..=1_000_000_u32).map(|i| (i as f32 / 1e6).powi(3)).collect();
        for (light, code) in light.iter().zip(encode_all(&light)) {
            let expected = 255.0 * libm::pow(f64::from(*light), 1.0 / 2.2) + 0.5;
            let is_edge = (expected - expected.round()).abs() < 1e-9;
            assert!(is_edge || code == expected.floor() as u8, "{light}");
        }
        assert_eq!(encode_all(&[0.0, 1e-30, 1.0, 16.0, -1.0]), [0, 0, 255, 255, 0]);
    }

    #[test]
    fn no_piece_has_more_than_one_edge() {
        for (index, pair) in TABLE.windows(2).enumerate() {
            assert!(pair[1].code <= pair[0].code + 1, "{index}");
        }
    }

    #[test]
    fn gamma_expansion_and_compression_are_inverse() {
        for code in 1..=255u8 {
            let x = f64::from(code) / 255.0;
            assert!((gamma_compress(gamma_expand(x)) - x).abs() < 1e-14);
            assert_eq!(to_code(x), code);
        }
        assert!((gamma_compress(gamma_expand(0.0)) * 255.0 - 0.059).abs() < 0.001);
    }

    #[test]
    fn the_tone_curve_is_inverted() {
        for step in 0..=1000 {
            let x = f64::from(step) / 1000.0;
            let t = inverse_smoothstep(x);
            assert!((t * t * (3.0 - 2.0 * t) - x).abs() < 5e-16, "{x}");
        }
    }

    /// Greys of the sensor branch before the exposure drop, without noise and forward tone curve.
    #[test]
    fn shadows_are_lifted_by_the_inverse_tone_curve() {
        for (code, lifted) in [(0.0, 0.06), (16.0, 38.91), (64.0, 83.41), (192.0, 172.35)] {
            let linear = gamma_expand(inverse_smoothstep(code / 255.0));
            assert!((gamma_compress(linear) * 255.0 - lifted).abs() < 0.006);
        }
    }
}
