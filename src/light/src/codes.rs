//! Between 8-bit codes and the light that a display shows for them: [`shown_light`] and [`encode`].

use std::sync::LazyLock;

use super::curve;
use darkqa_ground::types::isa::{Isa, Kernel};

/// Light of each 8-bit code, as a display shows it (DarkQA, eq. 1).
static SHOWN: LazyLock<[f32; 256]> =
    LazyLock::new(|| std::array::from_fn(|code| curve::gamma_expand(code as f64 / 255.0) as f32));

/// The light that a display shows for each 8-bit code.
#[must_use]
pub(crate) fn shown_light() -> &'static [f32; 256] {
    &SHOWN
}

/// Writes the nearest code of each light, ⌊255 · L^(1/2.2) + ½⌋ (DarkQA, eq. 3). Light above 1 counts as 1.
pub(crate) fn encode(light: &[f32], codes: &mut [u8], isa: Isa) {
    isa.run(Encode { light, codes });
}

/// Pieces per octave of light, a power of two, large enough that no piece has more than one edge between two codes.
const PIECES: usize = 128;
/// Low bits of a single-precision number that give its position within a piece.
const WITHIN: u32 = 23 - PIECES.ilog2();
/// Octaves from 2⁻²⁰ to 1, which has its own. The edge between the codes 0 and 1 is the light 1.16 · 2⁻²⁰.
const OCTAVES: usize = 21;

/// The first light of the table, 2⁻²⁰; darker light has the same code, 0.
const DARKEST: f32 = 1.0 / 1_048_576.0;

/// The codes of light by pieces of equal width in each octave.
static TABLE: LazyLock<Box<[Piece]>> = LazyLock::new(|| {
    (0..(OCTAVES as u32) << PIECES.ilog2())
        .map(|piece| {
            let begin = f32::from_bits(DARKEST.to_bits() + (piece << WITHIN));
            let code = (255.0 * libm::pow(f64::from(begin), 1.0 / curve::GAMMA) + 0.5).floor();
            Piece {
                next: at_least(libm::pow((code + 0.5) / 255.0, curve::GAMMA)),
                code: code as u32,
            }
        })
        .collect()
});

/// The smallest single-precision number that is not below `x`.
fn at_least(x: f64) -> f32 {
    let near = x as f32;
    if f64::from(near) < x {
        near.next_up()
    } else {
        near
    }
}

/// Light in a piece of the table.
#[derive(Debug, Clone, Copy)]
struct Piece {
    /// The least light of the next code.
    next: f32,
    /// Code where the piece begins.
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
            let piece = (light.to_bits() - DARKEST.to_bits()) >> WITHIN;
            let piece = table[piece as usize % table.len()];
            *code = (piece.code + u32::from(light >= piece.next)) as u8;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn encoded(light: &[f32]) -> Vec<u8> {
        let mut codes = vec![7; light.len()];
        encode(light, &mut codes, Isa::best());
        codes
    }

    #[test]
    fn codes_are_those_of_their_light() {
        let all: Vec<u8> = (0..=255).collect();
        assert_eq!(encoded(shown_light()), all);
    }

    /// Light at every edge between two codes, on both sides, and between.
    #[test]
    fn light_has_the_nearest_code() {
        let edge = |code: usize| at_least(libm::pow((code as f64 + 0.5) / 255.0, 2.2));
        for code in 0..255 {
            let light = [edge(code).next_down(), edge(code)];
            assert_eq!(encoded(&light), [code as u8, code as u8 + 1]);
        }
        let light: Vec<f32> = (0..=1_000_000_u32)
            .map(|i| (i as f32 / 1e6).powi(3))
            .collect();
        for (light, code) in light.iter().zip(encoded(&light)) {
            let expected = 255.0 * libm::pow(f64::from(*light), 1.0 / 2.2) + 0.5;
            let is_edge = (expected - expected.round()).abs() < 1e-9;
            assert!(is_edge || code == expected.floor() as u8, "{light}");
        }
        assert_eq!(encoded(&[0.0, 1e-30, 1.0, 16.0, -1.0]), [0, 0, 255, 255, 0]);
    }

    #[test]
    fn no_piece_has_more_than_one_edge() {
        for (index, pair) in TABLE.windows(2).enumerate() {
            assert!(pair[1].code <= pair[0].code + 1, "{index}");
        }
    }
}
