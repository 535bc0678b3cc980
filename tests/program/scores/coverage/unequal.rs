//! Intervals where the clusters differ much in their number of questions.

use super::*;
use super::{differences, shares};

/// Designs of one shape. An accuracy of 30 % stands for models near chance.
fn designs(shape: Shape) -> Designs<'static> {
    Designs { shape, clusters: &[(8, 8), (25, 8), (52, 8)], means: &[0.3, 0.5, 0.75, 0.9, 0.98] }
}

const SHAPES: [Shape; 3] = [Shape::LogNormal(0.5), Shape::LogNormal(1.0), Shape::Third];

#[test]
#[ignore = "takes half a minute; prints a table of src/docs/numbers.md"]
fn share_coverage_with_unequal_clusters() {
    for shape in SHAPES {
        designs(shape).print(["share"], shares::share, 2000);
    }
}

#[test]
#[ignore = "takes half a minute; prints a table of src/docs/numbers.md"]
fn difference_coverage_with_unequal_clusters() {
    for shape in SHAPES {
        designs(shape).print(["paired difference"], differences::paired, 1000);
        let six = ["difference of 6 models together"];
        designs(shape).print(six, differences::of_six, 1000);
    }
}

#[test]
fn shares_with_one_large_cluster() {
    let design = |mean, correlation| Design { clusters: 25, size: 8, shape: Shape::Third, mean, correlation };
    let held = [(0.3, 0.1), (0.3, 0.2), (0.75, 0.1), (0.75, 0.2)]
        .map(|(mean, correlation)| coverage(shares::share, &design(mean, correlation), 4000)[0].unwrap());
    // 94.0 without regard to how far the large cluster draws the mean.
    let mean = held.iter().sum::<f64>() / 4.0;
    assert!((94.1..=97.0).contains(&mean), "{held:?}");
}
