//! Comparison of new runs with an old one: [`BaselineRow`].

use super::comparison::MIN_PAIRS;
use super::paired::PairedComparison;
use crate::accuracies::Health;
use crate::choice::ParsingMode;
use crate::grid::Grid;
use crate::model_in_condition::ModelInCondition;
use crate::significance::{ALPHA, PValues, Verdict};

/// Comparison of a model in a condition between the new runs and the old one.
#[derive(Debug, Clone, PartialEq)]
pub struct BaselineRow {
    /// Model and condition in the new runs.
    pub subject: ModelInCondition,
    /// New minus old, on the items that both answered about the same image. Holm's correction is over all conditions of
    /// all models under test. Reference models (`random`, the observer) are corrected among themselves.
    pub paired: PairedComparison,
    /// Smallest difference that the test would detect in 80 % of runs like these, at the level after Bonferroni's
    /// correction.
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

/// Compares the subjects of a grid. `pairs` lists the indices of a new subject and the old one, `health` has one entry
/// for each subject, and `cost` returns the cost of a subject. If `compares_bytes` is false, equal images of both sides
/// have other bytes, and all count as the same.
#[must_use]
pub fn baseline_rows(
    grid: &Grid<'_>,
    health: &[Health],
    pairs: &[(usize, usize)],
    compares_bytes: bool,
    cost: impl Fn(usize) -> Option<f64>,
) -> Vec<BaselineRow> {
    let mut rows: Vec<BaselineRow> = pairs
        .iter()
        .filter_map(|&(new, old)| {
            let has_other_image: Vec<bool> = (0..grid.items.len())
                .map(|item| {
                    let [new, old] = [new, old].map(|subject| grid.compared_trial(subject, item)?.sent_digest());
                    compares_bytes && new.zip(old).is_some_and(|(new, old)| new != old)
                })
                .collect();
            let mode = ParsingMode::Strict;
            Some(BaselineRow {
                subject: grid.subjects[new].clone(),
                paired: PairedComparison::on_items(grid, new, old, mode, |item, _| !has_other_image[item])?,
                detectable: f64::INFINITY,
                other_images: has_other_image.iter().filter(|is_other| **is_other).count(),
                sides: [new, old].map(|subject| BaselineSide {
                    replies: health[subject].replies,
                    unread: health[subject].unreadable(),
                    failed: health[subject].failures(),
                    cost: cost(subject),
                }),
            })
        })
        .collect();
    for is_reference in [false, true] {
        correct(rows.iter_mut().filter(|row| row.subject.is_reference() == is_reference).collect());
    }
    rows
}

/// Applies Holm's correction to the tests of these rows, so that the probability of any false verdict is at most 5 %.
fn correct(mut rows: Vec<&mut BaselineRow>) {
    let tests: Vec<PValues> = rows.iter().map(|row| row.paired.p_values()).collect();
    let level = ALPHA / rows.len() as f64;
    for (row, corrected) in rows.iter_mut().zip(PValues::corrected(&tests)) {
        row.detectable = row.paired.spread.detectable(level);
        let tested = &mut row.paired.tested;
        tested.correct(tested.difference.value, corrected);
        if tested.difference.n < MIN_PAIRS {
            tested.verdict = Verdict::TooFew;
        }
    }
}
