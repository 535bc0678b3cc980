//! Fit of read noise by the probability plot: [`plot_fit`].

use serde::Serialize;

use super::super::sums::{Residuals, STEPS};

/// Search range of λ.
const SHAPES: [f64; 2] = [-0.4, 0.5];

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
pub(crate) fn plot_fit(residuals: &Residuals) -> PlotFit {
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
    let shape = golden_section(SHAPES, &|shape| product(shape) / variance(shape).sqrt());
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
