//! Comparison of new runs with an old one: [`BaselineRow`].

use super::comparison::MIN_PAIRS;
use super::paired::PairedComparison;
use crate::accuracies::Health;
use crate::choice::ReadingMode;
use crate::grid::Grid;
use crate::significance::{ALPHA, Significance, holm, least_p};
use crate::subject::ModelInCondition;

/// Comparison of a model in a condition between the new runs and the old one.
#[derive(Debug, Clone, PartialEq)]
pub struct BaselineRow {
    /// Model and condition in the new runs.
    pub subject: ModelInCondition,
    /// New minus old, on the items that both answered about the same image.
    pub paired: PairedComparison,
    /// p-value after Holm's correction over all conditions of all models under test. Reference models (`random`, the observer) are
    /// corrected among themselves.
    pub holm: f64,
    pub significance: Significance,
    /// Smallest difference that the test would detect in 80 % of runs like these, at the level after Bonferroni's correction.
    pub detectable: f64,
    /// Number of items that were asked about different images; they are not compared.
    pub other_images: usize,
    /// New and old, over all trials.
    pub sides: [BaselineSide; 2],
}

/// Cost and losses of one side of a comparison with a baseline.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BaselineSide {
    /// Number of trials with a reply.
    pub replies: usize,
    /// Number of replies that could not be read.
    pub unread: usize,
    /// Number of trials without a reply.
    pub failed: usize,
    /// Cost of the replies in US dollars at list prices; `None` if it is not known.
    pub cost: Option<f64>,
}

/// Compares the subjects of a grid. `pairs` lists the indices of a new subject and the old one, `health` has one entry for each subject,
/// and `cost` returns the cost of a subject.
#[must_use]
pub fn baseline_rows(
    grid: &Grid<'_>,
    health: &[Health],
    pairs: &[(usize, usize)],
    cost: impl Fn(usize) -> Option<f64>,
) -> Vec<BaselineRow> {
    let side = |subject: usize| BaselineSide {
        replies: health[subject].replies,
        unread: health[subject].unreadable(),
        failed: health[subject].failures(),
        cost: cost(subject),
    };
    let mut rows: Vec<BaselineRow> = pairs
        .iter()
        .filter_map(|&(new, old)| {
            let image = |subject, item| grid.trial(subject, item)?.sent_digest();
            let is_other = |item| {
                image(new, item)
                    .zip(image(old, item))
                    .is_some_and(|(new, old)| new != old)
            };
            let mode = ReadingMode::Strict;
            Some(BaselineRow {
                subject: grid.subjects[new].clone(),
                paired: PairedComparison::on_items(grid, new, old, mode, |item, _| {
                    !is_other(item)
                })?,
                holm: 1.0,
                significance: Significance::TooFew,
                detectable: f64::INFINITY,
                other_images: (0..grid.items.len()).filter(|item| is_other(*item)).count(),
                sides: [side(new), side(old)],
            })
        })
        .collect();
    for is_reference in [false, true] {
        correct(
            rows.iter_mut()
                .filter(|row| row.subject.is_reference() == is_reference)
                .collect(),
        );
    }
    rows
}

/// Applies Holm's correction to the tests of these rows, so that the probability of any false verdict is at most 5 %.
fn correct(mut rows: Vec<&mut BaselineRow>) {
    let adjusted = |of: fn(&PairedComparison) -> f64| {
        let values = rows.iter().map(|row| of(&row.paired));
        holm(&values.collect::<Vec<_>>())
    };
    let corrected = adjusted(|paired| paired.p);
    let least = adjusted(|paired| least_p(paired.clusters));
    let level = ALPHA / rows.len() as f64;
    for ((row, holm), least) in rows.iter_mut().zip(corrected).zip(least) {
        row.holm = holm;
        row.detectable = row.paired.spread.detectable(level);
        if row.paired.difference.n >= MIN_PAIRS {
            row.significance = Significance::new(row.paired.difference.value, holm, least);
        }
    }
}
