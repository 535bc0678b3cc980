//! Derivative-free minimization of a function of two variables: [`minimize`].

/// Maximum number of steps (chosen; the fits of read noise take about 80).
const MAX_STEPS: usize = 600;
/// Convergence tolerance: the search ends once the simplex is smaller than this in both variables (chosen: far below
/// the errors of the fits).
const TOLERANCE: f64 = 1e-7;

/// The initial simplex of a search.
#[derive(Debug, Clone, Copy)]
pub(super) struct Start {
    /// The first vertex.
    pub(super) at: [f64; 2],
    /// Distance from the first vertex to the second along the first axis, and to the third along the second axis.
    pub(super) step: [f64; 2],
}

/// A point and the value of the function there.
type Vertex = ([f64; 2], f64);

/// Finds a minimum of a function near a start by the simplex method of Nelder and Mead (1965, The Computer Journal
/// 7:308). Returns the point and the value there.
///
/// The function may return infinity to exclude a point from the search.
pub(super) fn minimize(start: Start, function: &impl Fn([f64; 2]) -> f64) -> Vertex {
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Rosenbrock's valley. Its minimum, 0, is at (1, 1).
    fn valley([x, y]: [f64; 2]) -> f64 {
        (1.0 - x).powi(2) + 100.0 * (y - x * x).powi(2)
    }

    #[test]
    fn finds_the_minimum_outside_excluded_points() {
        let start = Start { at: [-1.2, 1.0], step: [0.5, 0.5] };
        let ([x, y], value) = minimize(start, &valley);
        assert!((x - 1.0).abs() < 1e-5 && (y - 1.0).abs() < 1e-5, "{x}, {y}");
        assert!(value < 1e-10);
        // With x > 0.5 excluded, the search ends at the boundary.
        let ([x, _], _) = minimize(start, &|at: [f64; 2]| {
            if at[0] > 0.5 { f64::INFINITY } else { valley(at) }
        });
        assert!(x <= 0.5 && x > 0.49, "{x}");
    }
}
