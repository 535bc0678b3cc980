//! The least value of a function of two numbers, without its derivatives: [`least`].

/// The most steps of a search (chosen; the fits of read noise take about 80).
const MOST_STEPS: usize = 600;
/// A search ends when the simplex is smaller than this in both numbers (chosen: far below the errors of the fits).
const SMALLEST: f64 = 1e-7;

/// Where a search begins.
#[derive(Debug, Clone, Copy)]
pub(super) struct Start {
    pub(super) at: [f64; 2],
    /// Distance of the second and third corner of the simplex.
    pub(super) step: [f64; 2],
}

type Corner = ([f64; 2], f64);

/// The place of the least value near a start, and the value, by the simplex method of Nelder and Mead (1965, The Computer Journal
/// 7:308). An infinite value keeps the search away from a place.
pub(super) fn least(start: Start, function: &impl Fn([f64; 2]) -> f64) -> Corner {
    let corner = |at: [f64; 2]| (at, function(at));
    let [x, y] = start.at;
    let mut simplex = [
        corner([x, y]),
        corner([x + start.step[0], y]),
        corner([x, y + start.step[1]]),
    ];
    for _ in 0..MOST_STEPS {
        simplex.sort_by(|a, b| a.1.total_cmp(&b.1));
        let [best, middle, worst] = simplex;
        let extent = |i: usize| {
            let sides = [middle.0[i] - best.0[i], worst.0[i] - best.0[i]];
            sides[0].abs().max(sides[1].abs())
        };
        if extent(0).max(extent(1)) < SMALLEST {
            break;
        }
        let centre: [f64; 2] = std::array::from_fn(|i| best.0[i].midpoint(middle.0[i]));
        let beyond = |t: f64| {
            corner(std::array::from_fn(|i| {
                centre[i] + t * (worst.0[i] - centre[i])
            }))
        };
        let reflected = beyond(-1.0);
        simplex[2] = if reflected.1 < best.1 {
            let expanded = beyond(-2.0);
            if expanded.1 < reflected.1 {
                expanded
            } else {
                reflected
            }
        } else if reflected.1 < middle.1 {
            reflected
        } else {
            let contracted = beyond(if reflected.1 < worst.1 { -0.5 } else { 0.5 });
            if contracted.1 < reflected.1.min(worst.1) {
                contracted
            } else {
                let halfway =
                    |at: [f64; 2]| corner(std::array::from_fn(|i| best.0[i].midpoint(at[i])));
                simplex[1] = halfway(middle.0);
                halfway(worst.0)
            }
        };
    }
    simplex.sort_by(|a, b| a.1.total_cmp(&b.1));
    simplex[0]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_least_value_is_found() {
        // Rosenbrock's valley, with its least value 0 at (1, 1).
        let valley = |[x, y]: [f64; 2]| (1.0 - x).powi(2) + 100.0 * (y - x * x).powi(2);
        let start = Start {
            at: [-1.2, 1.0],
            step: [0.5, 0.5],
        };
        let ([x, y], value) = least(start, &valley);
        assert!((x - 1.0).abs() < 1e-5 && (y - 1.0).abs() < 1e-5, "{x}, {y}");
        assert!(value < 1e-10);
        // A wall keeps it out.
        let walled = |[x, y]: [f64; 2]| {
            if x > 0.5 {
                f64::INFINITY
            } else {
                valley([x, y])
            }
        };
        let ([x, _], _) = least(start, &walled);
        assert!(x <= 0.5 && x > 0.49, "{x}");
    }
}
