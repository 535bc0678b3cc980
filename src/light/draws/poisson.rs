//! Poisson-distributed numbers, each from two words of 32 random bits: [`lanes`].
//!
//! A mean below 48 is split into a multiple of ½ and a rest, because the sum of Poisson numbers of both parts is a
//! Poisson number of the mean. The number of the multiple is looked up in Walker's alias table; the number of the rest
//! is found by inversion. From 48 on, the quantile function is approximated by an expansion about the normal quantile.
//! Below 48 the distribution is exact to 2⁻³². At 48 the total variation error is 5·10⁻⁶, and smaller for larger means
//! (a χ² test would detect it after 10⁹ draws).

use std::sync::LazyLock;

use super::lanes::{LANES, Lanes};
use super::quantile::NORMAL;

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
