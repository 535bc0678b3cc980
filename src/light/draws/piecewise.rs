//! Piecewise linear table of a function of positive numbers: [`Piecewise`].

use super::lanes::{LANES, Lanes};

/// Pieces per octave, a power of two; chosen.
const PIECES: usize = 128;
/// Low bits of a single-precision number that give its position within a piece.
const WITHIN: u32 = 23 - PIECES.ilog2();
/// Octaves that a table covers.
const OCTAVES: usize = 32;

/// Piecewise linear table of a function: 32 octaves of the argument, 128 pieces per octave.
///
/// The pieces of an octave have equal width, so that pieces are narrower for smaller arguments, and logarithms and
/// powers have the same relative accuracy everywhere. The error of a piece is at most f″(x) x² / 8 · 2⁻¹⁴: 8·10⁻⁶ for a
/// logarithm.
#[derive(Debug, Clone)]
pub(crate) struct Piecewise {
    /// Upper bits of the lower end of the domain, where the first piece begins.
    first: u32,
    /// Value at the beginning of each piece, and its increase per unit in the last place of the argument.
    pieces: Box<[[f32; 2]; OCTAVES * PIECES]>,
}

impl Piecewise {
    /// Tabulates `function` from 2^`exponent` up to 2^(`exponent` + 32).
    #[must_use]
    pub(crate) fn new(exponent: i32, function: impl Fn(f64) -> f64) -> Self {
        let base = libm::ldexp(1.0, exponent);
        let mut pieces = vec![[0.0; 2]; OCTAVES * PIECES];
        let mut value = function(piece_start(base, 0));
        for (index, piece) in pieces.iter_mut().enumerate() {
            let next = function(piece_start(base, index + 1));
            *piece = [value as f32, ((next - value) / f64::from(1 << WITHIN)) as f32];
            value = next;
        }
        Self {
            first: ((exponent + 127) as u32) << PIECES.ilog2(),
            pieces: pieces.try_into().unwrap_or_else(|_| unreachable!("the length is OCTAVES * PIECES")),
        }
    }

    /// The values of the function for a batch of numbers, which must be in the domain.
    #[inline(always)]
    #[must_use]
    pub(crate) fn lanes(&self, x: &Lanes<f32>) -> Lanes<f32> {
        // The table is read in a separate loop, so that the loop with the arithmetic is vectorized.
        let mut pieces = [[0.0; 2]; LANES];
        for (piece, x) in pieces.iter_mut().zip(x) {
            *piece = self.pieces[self.piece(x.to_bits())];
        }
        let mut numbers = [0.0; LANES];
        for i in 0..LANES {
            let [value, rise] = pieces[i];
            numbers[i] = value + rise * within(x[i].to_bits());
        }
        numbers
    }

    #[inline(always)]
    fn piece(&self, bits: u32) -> usize {
        (bits >> WITHIN).wrapping_sub(self.first) as usize % (OCTAVES * PIECES)
    }

    /// The value of the function at `x`, which must be in the domain.
    #[inline(always)]
    #[must_use]
    pub(crate) fn at(&self, x: f32) -> f32 {
        let [value, rise] = self.pieces[self.piece(x.to_bits())];
        value + rise * within(x.to_bits())
    }
}

/// Argument at the start of a piece, in a table from `base` on.
fn piece_start(base: f64, piece: usize) -> f64 {
    let octave = (1_u64 << (piece / PIECES)) as f64;
    base * octave * (1.0 + (piece % PIECES) as f64 / PIECES as f64)
}

/// Position of a number within its piece, from its bits.
#[inline(always)]
fn within(bits: u32) -> f32 {
    (bits & ((1 << WITHIN) - 1)).cast_signed() as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_logarithm_is_accurate_over_all_octaves() {
        let table = Piecewise::new(-20, f64::ln);
        for step in 0..100_000 {
            let x = f32::exp2(-20.0 + 31.999 * step as f32 / 100_000.0);
            let off = f64::from(table.at(x)) - f64::from(x).ln();
            assert!(off.abs() < 8e-6 + 2e-6, "{x}: {off}");
        }
    }

    #[test]
    fn pieces_equal_the_function_at_their_start() {
        let table = Piecewise::new(0, |x| x * x);
        for x in [1.0, 1.0078125, 1.5, 2.0, 1024.0, 4_278_190_080.0] {
            assert!((table.at(x) / (x * x) - 1.0).abs() < 1e-7);
        }
    }
}
