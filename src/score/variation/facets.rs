//! Effects of the levels of the facets ([`FacetEffects`]), and how far they are apart ([`FacetRange`]).

use super::matrix::{invert, product};
use super::observation::{Facet, Observation};
use crate::estimate::Estimate;
use crate::significance::ALPHA;
use crate::statistics::estimate::quantile;

/// Effects of the levels of a facet on accuracy, and how each scene contributes to them.
#[derive(Debug, Clone)]
pub(super) struct FacetEffects {
    pub(super) facet: Facet,
    /// Levels, in ascending order.
    pub(super) levels: Vec<u16>,
    /// Effect of each level; their sum is 0.
    pub(super) effects: Vec<f64>,
    /// For each scene, its part of the error of each effect. A part sums to 0 over the levels.
    scores: Vec<Vec<f64>>,
    /// Number of observations of each level.
    counts: Vec<usize>,
}

/// Pivot below which a level is not comparable with the others within questions.
const LEAST_PIVOT: f64 = 1e-9;

impl FacetEffects {
    /// Effects of all facets with two or more levels, by least squares together with an effect of each question.
    ///
    /// Questions need not have all combinations: the effects are computed from differences within questions. A facet is
    /// left out if its levels differ only together with the question or with an earlier facet.
    ///
    /// The errors are those of other scenes under the same levels, from the sums of the residuals by scene (Liang and
    /// Zeger 1986, Biometrika 73:13). `observations` are sorted.
    pub(super) fn all(observations: &[Observation]) -> Vec<Self> {
        let columns = Columns::new(observations);
        let by_scene: Vec<Products> =
            observations.chunk_by(|a, b| a.scene == b.scene).map(|scene| columns.products(scene)).collect();
        let total = Products::sum(&by_scene, columns.count());
        let (inverse, is_kept) = invert(total.squares.clone(), LEAST_PIVOT);
        let effects = product(&inverse, &total.values);
        let scores: Vec<Vec<f64>> = by_scene
            .iter()
            .map(|scene| {
                let fitted = product(&scene.squares, &effects);
                let residuals: Vec<f64> =
                    scene.values.iter().zip(fitted).map(|(value, fitted)| value - fitted).collect();
                product(&inverse, &residuals)
            })
            .collect();
        let facets = columns.facets.iter().filter(|facet| {
            facet.levels.len() > 1
                && is_kept[facet.range()].iter().filter(|kept| **kept).count() + 1 == facet.levels.len()
        });
        facets
            .map(|facet| Self {
                facet: facet.facet,
                levels: facet.levels.clone(),
                effects: centered(&effects[facet.range()]),
                scores: scores.iter().map(|scores| centered(&scores[facet.range()])).collect(),
                counts: facet.counts.clone(),
            })
            .collect()
    }

    /// Effect of a level; 0 for an unknown one.
    pub(super) fn effect(&self, level: u16) -> f64 {
        self.levels.binary_search(&level).map_or(0.0, |index| self.effects[index])
    }

    /// Variance between the effects, with the number of levels minus 1 as degrees of freedom.
    pub(super) fn between(&self) -> f64 {
        self.effects.iter().map(|effect| effect * effect).sum::<f64>() / self.degrees()
    }

    /// Part of the variance between the effects that the sampling of scenes, questions and replies explains; infinite
    /// with one scene.
    pub(super) fn error(&self) -> f64 {
        let squares = self.scores.iter().flatten().map(|score| score * score).sum::<f64>();
        of_scenes(squares, self.scores.len()) / self.degrees()
    }

    /// Sum over the levels of the squared share of observations; 1 over their number if all are equally frequent.
    pub(super) fn concentration(&self) -> f64 {
        let all: f64 = self.counts.iter().map(|count| *count as f64).sum();
        self.counts.iter().map(|count| (*count as f64 / all).powi(2)).sum()
    }

    /// Number of levels minus 1.
    pub(super) fn degrees(&self) -> f64 {
        self.levels.len() as f64 - 1.0
    }

    /// Number of scenes.
    pub(super) fn scenes(&self) -> usize {
        self.scores.len()
    }

    /// The largest effect minus the smallest.
    fn range(&self, n: usize) -> Estimate {
        let (mut value, mut low, mut high) = (0.0_f64, 0.0_f64, 0.0_f64);
        let levels = self.levels.len();
        let pairs = (levels * (levels - 1) / 2) as f64;
        // Two pairs with opposite differences are added.
        let least = self.counts.iter().copied().min().unwrap_or(0);
        let added = 2.0 / (least as f64 + 2.0).powi(2);
        for a in 0..levels {
            for b in 0..a {
                let difference = (self.effects[a] - self.effects[b]).abs();
                let scores: Vec<f64> = self.scores.iter().map(|scores| scores[a] - scores[b]).collect();
                let squares: f64 = scores.iter().map(|score| score * score).sum();
                let error = (of_scenes(squares, scores.len()) + added).sqrt();
                let degrees = scores.len() as f64 - 1.0;
                let [one, all] = [ALPHA, ALPHA / pairs].map(|alpha| quantile(1.0 - alpha / 2.0, degrees));
                value = value.max(difference);
                low = low.max(difference - all * error);
                high = high.max(difference + one * error);
            }
        }
        Estimate { value, low, high: if high.is_nan() { 1.0 } else { high.min(2.0) }, n }
    }
}

/// Variance of a total from the sum of the squared parts of its scenes; infinite with one scene.
fn of_scenes(squares: f64, scenes: usize) -> f64 {
    if scenes < 2 { f64::INFINITY } else { squares * scenes as f64 / (scenes as f64 - 1.0) }
}

fn centered(numbers: &[f64]) -> Vec<f64> {
    let mean = numbers.iter().sum::<f64>() / numbers.len() as f64;
    numbers.iter().map(|number| number - mean).collect()
}

/// How far a facet moves accuracy.
#[derive(Debug, Clone, PartialEq)]
pub struct FacetRange {
    pub facet: Facet,
    /// Accuracy under the best level minus accuracy under the worst, of the levels that were asked. Its `n` is the
    /// number of observations.
    ///
    /// The interval holds for other scenes under the same levels. Its lower end is the largest lower end of the
    /// intervals of all pairs of levels, with Bonferroni's correction, and its upper end the largest upper end of the
    /// intervals without correction: the upper end of the pair with the largest true difference is among them. Without
    /// any effect the range is above 0 by chance, and 19 of 20 intervals start at 0.
    pub range: Estimate,
    /// Level and its accuracy minus the mean over the levels, in ascending order of the levels.
    pub levels: Vec<(u16, f64)>,
}

/// Computes the range of each facet with two or more levels that vary within questions.
#[must_use]
pub fn facet_ranges(observations: &[Observation]) -> Vec<FacetRange> {
    FacetEffects::all(&super::observation::sorted(observations))
        .into_iter()
        .map(|effects| FacetRange {
            facet: effects.facet,
            range: effects.range(observations.len()),
            levels: effects.levels.iter().copied().zip(effects.effects.iter().copied()).collect(),
        })
        .collect()
}

/// Columns of the linear model: one for each level of each facet.
struct Columns {
    facets: Vec<FacetColumns>,
}

struct FacetColumns {
    facet: Facet,
    first: usize,
    levels: Vec<u16>,
    /// Number of observations of each level.
    counts: Vec<usize>,
}

impl FacetColumns {
    fn range(&self) -> std::ops::Range<usize> {
        self.first..self.first + self.levels.len()
    }
}

impl Columns {
    fn new(observations: &[Observation]) -> Self {
        let mut first = 0;
        let facets = Facet::ALL
            .into_iter()
            .map(|facet| {
                let mut all: Vec<u16> = observations.iter().map(|observation| observation.level(facet)).collect();
                all.sort_unstable();
                let (levels, counts): (Vec<u16>, Vec<usize>) =
                    all.chunk_by(|a, b| a == b).map(|level| (level[0], level.len())).unzip();
                let columns = FacetColumns { facet, first, levels, counts };
                first = columns.range().end;
                columns
            })
            .collect();
        Self { facets }
    }

    fn count(&self) -> usize {
        self.facets.iter().map(|facet| facet.levels.len()).sum()
    }

    /// Column of the level of each facet.
    fn of(&self, observation: &Observation) -> [usize; 3] {
        [0, 1, 2].map(|index| {
            let facet = &self.facets[index];
            facet.first + facet.levels.binary_search(&observation.level(facet.facet)).unwrap_or(0)
        })
    }

    /// Products of the columns of a scene, from which the mean of each question is subtracted.
    fn products(&self, scene: &[Observation]) -> Products {
        let count = self.count();
        let mut products = Products { squares: vec![vec![0.0; count]; count], values: vec![0.0; count] };
        for question in scene.chunk_by(|a, b| a.question == b.question) {
            let n = question.len() as f64;
            let mean = question.iter().map(|observation| observation.value).sum::<f64>() / n;
            let mut counts = vec![0.0; count];
            for observation in question {
                let columns = self.of(observation);
                for a in columns {
                    counts[a] += 1.0;
                    products.values[a] += observation.value - mean;
                    for b in columns {
                        products.squares[a][b] += 1.0;
                    }
                }
            }
            for (row, a) in products.squares.iter_mut().zip(&counts) {
                for (entry, b) in row.iter_mut().zip(&counts) {
                    *entry -= a * b / n;
                }
            }
        }
        products
    }
}

/// Sums of products of columns with each other and with the values.
struct Products {
    squares: Vec<Vec<f64>>,
    values: Vec<f64>,
}

impl Products {
    fn sum(parts: &[Self], count: usize) -> Self {
        let mut sum = Self { squares: vec![vec![0.0; count]; count], values: vec![0.0; count] };
        for part in parts {
            for (sum, part) in sum.squares.iter_mut().flatten().zip(part.squares.iter().flatten()) {
                *sum += part;
            }
            for (sum, part) in sum.values.iter_mut().zip(&part.values) {
                *sum += part;
            }
        }
        sum
    }
}
