//! Conversion between 8-bit codes and linear display light: [`display_light`] and [`encode`].

use std::sync::LazyLock;

use super::curve;
use darkqa_base::types::images::{Isa, Kernel};

/// Linear light of each 8-bit code on a display (DarkQA, eq. 1).
static DISPLAY_LIGHT: LazyLock<[f32; 256]> =
    LazyLock::new(|| std::array::from_fn(|code| curve::gamma_expand(code as f64 / 255.0) as f32));

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
static TABLE: LazyLock<Box<[Piece]>> = LazyLock::new(|| {
    (0..(OCTAVES * PIECES_PER_OCTAVE) as u32)
        .map(|index| {
            let start = f32::from_bits(DARKEST.to_bits() + (index << OFFSET_BITS));
            let code = (255.0 * libm::pow(f64::from(start), 1.0 / curve::GAMMA) + 0.5).floor();
            Piece { next: round_up(libm::pow((code + 0.5) / 255.0, curve::GAMMA)), code: code as u32 }
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
struct Piece {
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
}
