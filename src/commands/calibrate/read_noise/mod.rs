//! Fit of the shape λ and the scale σ_TL of read noise to the residuals of bias frames: [`ReadNoise`].
//!
//! The fit maximizes the likelihood of the integer codes, so that rounding does not count as noise. [`plot_fit`] is the
//! fit by the probability plot (Wei et al. 2021), which the published calibrations use.
//!
//! Log-likelihood of residuals under a Tukey-λ distribution rounded to integer codes: [`Likelihood`].
//!
//! Derivative-free minimization of a function of two variables: [`minimize`].
//!
//! Cumulative distribution function of Tukey's λ distribution, by a table: [`TukeyTable`]. Only its inverse has a
//! closed form.
//!
//! Fit of read noise by the probability plot: [`plot_fit`].

#[cfg(test)]
mod tests;

use std::cell::RefCell;

use serde::Serialize;

use super::sums::{ResidualHistogram, STEPS};

/// Read noise of a setting, with the derivatives for resampling its frames.
#[derive(Debug, Clone)]
pub(super) struct ReadNoise {
    /// Shape λ of the Tukey-λ distribution.
    pub(super) shape: f64,
    /// ln of its scale σ_TL in ADU.
    pub(super) log_scale: f64,
    /// Derivatives of the log-likelihood of each group of frames with respect to λ and ln σ_TL, at the fitted values.
    scores: Vec<[f64; 2]>,
    /// Inverse of the matrix of second derivatives of the whole log-likelihood.
    inverse: [[f64; 2]; 2],
}

impl ReadNoise {
    /// Fits the residuals of all groups of frames together.
    ///
    /// # Errors
    /// If the residuals have no spread, or the likelihood has no maximum.
    pub(super) fn fit(groups: &[ResidualHistogram]) -> Result<Self, String> {
        let mut all = ResidualHistogram::default();
        for group in groups {
            all.add(group);
        }
        let likelihood = Likelihood::new(Folded::new(&all));
        let [shape, log_scale] = likelihood.maximize()?;
        let curvature = likelihood.curvature([shape, log_scale]);
        let inverse = inverse(curvature).ok_or("the shape and the scale of the read noise cannot be separated")?;
        let scores = groups.iter().map(|group| likelihood.score(&Folded::new(group), [shape, log_scale])).collect();
        Ok(Self { shape, log_scale, scores, inverse })
    }

    /// λ and ln σ_TL with one weight for each group, by one step of Newton's method from the fit.
    pub(super) fn resampled(&self, weights: &[f64]) -> [f64; 2] {
        let [a, b] = self
            .scores
            .iter()
            .zip(weights)
            .fold([0.0; 2], |[a, b], (score, weight)| [a + weight * score[0], b + weight * score[1]]);
        let [first, second] = self.inverse;
        [self.shape - (first[0] * a + first[1] * b), self.log_scale - (second[0] * a + second[1] * b)]
    }
}

/// Inverse of a negative definite matrix; `None` if the matrix is not negative definite.
fn inverse([[a, b], [c, d]]: [[f64; 2]; 2]) -> Option<[[f64; 2]; 2]> {
    let determinant = a * d - b * c;
    (a < 0.0 && determinant > 0.0).then(|| [[d / determinant, -b / determinant], [-c / determinant, a / determinant]])
}

/// Minimum probability of a residual (chosen). It is far below the probability of any residual of the distribution, and
/// limits the effect of outliers such as cosmic rays.
const MIN_PROBABILITY: f64 = 1e-12;

/// Search range of λ. Below −½ the variance is infinite; 1 is the uniform distribution.
const SHAPES: [f64; 2] = [-0.49, 1.0];

/// Step of the numerical derivatives in λ and in ln σ_TL (chosen larger than the spacing of the table, which is
/// interpolated linearly).
const DERIVATIVE_STEP: f64 = 2e-3;

/// Absolute residuals in ADU, in ascending order, with their counts: the distribution is symmetric around 0.
#[derive(Debug, Clone)]
pub(super) struct Folded(Vec<(f64, f64)>);

impl Folded {
    fn new(residuals: &ResidualHistogram) -> Self {
        let mut folded: Vec<(i64, u64)> = Vec::new();
        let mut all: Vec<(i64, u64)> =
            residuals.counts().into_iter().map(|(steps, count)| (steps.abs(), count)).collect();
        all.sort_unstable();
        for (steps, count) in all {
            match folded.last_mut() {
                Some((last, sum)) if *last == steps => *sum += count,
                _ => folded.push((steps, count)),
            }
        }
        Self(folded.into_iter().map(|(steps, count)| (steps as f64 / STEPS as f64, count as f64)).collect())
    }
}

/// Likelihood of residuals.
pub(super) struct Likelihood {
    residuals: Folded,
    count: f64,
    table: RefCell<TukeyTable>,
}

impl Likelihood {
    fn new(residuals: Folded) -> Self {
        Self {
            count: residuals.0.iter().map(|(_, count)| count).sum(),
            residuals,
            table: RefCell::new(TukeyTable::new()),
        }
    }

    /// Finds λ and ln σ_TL of maximum likelihood.
    ///
    /// # Errors
    /// If all residuals are 0, or the search ends at a limit of the range of λ.
    fn maximize(&self) -> Result<[f64; 2], String> {
        let squares: f64 = self.residuals.0.iter().map(|(size, n)| n * size * size).sum();
        let deviation = (squares / self.count.max(1.0)).sqrt();
        if deviation <= 0.0 || self.count <= 0.0 {
            return Err("bias frames without any noise".to_owned());
        }
        // The standard deviation of the distribution with scale 1 is 1.8 at λ = 0.
        let log_scale = libm::log(deviation / 1.8);
        let [first, second] = [-0.1, 0.1].map(|shape| {
            let start = Start { at: [shape, log_scale], step: [0.05, 0.1] };
            minimize(start, &|at: [f64; 2]| {
                if !(SHAPES[0]..=SHAPES[1]).contains(&at[0]) {
                    return f64::INFINITY;
                }
                -self.log_likelihood(&self.residuals, at) / self.count
            })
        });
        let best = if first.1 <= second.1 { first.0 } else { second.0 };
        let margin = 2.0 * DERIVATIVE_STEP;
        if best[0] < SHAPES[0] + margin || best[0] > SHAPES[1] - margin {
            return Err(format!(
                "the read noise has no Tukey-λ distribution: λ {:.2} is at the end of its range",
                best[0]
            ));
        }
        Ok(best)
    }

    /// Derivatives of the log-likelihood of some of the residuals with respect to λ and ln σ_TL.
    fn score(&self, residuals: &Folded, [shape, log_scale]: [f64; 2]) -> [f64; 2] {
        let h = DERIVATIVE_STEP;
        [[h, 0.0], [0.0, h]].map(|[x, y]| {
            let up = self.log_likelihood(residuals, [shape + x, log_scale + y]);
            let down = self.log_likelihood(residuals, [shape - x, log_scale - y]);
            (up - down) / (2.0 * h)
        })
    }

    /// Second derivatives of the log-likelihood of all residuals.
    fn curvature(&self, at: [f64; 2]) -> [[f64; 2]; 2] {
        let h = DERIVATIVE_STEP;
        // Second derivatives: the row is the variable of the first derivative, the column that of the second.
        let [across, along] = [[h, 0.0], [0.0, h]].map(|[x, y]| {
            let high = self.score(&self.residuals, [at[0] + x, at[1] + y]);
            let low = self.score(&self.residuals, [at[0] - x, at[1] - y]);
            [0, 1].map(|i| (high[i] - low[i]) / (2.0 * h))
        });
        let mixed = 0.5 * (across[1] + along[0]);
        [[across[0], mixed], [mixed, along[1]]]
    }

    /// Log-likelihood of residuals. A code represents all values within ½ of it.
    fn log_likelihood(&self, residuals: &Folded, [shape, log_scale]: [f64; 2]) -> f64 {
        let mut table = self.table.borrow_mut();
        table.set_shape(shape);
        let scale = libm::exp(log_scale);
        let (mut inner, mut outer) = (table.falling(), table.falling());
        // Residuals below ½ need the distribution above 0: mirror it, in the descending order that the reader requires.
        let mut mirrored: Vec<f64> = Vec::new();
        let small = residuals.0.partition_point(|(size, _)| *size < 0.5);
        let mut mirrored_reader = table.falling();
        for (size, _) in residuals.0[..small].iter().rev() {
            mirrored.push(1.0 - mirrored_reader.at((size - 0.5) / scale));
        }
        let mut mirrored = mirrored.into_iter().rev();
        residuals
            .0
            .iter()
            .map(|(size, count)| {
                let above = if *size < 0.5 { mirrored.next().unwrap_or(0.5) } else { inner.at((0.5 - size) / scale) };
                let probability = above - outer.at((-0.5 - size) / scale);
                count * libm::log(probability.max(MIN_PROBABILITY))
            })
            .sum()
    }
}

/// Maximum number of steps (chosen; the fits of read noise take about 80).
const MAX_STEPS: usize = 600;

/// Convergence tolerance: the search ends once the simplex is smaller than this in both variables (chosen: far below
/// the errors of the fits).
const TOLERANCE: f64 = 1e-7;

/// The initial simplex of a search.
#[derive(Debug, Clone, Copy)]
pub(super) struct Start {
    /// The first vertex.
    at: [f64; 2],
    /// Distance from the first vertex to the second along the first axis, and to the third along the second axis.
    step: [f64; 2],
}

/// A point and the value of the function there.
type Vertex = ([f64; 2], f64);

/// Finds a minimum of a function near a start by the simplex method of Nelder and Mead (1965, The Computer Journal
/// 7:308). Returns the point and the value there.
///
/// The function may return infinity to exclude a point from the search.
fn minimize(start: Start, function: &impl Fn([f64; 2]) -> f64) -> Vertex {
    let evaluate = |at: [f64; 2]| (at, function(at));
    let [x, y] = start.at;
    let mut simplex = [evaluate([x, y]), evaluate([x + start.step[0], y]), evaluate([x, y + start.step[1]])];
    for _ in 0..MAX_STEPS {
        simplex.sort_by(|a, b| a.1.total_cmp(&b.1));
        let [best, middle, worst] = simplex;
        let extent = [0, 1].map(|i| {
            let sides = [middle.0[i] - best.0[i], worst.0[i] - best.0[i]];
            sides[0].abs().max(sides[1].abs())
        });
        if extent[0].max(extent[1]) < TOLERANCE {
            break;
        }
        let centroid: [f64; 2] = std::array::from_fn(|i| best.0[i].midpoint(middle.0[i]));
        // The centroid is at t = 0, the worst vertex at t = 1.
        let along_line = |t: f64| evaluate(std::array::from_fn(|i| centroid[i] + t * (worst.0[i] - centroid[i])));
        let reflected = along_line(-1.0);
        simplex[2] = if reflected.1 < best.1 {
            let expanded = along_line(-2.0);
            if expanded.1 < reflected.1 { expanded } else { reflected }
        } else if reflected.1 < middle.1 {
            reflected
        } else {
            let contracted = along_line(if reflected.1 < worst.1 { -0.5 } else { 0.5 });
            if contracted.1 < reflected.1.min(worst.1) {
                contracted
            } else {
                let shrunk = [middle.0, worst.0].map(|at| evaluate(std::array::from_fn(|i| best.0[i].midpoint(at[i]))));
                simplex[1] = shrunk[0];
                shrunk[1]
            }
        };
    }
    simplex.sort_by(|a, b| a.1.total_cmp(&b.1));
    simplex[0]
}

/// Number of points of the table from the smallest probability to ½ (chosen with the range for relative errors below
/// 10⁻⁵).
const POINTS: usize = 3001;

/// Logit of the smallest probability of the table, 2.8 · 10⁻¹⁰.
const MIN_LOGIT: f64 = -22.0;

/// Lower half of the distribution: probabilities with equally spaced logits, and their quantiles.
#[derive(Debug, Clone)]
pub(super) struct TukeyTable {
    probabilities: Vec<f64>,
    /// ln u and ln(1 − u) of each probability u.
    logarithms: Vec<[f64; 2]>,
    /// Quantiles for the current λ.
    quantiles: Vec<f64>,
}

impl TukeyTable {
    fn new() -> Self {
        let logarithms: Vec<[f64; 2]> = (0..POINTS)
            .map(|i| MIN_LOGIT * (1.0 - i as f64 / (POINTS - 1) as f64))
            // u = 1 / (1 + e^−t)
            .map(|t| [t - libm::log1p(libm::exp(t)), -libm::log1p(libm::exp(t))])
            .collect();
        Self {
            probabilities: logarithms.iter().map(|[log, _]| libm::exp(*log)).collect(),
            quantiles: vec![0.0; POINTS],
            logarithms,
        }
    }

    /// Sets the shape λ.
    fn set_shape(&mut self, shape: f64) {
        for (quantile, [below, above]) in self.quantiles.iter_mut().zip(&self.logarithms) {
            *quantile = if shape == 0.0 {
                below - above
            } else {
                (libm::expm1(shape * below) - libm::expm1(shape * above)) / shape
            };
        }
    }

    /// Reader of the distribution function with scale 1 at descending arguments.
    fn falling(&self) -> Falling<'_> {
        Falling { table: self, above: POINTS - 1 }
    }
}

/// Reader of the distribution function at descending arguments.
pub(super) struct Falling<'a> {
    table: &'a TukeyTable,
    /// Index of a point whose quantile is not below any further argument.
    above: usize,
}

impl Falling<'_> {
    /// Probability of values below `x`, which must be at most 0 and at most the previous argument. It is 0 below the
    /// table.
    fn at(&mut self, x: f64) -> f64 {
        let TukeyTable { quantiles, probabilities, .. } = self.table;
        while self.above > 0 && quantiles[self.above - 1] > x {
            self.above -= 1;
        }
        if self.above == 0 {
            return 0.0;
        }
        let [low, high] = [self.above - 1, self.above];
        let width = quantiles[high] - quantiles[low];
        let share = if width > 0.0 { ((x - quantiles[low]) / width).min(1.0) } else { 0.0 };
        probabilities[low] + share * (probabilities[high] - probabilities[low])
    }
}

/// Search range of λ.
const PLOT_SHAPES: [f64; 2] = [-0.4, 0.5];

/// Read noise fitted by the probability plot.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(crate) struct PlotFit {
    /// Shape λ.
    pub shape: f64,
    /// Scale σ_TL in ADU.
    pub scale: f64,
}

/// Fits the shape whose quantiles correlate best with the sorted residuals; the slope of the plot is the scale (Wei et
/// al. 2021, section 3.2; Filliben 1975). The rounding of codes counts as noise.
///
/// Equal residuals fill an interval of probability; each is plotted at the mean quantile of that interval.
pub(super) fn plot_fit(residuals: &ResidualHistogram) -> PlotFit {
    let counts = residuals.counts();
    let total: f64 = counts.iter().map(|(_, count)| *count as f64).sum();
    let centre = counts.iter().map(|(steps, count)| *count as f64 * (*steps as f64 / STEPS as f64)).sum::<f64>()
        / total.max(1.0);
    // Mean of the product of quantile and residual.
    let product = |shape: f64| {
        let (mut below, mut sum) = (0.0, 0.0);
        let mut integral_below = integral(0.0, shape);
        for (steps, count) in &counts {
            below += *count as f64;
            let integral_above = integral(below / total, shape);
            sum += (*steps as f64 / STEPS as f64 - centre) * (integral_above - integral_below);
            integral_below = integral_above;
        }
        sum
    };
    let shape = golden_section(PLOT_SHAPES, &|shape| product(shape) / variance(shape).sqrt());
    PlotFit { shape, scale: product(shape) / variance(shape) }
}

/// Integral of the quantile function Q from 0 to u: Σ ±(u^(λ+1)) / (λ(λ + 1)) up to a constant.
fn integral(u: f64, shape: f64) -> f64 {
    let [lower, upper] = [u, 1.0 - u].map(|u| {
        if u <= 0.0 {
            return 0.0;
        }
        let log = libm::log(u);
        if shape == 0.0 { u * log } else { u * libm::expm1(shape * log) / shape }
    });
    (lower + upper) / (shape + 1.0)
}

/// Variance of the distribution with scale 1: 2/λ² · (1/(2λ + 1) − Γ(λ + 1)²/Γ(2λ + 2)), and π²/3 at λ = 0.
fn variance(shape: f64) -> f64 {
    // Near 0 the difference suffers from cancellation; the variance is linear there, with a relative error of 10⁻⁶.
    let near = 1e-3;
    if shape.abs() >= near {
        return exact_variance(shape);
    }
    let [below, above] = [-near, near].map(exact_variance);
    below + (above - below) * (shape + near) / (2.0 * near)
}

/// The variance for a shape that is not near 0.
fn exact_variance(shape: f64) -> f64 {
    let gamma = 2.0 * libm::lgamma(shape + 1.0) - libm::lgamma(2.0 * shape + 2.0);
    2.0 / (shape * shape) * (1.0 / (2.0 * shape + 1.0) - libm::exp(gamma))
}

/// Finds the maximum of a unimodal function in a range by golden-section search; returns its argument.
fn golden_section([mut low, mut high]: [f64; 2], function: &impl Fn(f64) -> f64) -> f64 {
    let ratio = (5.0_f64.sqrt() - 1.0) / 2.0;
    let inner = |low: f64, high: f64| [high - ratio * (high - low), low + ratio * (high - low)];
    let [mut a, mut b] = inner(low, high);
    let [mut at_a, mut at_b] = [function(a), function(b)];
    while high - low > 1e-6 {
        if at_a > at_b {
            (high, b, at_b) = (b, a, at_a);
            [a, _] = inner(low, high);
            at_a = function(a);
        } else {
            (low, a, at_a) = (a, b, at_b);
            [_, b] = inner(low, high);
            at_b = function(b);
        }
    }
    low.midpoint(high)
}
