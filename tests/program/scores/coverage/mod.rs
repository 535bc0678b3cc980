//! How often each interval holds the truth, and how often each test rejects, in simulated runs whose truth is known.
//!
//! The short tests run always. The long ones print the tables from which `src/docs/numbers.md` is written:
//! `cargo test --test program coverage:: -- --ignored --nocapture`, or one of them by its name. Draws are fixed by each
//! design, so that no run differs from another, whichever tests run.

#![expect(clippy::print_stdout, reason = "the long tests print the tables of the documentation")]

use darkqa_score::bootstrap::Resamples;
use darkqa_score::estimate::ClusterCount;
use darkqa_score::estimate::Estimate;
use rand::rngs::StdRng;
use rand::{RngExt as _, SeedableRng as _};
use rand_distr::{Beta, Binomial, Distribution as _, StandardNormal};
use rayon::prelude::*;

mod auc;
mod curves;
mod differences;
mod few;
mod pooled;
mod shares;
mod unequal;

/// How the questions are spread over the clusters.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Shape {
    /// As many in each.
    Even,
    /// A third of all in one cluster, and as many in each of the others.
    Third,
    /// Nine tenths of all in one cluster, and as many in each of the others.
    Most,
    /// Log-normal numbers, at least 1, with this standard deviation of their logarithm; drawn for each run.
    LogNormal(f64),
}

/// A simulated design: the clusters, the true share, and the intraclass correlation.
#[derive(Debug, Clone, Copy)]
struct Design {
    clusters: usize,
    /// Mean number of questions of a cluster.
    size: u32,
    shape: Shape,
    mean: f64,
    correlation: f64,
}

impl Design {
    /// The right-rate of a cluster about a mean.
    fn rate_about(&self, random: &mut StdRng, mean: f64) -> f64 {
        if self.correlation == 0.0 {
            return mean;
        }
        let scale = (1.0 - self.correlation) / self.correlation;
        let beta = Beta::new(mean * scale, (1.0 - mean) * scale).unwrap();
        beta.sample(random).clamp(0.0, 1.0)
    }

    fn rate(&self, random: &mut StdRng) -> f64 {
        self.rate_about(random, self.mean)
    }

    /// The number of questions of each cluster.
    fn sizes(&self, random: &mut StdRng) -> Vec<u32> {
        let mean = f64::from(self.size);
        match self.shape {
            Shape::Even => vec![self.size; self.clusters],
            Shape::Third | Shape::Most => {
                let share = if self.shape == Shape::Most { 0.9 } else { 1.0 / 3.0 };
                let large = (self.clusters as f64 * mean * share).round();
                let others = (1.0 / share - 1.0) * large / (self.clusters - 1) as f64;
                let mut sizes = vec![others.round().max(1.0) as u32; self.clusters];
                sizes[0] = large as u32;
                sizes
            }
            Shape::LogNormal(spread) => {
                let size = |drawn: f64| mean * (spread * drawn - spread * spread / 2.0).exp();
                (0..self.clusters)
                    .map(|_| size(StandardNormal.sample(random)))
                    .map(|size| size.round().max(1.0) as u32)
                    .collect()
            }
        }
    }

    /// Something of each cluster, from its number of questions.
    fn clusters<T>(&self, random: &mut StdRng, mut of: impl FnMut(&mut StdRng, u32) -> T) -> Vec<T> {
        let sizes = self.sizes(random);
        sizes.into_iter().map(|size| of(random, size)).collect()
    }

    /// A seed of its own.
    fn seed(&self) -> u64 {
        let shape = match self.shape {
            Shape::Even => 0,
            Shape::Third => 1,
            Shape::Most => 1 << 9,
            Shape::LogNormal(spread) => 2 + (100.0 * spread) as u64,
        };
        shape << 50
            | (self.clusters as u64) << 40
            | u64::from(self.size) << 24
            | ((1000.0 * self.mean) as u64) << 12
            | (1000.0 * self.correlation) as u64
    }
}

fn binomial(random: &mut StdRng, n: u32, p: f64) -> u32 {
    Binomial::new(u64::from(n), p).unwrap().sample(random) as u32
}

fn holds(estimate: Estimate, truth: f64) -> bool {
    (estimate.low..=estimate.high).contains(&truth)
}

/// One simulated run: whether each of N intervals holds its truth; `None` if the run has no interval.
type Simulation<const N: usize> = fn(&mut StdRng, &Design, &Resamples) -> [Option<bool>; N];

/// How often an interval holds the truth in a design, in percent; `None` if fewer than half of the runs have the
/// interval.
fn coverage<const N: usize>(simulate: Simulation<N>, design: &Design, runs: usize) -> [Option<f64>; N] {
    let mut random = StdRng::seed_from_u64(design.seed());
    let draws = Resamples::new(design.clusters);
    let (mut made, mut held) = ([0_usize; N], [0_usize; N]);
    for _ in 0..runs {
        for (index, outcome) in simulate(&mut random, design, &draws).into_iter().enumerate() {
            made[index] += usize::from(outcome.is_some());
            held[index] += usize::from(outcome == Some(true));
        }
    }
    std::array::from_fn(|index| {
        let (made, held) = (made[index], held[index]);
        (2 * made > runs).then(|| 100.0 * held as f64 / made as f64)
    })
}

/// The designs of one shape: each of some numbers and sizes of clusters, with each correlation and each mean.
struct Designs<'a> {
    shape: Shape,
    clusters: &'a [(usize, u32)],
    means: &'a [f64],
}

const CORRELATIONS: [f64; 4] = [0.0, 0.1, 0.2, 0.4];

/// Designs of clusters of one size.
const EVEN: Designs<'_> = Designs {
    shape: Shape::Even,
    clusters: &[(8, 6), (12, 12), (25, 8), (52, 20), (52, 180)],
    means: &[0.5, 0.75, 0.9, 0.98],
};

impl Designs<'_> {
    /// Prints how often each interval holds the truth: a summary of all designs, and each design.
    fn print<const N: usize>(&self, names: [&str; N], simulate: Simulation<N>, runs: usize) {
        let means = |cell: (usize, u32), correlation| {
            let design = move |mean: &f64| Design {
                clusters: cell.0,
                size: cell.1,
                shape: self.shape,
                mean: *mean,
                correlation,
            };
            self.means.iter().map(design)
        };
        let cells = self.clusters.iter().flat_map(|cell| CORRELATIONS.map(|correlation| (*cell, correlation)));
        let designs: Vec<Design> = cells.flat_map(|(cell, icc)| means(cell, icc)).collect();
        let held = designs.par_iter();
        let held: Vec<[Option<f64>; N]> = held.map(|design| coverage(simulate, design, runs)).collect();
        for (index, name) in names.into_iter().enumerate() {
            let name = match self.shape {
                Shape::Even => name.to_owned(),
                shape => format!("{name}, {shape:?}"),
            };
            let held: Vec<Option<f64>> = held.iter().map(|held| held[index]).collect();
            let rows = held.chunks(CORRELATIONS.len() * self.means.len());
            let rows: Vec<String> = rows
                .zip(self.clusters)
                .map(|(held, (clusters, size))| {
                    let cells: Vec<String> = held.chunks(self.means.len()).map(cell_text).collect();
                    format!("| {name} | {clusters} × {size} | {} |", cells.join(" | "))
                })
                .collect();
            println!(
                "\n| interval | cells × runs | mean | least | 5th percentile | cells < 93 | > 97 |\n|---|---|---|---|---|---|---|\n{}\n\n\
                 Each cell: p {:?}\n\n| interval | clusters × size | ICC 0 | 0.1 | 0.2 | 0.4 |\n|---|---|---|---|---|---|\n{}\n",
                summary(&name, &held, runs),
                self.means,
                rows.join("\n")
            );
        }
    }
}

/// The percentages of a cell of a table, rounded; a dash for each that is missing.
fn cell_text(held: &[Option<f64>]) -> String {
    let text = |held: &Option<f64>| held.map_or("–".to_owned(), |held| format!("{held:.0}"));
    held.iter().map(text).collect::<Vec<_>>().join(" ")
}

/// The row of an interval in the summary of all designs.
fn summary(name: &str, held: &[Option<f64>], runs: usize) -> String {
    let mut sorted: Vec<f64> = held.iter().flatten().copied().collect();
    sorted.sort_by(f64::total_cmp);
    let n = sorted.len();
    let mean = sorted.iter().sum::<f64>() / n as f64;
    let low = sorted.iter().filter(|held| **held < 93.0).count();
    let high = sorted.iter().filter(|held| **held > 97.0).count();
    format!("| {name} | {n} × {runs} | {mean:.1} | {:.1} | {:.1} | {low} | {high} |", sorted[0], sorted[n / 20])
}
