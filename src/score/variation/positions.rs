//! Preference of a model for one position of the choices: [`PositionPreference`].

use crate::choice::ParsingMode;
use crate::comparisons::paired::{BoundedSums, PairedComparison};
use crate::estimate::Estimate;
use crate::grid::Grid;
use crate::model_in_condition::ModelInCondition;
use darkqa_base::types::AxisLevel;

/// The position that a subject answers most in excess of the truth, in the strict parsing.
///
/// It is of interest in runs that ask in several orders, in which no position is right more often than others by the
/// content of the questions.
#[derive(Debug, Clone, PartialEq)]
pub struct PositionPreference {
    pub subject: ModelInCondition,
    /// Index of the position; 0 is A.
    pub position: usize,
    /// Share of the readable replies that name the position, of questions that have it.
    pub given: f64,
    /// Share of the same questions whose true choice is there.
    pub truth: f64,
    /// `given` less `truth`. Its `n` is the number of replies.
    pub excess: Estimate,
    /// p-value of no excess at any position, by Bonferroni's correction over the positions.
    pub p: f64,
    /// The share of replies that name the position less that of the same model at L0; `None` for L0 itself, enhanced
    /// images, and models without L0.
    pub change: Option<Estimate>,
    /// p-value of no change at any position, corrected in the same way.
    pub change_p: Option<f64>,
}

impl PositionPreference {
    /// The preference of each subject with a readable reply.
    #[must_use]
    pub fn all(grid: &Grid<'_>) -> Vec<Self> {
        (0..grid.subjects.len()).filter_map(|subject| Self::new(grid, subject)).collect()
    }

    fn new(grid: &Grid<'_>, subject: usize) -> Option<Self> {
        let positions = grid.items.iter().map(|item| item.asked.choices.len()).max()?;
        let shares = (0..positions).filter_map(|position| PositionShares::new(grid, subject, position));
        let most = shares.reduce(|most, next| if next.excess() > most.excess() { next } else { most })?;
        let tested = most.sums.test(1.0)?.tested;
        let of_all = |p: f64| (p * positions as f64).min(1.0);
        let dark = &grid.subjects[subject];
        let clean = ModelInCondition::with_images(&dark.model, AxisLevel::L0, &dark.variant, None);
        let clean = grid.find_up_to_group(&clean).filter(|_| dark.variant.is_degraded() && dark.enhancer.is_none());
        let change = clean.and_then(|clean| {
            PairedComparison::counting(
                grid,
                [subject, clean],
                ParsingMode::Strict,
                |_, item| item.asked.choices.len() > most.position,
                |_, chosen| chosen.map(usize::from) == Some(most.position),
            )
        });
        Some(Self {
            subject: dark.clone(),
            position: most.position,
            given: most.given as f64 / most.replies as f64,
            truth: most.truth as f64 / most.replies as f64,
            excess: tested.difference,
            p: of_all(tested.p),
            change: change.as_ref().map(|change| change.tested.difference),
            change_p: change.map(|change| of_all(change.tested.p)),
        })
    }
}

/// Counts of the readable replies of a subject to questions that have a position.
struct PositionShares {
    position: usize,
    replies: usize,
    /// Replies that name the position.
    given: usize,
    /// Questions whose true choice is there.
    truth: usize,
    /// Whether a reply names the position, less whether the truth is there.
    sums: BoundedSums,
}

impl PositionShares {
    fn new(grid: &Grid<'_>, subject: usize, position: usize) -> Option<Self> {
        let mut shares = Self { position, replies: 0, given: 0, truth: 0, sums: BoundedSums::new(grid.clusters) };
        for (item, result) in grid.family_items(subject, None) {
            let chosen = result.parsed(ParsingMode::Strict).flatten();
            let (Some(chosen), true) = (chosen, item.asked.choices.len() > position) else {
                continue;
            };
            let [is_given, is_true] =
                [Some(usize::from(chosen)), item.asked.truth].map(|index| index == Some(position));
            shares.replies += 1;
            shares.given += usize::from(is_given);
            shares.truth += usize::from(is_true);
            shares.sums.add(item.cluster, i64::from(is_given) - i64::from(is_true));
        }
        (shares.replies > 0).then_some(shares)
    }

    /// Number of replies in excess: a position that few questions have counts little.
    fn excess(&self) -> i64 {
        self.given as i64 - self.truth as i64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::{records, with_grid};
    use darkqa_base::types::{ParsedAnswer, Record};

    /// Replies of a model that names this position always, or the truth.
    fn replies(condition: &str, position: Option<usize>) -> Vec<Record> {
        let mut records = records("m", condition, |_| Some(true));
        for record in &mut records {
            let chosen = position.or(record.detail.truth);
            let reading = ParsedAnswer { chosen, ..record.detail.strict.unwrap() };
            record.detail.strict = Some(reading);
            record.detail.lenient = Some(reading);
        }
        records
    }

    #[test]
    fn a_model_that_answers_b_in_the_dark_is_told_from_one_that_sees() {
        let run = [replies("L0", None), replies("L5-ev", Some(1))].concat();
        with_grid(&run, |grid| {
            let found = PositionPreference::all(grid);
            let [light, dark] = ["L0", "L5"].map(|level| {
                found.iter().find(|one| one.subject.level.is_some_and(|own| own.to_string() == level)).unwrap()
            });
            assert_eq!((light.excess.value, light.p, light.change), (0.0, 1.0, None));
            assert_eq!((dark.position, dark.given, dark.truth, dark.excess.value), (1, 1.0, 0.0, 1.0));
            assert!(dark.p < 0.01 && dark.change_p.unwrap() < 0.01);
            assert!((dark.change.unwrap().value - 1.0).abs() < 1e-12);
        });
    }
}
