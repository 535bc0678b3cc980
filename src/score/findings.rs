//! All that records say: [`Findings`].

use std::collections::BTreeMap;

use super::accuracy::{AccuracySummary, summarize};
use super::agreement::{Agreement, agreements};
use super::bootstrap::Resamples;
use super::chance::OfferedChoices;
use super::cluster::{ClusterUnit, Clusters};
use super::comparison::{Comparison, ComparisonKind, comparisons};
use super::confusion::{Confusion, Hallucination, confusions, hallucinations};
use super::curve::{Curve, curves};
use super::flips::{FirstFailure, falls};
use super::grid::Grid;
use super::health::{Health, healths};
use super::subject::Subject;
use crate::types::{Family, FrameId, Record};

/// All that records say.
#[derive(Debug)]
pub struct Findings<'a> {
    /// The records, laid out.
    pub grid: Grid<'a>,
    /// What is taken as independent.
    pub unit: ClusterUnit,
    /// The accuracies.
    pub summary: AccuracySummary,
    /// What became of the trials besides.
    pub health: Vec<Health>,
    /// Differences.
    pub comparisons: Vec<Comparison>,
    /// Thresholds and areas, of all families together and of each.
    pub curves: Vec<Curve>,
    /// Answers against truths.
    pub confusions: Vec<Confusion>,
    /// False positives and negatives.
    pub hallucinations: Vec<Hallucination>,
    /// Where items fail first.
    pub falls: Vec<FirstFailure>,
    /// How far models agree.
    pub agreements: Vec<Agreement>,
}

impl<'a> Findings<'a> {
    /// Finds all; `scenes` holds the scene of each frame where it is known, `questions` what was to be asked, for the chance
    /// line.
    #[must_use]
    pub fn new(
        records: &'a [Record],
        scenes: &BTreeMap<FrameId, String>,
        questions: impl IntoIterator<Item = OfferedChoices>,
    ) -> Self {
        let asked = records
            .iter()
            .map(|record| (&record.question, &record.detail.frame));
        let clusters = Clusters::new(asked, scenes);
        let grid = Grid::new(records, &clusters);
        let draws = Resamples::new(clusters.count());
        let health = healths(&grid);
        Self {
            unit: clusters.unit(),
            summary: summarize(&grid, &health, questions),
            health,
            comparisons: comparisons(&grid),
            curves: grid
                .groups()
                .into_iter()
                .flat_map(|family| curves(&grid, &draws, family))
                .collect(),
            confusions: confusions(&grid),
            hallucinations: hallucinations(&grid),
            falls: falls(&grid),
            agreements: agreements(&grid, &draws),
            grid,
        }
    }

    /// Whether a subject falls below a model without images: its own, where it was asked so.
    #[must_use]
    pub fn below_blind(&self, subject: &Subject, family: Option<&Family>) -> bool {
        self.comparisons.iter().any(|one| {
            one.kind == ComparisonKind::Blind
                && one.family.as_ref() == family
                && one.first == *subject
                && one.paired.difference.value < 0.0
        })
    }
}
