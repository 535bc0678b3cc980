//! Tabulated quantile functions of distributions symmetric about zero: [`Quantile`].

use std::cell::RefCell;
use std::sync::{Arc, LazyLock};

use super::lanes::{LANES, Lanes};
use super::piecewise::Piecewise;

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
