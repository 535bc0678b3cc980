use super::*;
use crate::commands::calibrate::frames::{Cfa, HotPixels, Layout};
use crate::commands::calibrate::sums::{Centres, PlaneSums, STEPS};
use darkqa_light::draws::tukey_lambda;

/// ResidualHistogram of a frame of 512 × 512 sites whose noise has these quantiles, in pseudorandom order.
fn residuals(shape: f64, scale: f64, seed: u64) -> ResidualHistogram {
    let layout = Layout { cfa: Cfa::Mono, height: 512, width: 512 };
    let sites = layout.height * layout.width;
    let samples: Vec<u16> = (0..sites)
        .map(|site| {
            // Multiples of the golden ratio fill the interval evenly; each row starts at another one.
            let place = (site as f64 + seed as f64 * 0.37) * 0.618_033_988_749_894_9;
            let u = (place.fract() * (1.0 - 1e-9) + 5e-10).clamp(1e-9, 1.0 - 1e-9);
            // Row noise: the fractional parts of the row centres differ.
            let row = 3.0 * (site as f64 / 512.0).floor() * 0.754_877_666_246_692_8;
            (511.3 + row % 2.0 + scale * tukey_lambda(u, shape) + 0.5).floor() as u16
        })
        .collect();
    let hot = HotPixels::none(layout.plane_rows());
    let sums = PlaneSums::new(layout, &samples, &hot);
    ResidualHistogram::new(layout, &samples, &sums, &hot, Centres::RowsAndPlanes)
}

#[test]
fn shape_and_scale_are_recovered_despite_rounding() {
    for (shape, scale) in [(0.1143, 0.59), (0.0, 1.2), (-0.043, 1.55), (-0.114, 4.0), (-0.143, 8.0)] {
        let fit = ReadNoise::fit(&[residuals(shape, scale, 1)]).unwrap();
        assert!((fit.shape - shape).abs() < 0.004, "{shape}: {}", fit.shape);
        let error = fit.log_scale.exp() / scale - 1.0;
        assert!(error.abs() < 0.004, "{scale}: {error}");
    }
}

/// The probability plot counts rounding as noise, unlike the likelihood: at a scale of 0.6 ADU it is about 5 % off.
#[test]
fn the_probability_plot_counts_rounding_as_noise() {
    let coarse = plot_fit(&residuals(0.1143, 0.59, 1));
    let error = coarse.scale / 0.59 - 1.0;
    assert!((0.04..0.07).contains(&error), "{error}");
    let fine = plot_fit(&residuals(-0.114, 8.0, 1));
    assert!((fine.shape + 0.114).abs() < 0.003, "{}", fine.shape);
    assert!((fine.scale / 8.0 - 1.0).abs() < 0.004, "{}", fine.scale);
}

/// One step of Newton's method from the fit of all groups approximates a fit of one group.
#[test]
fn a_resample_matches_a_fit_of_its_groups() {
    let groups = [residuals(0.0, 2.0, 1), residuals(0.02, 2.1, 2)];
    let both = ReadNoise::fit(&groups).unwrap();
    let first = ReadNoise::fit(&groups[..1]).unwrap();
    let [shape, log_scale] = both.resampled(&[2.0, 0.0]);
    assert!((shape - first.shape).abs() < 2e-3, "{shape}, {}", first.shape);
    assert!((log_scale - first.log_scale).abs() < 4e-3, "{log_scale}");
    // Equal weights give the fit itself.
    let [shape, log_scale] = both.resampled(&[1.0, 1.0]);
    assert!((shape - both.shape).abs() < 1e-4 && (log_scale - both.log_scale).abs() < 1e-4);
    // Control: the groups differ by more than the tolerance.
    assert!((first.shape - both.shape).abs() > 5e-3);
}

/// For example samples hit by cosmic rays.
#[test]
fn outliers_have_little_effect() {
    let clean = residuals(0.1143, 0.59, 1);
    let fit = ReadNoise::fit(std::slice::from_ref(&clean)).unwrap();
    let mut spoiled = clean;
    for place in 0..20 {
        spoiled.count((40 + place) * STEPS);
    }
    let moved = ReadNoise::fit(&[spoiled]).unwrap();
    assert!((moved.shape - fit.shape).abs() < 0.01, "{}", moved.shape);
    assert!((moved.log_scale - fit.log_scale).abs() < 0.01);
}

#[test]
fn frames_without_noise_are_refused() {
    let layout = Layout { cfa: Cfa::Mono, height: 256, width: 256 };
    let hot = HotPixels::none(layout.plane_rows());
    let samples = vec![512; 256 * 256];
    let sums = PlaneSums::new(layout, &samples, &hot);
    let none = ResidualHistogram::new(layout, &samples, &sums, &hot, Centres::RowsAndPlanes);
    let problem = ReadNoise::fit(&[none]).unwrap_err();
    assert!(problem.contains("without any noise"), "{problem}");
}

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
