//! Poisson-distributed numbers, each from two words of 32 random bits: [`lanes`].
//!
//! A mean below 48 is split into a multiple of ½ and a rest, because the sum of Poisson numbers of both parts is a
//! Poisson number of the mean. The number of the multiple is looked up in Walker's alias table; the number of the rest
//! is found by inversion. From 48 on, the quantile function is approximated by an expansion about the normal quantile.
//! Below 48 the distribution is exact to 2⁻³². At 48 the total variation error is 5·10⁻⁶, and smaller for larger means
//! (a χ² test would detect it after 10⁹ draws).
//!
//! Piecewise linear table of a function of positive numbers: [`Piecewise`].
//!
//! Tabulated quantile functions of distributions symmetric about zero: [`Quantile`].

use std::cell::RefCell;
use std::sync::{Arc, LazyLock};

use super::random::{LANES, Lanes};

/// Smallest mean for which the expansion is used.
const EXPANDED_FROM: f32 = 48.0;

/// Alias tables: one for each multiple of ½ below 48, padded to a power of two.
const TABLES: usize = 128;

/// Slots of a table, one for each number from 0 to 127.
const SLOTS: usize = 128;
const SLOT_BITS: u32 = SLOTS.ilog2();

/// Bits of a word that give its position within a slot.
const POSITION_BITS: u32 = 32 - SLOT_BITS;

/// 1.5 · 2^23: adding it to a number within ±2^22 leaves the nearest whole number in the lower bits.
const ROUND: f32 = 12_582_912.0;

/// Replaces means (from 0 to 2·10⁶) by Poisson numbers, each drawn from two words.
#[inline(always)]
pub(crate) fn lanes(means: &mut Lanes<f32>, words: [&Lanes<u32>; 2]) {
    let (mut any_small, mut any_large) = (false, false);
    for mean in means.iter() {
        any_small |= *mean < EXPANDED_FROM;
        any_large |= *mean >= EXPANDED_FROM;
    }
    if !any_large {
        *means = split(means, words);
    } else if !any_small {
        *means = expanded(means, words[0]);
    } else {
        let (small, large) = (split(means, words), expanded(means, words[0]));
        for i in 0..LANES {
            let is_small = means[i] < EXPANDED_FROM;
            means[i] = large[i];
            if is_small {
                means[i] = small[i];
            }
        }
    }
}

/// Poisson numbers for means below [`EXPANDED_FROM`]; results for larger means are meaningless.
#[inline(always)]
fn split(means: &Lanes<f32>, [words, rest_words]: [&Lanes<u32>; 2]) -> Lanes<f32> {
    let tables = &ALIAS_TABLES[..TABLES * SLOTS];
    let mut rests = [0.0; LANES];
    let mut entries = [0; LANES];
    for i in 0..LANES {
        let mean = if means[i] < EXPANDED_FROM { means[i] } else { 0.0 };
        // The largest multiple of ½ up to the mean. On a tie it may be ½ less, which is correct too.
        let twice = (2.0 * mean - 0.5) + ROUND;
        rests[i] = mean - 0.5 * (twice - ROUND);
        entries[i] = ((twice.to_bits() & (TABLES as u32 - 1)) << SLOT_BITS) | (words[i] >> POSITION_BITS);
    }
    for entry in &mut entries {
        *entry = tables[*entry as usize % (TABLES * SLOTS)];
    }
    let mut numbers = [0.0; LANES];
    let mut any_beyond_3 = false;
    for i in 0..LANES {
        let position = words[i] & ((1 << POSITION_BITS) - 1);
        let slot = words[i] >> POSITION_BITS;
        let alias = entries[i] & (SLOTS as u32 - 1);
        let number = if position < entries[i] >> SLOT_BITS { slot } else { alias };
        let rest = rests[i];
        let uniform = upper_uniform(rest_words[i]);
        numbers[i] = number.cast_signed() as f32
            + step(uniform < at_least_1(rest))
            + step(uniform < at_least_2(rest))
            + step(uniform < at_least_3(rest));
        any_beyond_3 |= uniform < bound_of_4(rest);
    }
    if any_beyond_3 {
        for i in 0..LANES {
            let uniform = upper_uniform(rest_words[i]);
            if uniform < bound_of_4(rests[i]) {
                numbers[i] += beyond_3(f64::from(rests[i]), f64::from(uniform));
            }
        }
    }
    numbers
}

#[inline(always)]
fn step(condition: bool) -> f32 {
    if condition { 1.0 } else { 0.0 }
}

/// Uniform number in (0, 1), with full precision for small values.
#[inline(always)]
fn upper_uniform(word: u32) -> f32 {
    ((word >> 1).cast_signed() as f32 + 0.5) * (1.0 / 2_147_483_648.0)
}

/// P(N ≥ 1) of a mean x ≤ ½: the sum over j of (−1)^(j−k) C(j − 1, k − 1) x^j / j! with k = 1, to a relative error of
/// 10⁻⁶.
#[inline(always)]
fn at_least_1(x: f32) -> f32 {
    x * (1.0
        + x * (-1.0 / 2.0
            + x * (1.0 / 6.0 + x * (-1.0 / 24.0 + x * (1.0 / 120.0 + x * (-1.0 / 720.0 + x * (1.0 / 5040.0)))))))
}

/// P(N ≥ 2): the same sum with k = 2.
#[inline(always)]
fn at_least_2(x: f32) -> f32 {
    x * x
        * (1.0 / 2.0
            + x * (-1.0 / 3.0
                + x * (1.0 / 8.0 + x * (-1.0 / 30.0 + x * (1.0 / 144.0 + x * (-1.0 / 840.0 + x * (1.0 / 5760.0)))))))
}

/// P(N ≥ 3): the same sum with k = 3.
#[inline(always)]
fn at_least_3(x: f32) -> f32 {
    x * x
        * x
        * (1.0 / 6.0
            + x * (-1.0 / 8.0 + x * (1.0 / 20.0 + x * (-1.0 / 72.0 + x * (1.0 / 336.0 + x * (-1.0 / 1920.0))))))
}

/// Upper bound of P(N ≥ 4): x⁴ / 4!.
#[inline(always)]
fn bound_of_4(x: f32) -> f32 {
    (x * x) * (x * x) * (1.0 / 24.0)
}

/// Excess over 3: the number of k ≥ 4 with `uniform` < P(N ≥ k).
fn beyond_3(mean: f64, uniform: f64) -> f32 {
    let mut term = libm::exp(-mean) * mean * mean * mean / 6.0;
    let mut count = 0.0_f32;
    for k in 4..SLOTS {
        term *= mean / k as f64;
        // P(N ≥ k) = P(N = k) (1 + x/(k+1) + x²/(k+1)(k+2) + …).
        let (mut sum, mut next) = (0.0, term);
        for j in k + 1..k + 12 {
            sum += next;
            next *= mean / j as f64;
        }
        if uniform >= sum {
            break;
        }
        count += 1.0;
    }
    count
}

/// Poisson numbers for means from [`EXPANDED_FROM`] on: the quantile function to order 1/λ about the normal quantile w,
/// λ + √λ w + (w² + 2)/6 − (w³ + 2w)/(72 √λ) + (w⁴/270 + 7w²/810 − 8/405)/λ, rounded down (Giles, "Algorithm 955:
/// approximation of the inverse Poisson cumulative distribution function", ACM TOMS 42, 2016).
#[inline(always)]
fn expanded(means: &Lanes<f32>, words: &Lanes<u32>) -> Lanes<f32> {
    let normal = NORMAL.lanes(words);
    let mut numbers = [0.0; LANES];
    for i in 0..LANES {
        let mean = if means[i] >= EXPANDED_FROM { means[i] } else { EXPANDED_FROM };
        let (w, root) = (normal[i], mean.sqrt());
        let square = w * w;
        let correction = (square + 2.0) * (1.0 / 6.0) - w * (square + 2.0) / (72.0 * root)
            + (square * (square * (1.0 / 270.0) + 7.0 / 810.0) - 8.0 / 405.0) / mean;
        let quantile = mean + (root * w + correction);
        let below = (quantile - 0.5 + ROUND) - ROUND;
        numbers[i] = if below > 0.0 { below } else { 0.0 };
    }
    numbers
}

/// Alias tables by multiple of ½: slots of equal width for the numbers 0 to 127. The lower part of a slot yields its
/// own number, the upper part another number, the alias. An entry consists of the width of the lower part and 7 bits of
/// the alias.
static ALIAS_TABLES: LazyLock<Vec<u32>> = LazyLock::new(|| {
    let mut tables = vec![0; TABLES * SLOTS];
    for (index, table) in tables.as_chunks_mut::<SLOTS>().0.iter_mut().enumerate() {
        if index as f32 * 0.5 < EXPANDED_FROM {
            *table = alias_table(index as f64 * 0.5);
        }
    }
    tables
});

/// Walker's alias table for a mean, built by Vose's method in integers. Probabilities are multiples of 2⁻³² whose sum
/// is 1.
fn alias_table(mean: f64) -> [u32; SLOTS] {
    const WIDTH: u64 = 1 << POSITION_BITS;
    let mut probability = libm::exp(-mean);
    let mut parts: [u64; SLOTS] = std::array::from_fn(|number| {
        if number > 0 {
            probability *= mean / number as f64;
        }
        libm::round(libm::ldexp(probability, 32)) as u64
    });
    // The remainder of rounding goes to the most probable number.
    let remainder = (1_u64 << 32).wrapping_sub(parts.iter().sum());
    let mode = mean as usize;
    parts[mode] = parts[mode].wrapping_add(remainder);

    // Initially all slots are full: each yields only its own number, so its alias is itself.
    let mut table: [u32; SLOTS] = std::array::from_fn(|slot| slot as u32);
    let (mut small, mut large): (Vec<_>, Vec<_>) = (0..SLOTS).partition(|slot| parts[*slot] < WIDTH);
    while let (Some(slot), Some(donor)) = (small.pop(), large.last().copied()) {
        table[slot] = ((parts[slot] as u32) << SLOT_BITS) | donor as u32;
        parts[donor] -= WIDTH - parts[slot];
        if parts[donor] < WIDTH {
            large.pop();
            small.push(donor);
        }
    }
    table
}

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

/// Largest single-precision number below 2^31.
const MAX_POSITION: f32 = 2_147_483_520.0;

/// Tabulated quantile function with Q(1 − u) = −Q(u). The table covers the lower half, u = (m + ½) · 2⁻³² for m from 0
/// to 2^31 − 1.
#[derive(Debug, Clone)]
pub struct Quantile(Piecewise);

/// Maximum number of tables that a thread caches; each built-in calibration has at most 11 shapes.
const MAX_CACHED_TABLES: usize = 16;

thread_local! {
    /// Cached tables with the bits of their shape λ, in order of insertion. The cache is per thread, because after a
    /// fork a shared one could stay locked.
    static TUKEY_LAMBDA: RefCell<Vec<(u64, Arc<Quantile>)>> = const { RefCell::new(Vec::new()) };
}

/// Quantile function of the standard normal distribution.
pub(crate) static NORMAL: LazyLock<Quantile> = LazyLock::new(|| Quantile::new(standard_normal));

impl Quantile {
    /// Tabulates a quantile function, which is called for u in (0, ½].
    #[must_use]
    pub fn new(function: impl Fn(f64) -> f64) -> Self {
        let cell = libm::ldexp(1.0, -32);
        Self(Piecewise::new(-1, |position| function(position * cell)))
    }

    /// Quantile function of Tukey's λ distribution, with shape λ.
    #[must_use]
    pub fn tukey_lambda(shape: f64) -> Self {
        Self::new(|u| tukey_lambda(u, shape))
    }

    /// [`Self::tukey_lambda`] from the cache of this thread. Making a table takes a twentieth of the time of a small
    /// image.
    pub(crate) fn cached_tukey_lambda(shape: f64) -> Arc<Self> {
        let bits = shape.to_bits();
        TUKEY_LAMBDA.with_borrow_mut(|tables| {
            if let Some((_, table)) = tables.iter().find(|(cached, _)| *cached == bits) {
                return Arc::clone(table);
            }
            if tables.len() == MAX_CACHED_TABLES {
                tables.remove(0);
            }
            let table = Arc::new(Self::tukey_lambda(shape));
            tables.push((bits, Arc::clone(&table)));
            table
        })
    }

    /// The quantile of 32 random bits: one for the sign, 31 for u.
    #[inline(always)]
    #[must_use]
    pub fn at(&self, word: u32) -> f32 {
        signed(self.0.at(position(word)), word)
    }

    /// The quantiles of a batch of words.
    #[inline(always)]
    #[must_use]
    pub fn lanes(&self, words: &Lanes<u32>) -> Lanes<f32> {
        let mut positions = [0.0; LANES];
        for (target, word) in positions.iter_mut().zip(words) {
            *target = position(*word);
        }
        let mut numbers = self.0.lanes(&positions);
        for (number, word) in numbers.iter_mut().zip(words) {
            *number = signed(*number, *word);
        }
        numbers
    }
}

/// The position on the lower half, in units of 2⁻³², from 31 bits of a word.
#[inline(always)]
fn position(word: u32) -> f32 {
    let position = (word & 0x7FFF_FFFF).cast_signed() as f32 + 0.5;
    if position < MAX_POSITION { position } else { MAX_POSITION }
}

/// Negates a quantile of the lower half if the highest bit of a word is set.
#[inline(always)]
fn signed(lower: f32, word: u32) -> f32 {
    f32::from_bits(lower.to_bits() ^ (word & 0x8000_0000))
}

/// The quantile function of Tukey's λ distribution, (u^λ − (1 − u)^λ) / λ and ln u − ln(1 − u) at λ = 0, for u in the
/// open interval (0, 1).
///
/// The difference of two terms exp(λ ln u) − 1 is accurate for every λ near 0.
#[must_use]
pub fn tukey_lambda(u: f64, shape: f64) -> f64 {
    let (below, above) = (libm::log(u), libm::log1p(-u));
    if shape == 0.0 { below - above } else { (libm::expm1(shape * below) - libm::expm1(shape * above)) / shape }
}

/// The quantile function of the standard normal distribution on (0, ½], by Newton's method on its distribution
/// function.
fn standard_normal(u: f64) -> f64 {
    // ln Φ is concave: from the left of the root, Newton's method never overshoots and converges quadratically.
    let mut z = -(-2.0 * libm::log(u)).sqrt();
    for _ in 0..60 {
        let step = libm::log(normal_cdf(z) / u) * normal_cdf(z) / normal_density(z);
        z -= step;
        if step.abs() < 1e-13 {
            break;
        }
    }
    z
}

fn normal_density(z: f64) -> f64 {
    libm::exp(-0.5 * z * z) / (2.0 * std::f64::consts::PI).sqrt()
}

fn normal_cdf(z: f64) -> f64 {
    0.5 * libm::erfc(-z / std::f64::consts::SQRT_2)
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

    #[test]
    fn tukey_lambda_follows_the_closed_form() {
        let u = [1e-5, 1e-3, 0.01, 0.25, 0.5, 0.75, 0.99, 0.999, 1.0 - 1e-5];
        for shape in [-1.0 / 7.0, -0.042857, 0.042857, 0.114286, 1.0 / 7.0, 1.0, 2.0] {
            for u in u {
                let expected = (f64::powf(u, shape) - f64::powf(1.0 - u, shape)) / shape;
                let found = tukey_lambda(u, shape);
                assert!((found - expected).abs() < 1e-12 * expected.abs().max(1.0), "λ {shape}, u {u}");
            }
        }
        for u in u {
            let expected = (u / (1.0 - u)).ln();
            assert!((tukey_lambda(u, 0.0) - expected).abs() < 1e-12 * expected.abs().max(1.0));
            assert!((tukey_lambda(u, 1e-12) - expected).abs() < 1e-9 * expected.abs().max(1.0));
        }
    }

    #[test]
    fn normal_quantiles_equal_published_values() {
        for (u, z) in [
            (0.5, 0.0),
            (0.25, -0.674_489_750_196_082),
            (0.025, -1.959_963_984_540_054),
            (1e-3, -3.090_232_306_167_813_5),
            (1e-5, -4.264_890_793_922_825),
            (1e-9, -5.997_807_015_007_687),
        ] {
            assert!((standard_normal(u) - z).abs() < 1e-12, "{u}");
        }
    }

    /// Comparison of table and function at words over the whole range and at both of its ends.
    #[test]
    fn tables_follow_their_functions() {
        type Function = Box<dyn Fn(f64) -> f64>;
        let mut functions: Vec<Function> = vec![Box::new(standard_normal)];
        for shape in [-10.0, -6.0, 0.0, 3.0, 9.0] {
            functions.push(Box::new(move |u| tukey_lambda(u, shape / 70.0)));
        }
        for function in functions {
            let table = Quantile::new(&function);
            for octave in 0..31 {
                for step in 0..1000_u64 {
                    let place = ((1 << octave) * (1000 + step) / 1000) as u32;
                    let expected = function((f64::from(place) + 0.5) * f64::exp2(-32.0));
                    let [lower, upper] = [place, place | 1 << 31].map(|word| f64::from(table.at(word)));
                    assert!((lower - expected).abs() < 1e-5 + 3e-6 * expected.abs(), "{place}: {lower}, {expected}");
                    assert!((lower + upper).abs() < f64::EPSILON);
                }
            }
            let [first, last] = [0, 0x7FFF_FFFF].map(|word| f64::from(table.at(word)));
            assert!((first - function(f64::exp2(-33.0))).abs() < 1e-5 * first.abs());
            assert!(last.abs() < 1e-6);
        }
    }
}
