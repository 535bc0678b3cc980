//! System gain K by photon transfer: [`Transfer`].
//!
//! A signal of S ADU is S / K electrons. Their number has the variance S / K, which is K · S in ADU² (Janesick, *Photon
//! Transfer*, 2007; EMVA 1288 release 4 Linear, section 6).

/// Point of photon transfer: a tile of a pair of flats.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Point {
    pub(crate) exposure: usize,
    pub(crate) plane: usize,
    /// Degrees of freedom of the variance, times the weight of the pair.
    pub(crate) weight: f64,
    /// Light above the offset, in ADU.
    pub(crate) signal: f64,
    /// Variance of one frame without read noise, in ADU².
    pub(crate) variance: f64,
    /// Variance of the read noise, in ADU².
    pub(crate) within: f64,
}

/// Straight line through points of photon transfer.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Transfer {
    /// K of all planes together, in ADU per electron.
    pub(crate) gain: f64,
    /// K of each plane; `None` for a plane without points.
    pub(crate) by_plane: Vec<Option<f64>>,
    /// Change of variance / signal over the range of signals, relative to K.
    pub(crate) bend: f64,
    /// Intercept of a line that need not pass through 0: its variance without light, in ADU².
    pub(crate) intercept: f64,
    /// Standard error of `intercept` from the noise of the sites alone.
    pub(crate) intercept_error: f64,
}

impl Transfer {
    /// Fits a line through points of this number of planes.
    pub(crate) fn fit(points: &[Point], planes: usize) -> Self {
        let gain = gain(points);
        let by_plane = (0..planes)
            .map(|plane| {
                let plane_points: Vec<Point> = points.iter().filter(|point| point.plane == plane).copied().collect();
                (!plane_points.is_empty()).then(|| self::gain(&plane_points))
            })
            .collect();
        let [intercept, intercept_error] = intercept(points, gain);
        Self { gain, by_plane, bend: bend(points, gain), intercept, intercept_error }
    }
}

fn sum(points: &[Point], term: impl Fn(&Point) -> f64) -> f64 {
    points.iter().map(term).sum()
}

/// Gain K = Σ w S V / Σ w S² with w = n / (K S + read variance)², because a variance V has the variance 2 (K S + …)² /
/// n. The weights depend on K; three iterations are enough for them to converge.
pub(crate) fn gain(points: &[Point]) -> f64 {
    let mut gain = sum(points, |p| p.weight * p.variance) / sum(points, |p| p.weight * p.signal);
    for _ in 0..3 {
        let product = sum(points, |p| weight(p, gain) * p.signal * p.variance);
        gain = product / sum(points, |p| weight(p, gain) * p.signal * p.signal);
    }
    gain
}

/// Weight of a point in the fit of the gain.
fn weight(point: &Point, gain: f64) -> f64 {
    point.weight / (gain * point.signal + point.within).powi(2)
}

/// Slope of V / S over S, weighted by the number of sites, times the range of S and relative to K.
fn bend(points: &[Point], gain: f64) -> f64 {
    let [slope, _] = line(points.iter().map(|p| (p.weight, p.signal, p.variance / p.signal)));
    let [low, high] = points
        .iter()
        .map(|p| p.signal)
        .fold([f64::INFINITY, 0.0], |[low, high], s| [f64::min(low, s), f64::max(high, s)]);
    slope * (high - low) / gain
}

/// Intercept of the weighted line, and its standard error from the variance 2 (K S + …)² / n of each point.
fn intercept(points: &[Point], gain: f64) -> [f64; 2] {
    let [slope, mean] = line(points.iter().map(|p| (weight(p, gain), p.signal, p.variance)));
    let [mut sum, mut first, mut second] = [0.0; 3];
    for point in points {
        let weight = weight(point, gain);
        sum += weight;
        first += weight * point.signal;
        second += weight * point.signal * point.signal;
    }
    let centre = first / sum;
    let spread = second - first * centre;
    let variance = 2.0 * (1.0 / sum + centre * centre / spread);
    [mean - slope * centre, variance.sqrt()]
}

/// Slope of the weighted regression of y on x, and the weighted mean of y. A point is (weight, x, y).
fn line(points: impl Iterator<Item = (f64, f64, f64)> + Clone) -> [f64; 2] {
    let [sum, x, y] =
        points.clone().fold([0.0; 3], |[sum, x, y], (weight, px, py)| [sum + weight, x + weight * px, y + weight * py]);
    let (x, y) = (x / sum, y / sum);
    let [products, squares] = points.fold([0.0; 2], |[products, squares], (weight, px, py)| {
        let dx = px - x;
        [products + weight * dx * (py - y), squares + weight * dx * dx]
    });
    [products / squares, y]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points of exact variances, `of` the signal, at 40 signals.
    fn points(of: impl Fn(f64) -> f64) -> Vec<Point> {
        (0..40)
            .map(|i: i32| {
                let signal = 300.0 * 1.1_f64.powi(i);
                Point {
                    exposure: (i / 8) as usize,
                    plane: (i % 4) as usize,
                    weight: 1000.0 + f64::from(i),
                    signal,
                    variance: of(signal),
                    within: 2.0,
                }
            })
            .collect()
    }

    #[test]
    fn a_straight_line_gives_its_slope() {
        let fit = Transfer::fit(&points(|signal| 0.75 * signal), 4);
        assert!((fit.gain - 0.75).abs() < 1e-12);
        assert!(fit.by_plane.iter().all(|k| (k.unwrap() - 0.75).abs() < 1e-12));
        assert!(fit.bend.abs() < 1e-10 && fit.intercept.abs() < 1e-8);
    }

    #[test]
    fn bends_and_intercepts_are_found() {
        let bent = Transfer::fit(&points(|s| 0.75 * s * (1.1 - 0.2 * s / 12_300.0)), 4);
        // From 300 to 12 344 ADU, V / S falls from 0.821 to 0.674.
        assert!((bent.bend + 0.196).abs() < 0.01, "{}", bent.bend);
        let lifted = Transfer::fit(&points(|signal| 0.75 * signal + 12.0), 4);
        assert!((lifted.intercept - 12.0).abs() < 1e-6, "{}", lifted.intercept);
        assert!(lifted.intercept_error > 0.0 && lifted.intercept_error < 12.0);
        let mut apart = points(|signal| 0.75 * signal);
        apart.iter_mut().filter(|p| p.plane == 3).for_each(|p| p.variance *= 1.1);
        let fit = Transfer::fit(&apart, 5);
        assert!((fit.by_plane[3].unwrap() - 0.825).abs() < 1e-12);
        assert!((fit.by_plane[0].unwrap() - 0.75).abs() < 1e-12);
        assert_eq!(fit.by_plane[4], None);
    }

    /// The standard error is that of the scatter: V with the deviation (K S + read variance) · √(2 / n).
    #[test]
    fn the_intercept_error_matches_the_scatter() {
        let mut state = 1_u64;
        let mut normal = || {
            // The sum of twelve uniform numbers.
            (0..12).fold(-6.0, |sum, _| {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                sum + (state >> 32) as f64 / 4_294_967_296.0
            })
        };
        let mut squares = 0.0;
        let mut error = 0.0;
        for _ in 0..400 {
            let mut noisy = points(|signal| 0.75 * signal);
            for point in &mut noisy {
                let deviation = (point.variance + point.within) * (2.0 / point.weight).sqrt();
                point.variance += deviation * normal();
            }
            let fit = Transfer::fit(&noisy, 4);
            squares += fit.intercept * fit.intercept / 400.0;
            error += fit.intercept_error / 400.0;
        }
        assert!((squares.sqrt() / error - 1.0).abs() < 0.1, "{squares}, {error}");
    }
}
