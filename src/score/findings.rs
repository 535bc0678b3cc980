//! All results of a run: [`Findings`].

use std::collections::BTreeMap;

use super::accuracy::{AccuracySummary, summarize};
use super::agreement::{Agreement, agreements};
use super::bootstrap::Resamples;
use super::chance::OfferedChoices;
use super::cluster::{ClusterUnit, Clusters};
use super::comparison::{Comparison, ComparisonKind, comparisons};
use super::confusion::{Confusion, Hallucination, confusions, hallucinations};
use super::curve::{Curve, curves};
use super::flips::{FirstFailure, first_failures};
use super::grid::Grid;
use super::health::{Health, healths};
use super::observed::ObserverSummary;
use super::subject::{Subject, is_control, is_observer};
use crate::types::{Family, FrameId, Record};

/// All results that are computed from the records of a run.
#[derive(Debug)]
pub struct Findings<'a> {
    /// The records by subject and item.
    pub grid: Grid<'a>,
    /// The unit that is treated as independent.
    pub unit: ClusterUnit,
    /// Accuracies by subject, family and reading.
    pub summary: AccuracySummary,
    /// Counts of replies, unreadable replies and failures of each subject.
    pub health: Vec<Health>,
    /// Paired differences between subjects.
    pub comparisons: Vec<Comparison>,
    /// Thresholds and areas, for all families together and for each family.
    pub curves: Vec<Curve>,
    /// Answers given against true answers.
    pub confusions: Vec<Confusion>,
    /// Rates of false positives and false negatives.
    pub hallucinations: Vec<Hallucination>,
    /// First level at which each item is answered wrongly, by curve.
    pub first_failures: Vec<FirstFailure>,
    /// Agreement of models in each condition.
    pub agreements: Vec<Agreement>,
    /// Results of the observer and its controls. The controls are in no other result.
    pub observer: ObserverSummary,
    /// The results without the observer, if one of its controls is not at chance; these are shown then.
    pub without_observer: Option<Box<Self>>,
}

impl<'a> Findings<'a> {
    /// Results of the records. `scenes` holds the scene of each frame for which it is known; `questions` are all questions
    /// of the run, for the chance line.
    #[must_use]
    pub fn new(
        records: &'a [Record],
        scenes: &BTreeMap<FrameId, String>,
        questions: impl IntoIterator<Item = OfferedChoices>,
    ) -> Self {
        let pairs = records
            .iter()
            .map(|record| (&record.question, &record.detail.frame));
        let clusters = Clusters::new(pairs, scenes);
        let questions: Vec<OfferedChoices> = questions.into_iter().collect();
        let observer = ObserverSummary::of(records, &clusters);
        let is_model = |model: &str| !is_control(model);
        let is_shown = |model: &str| is_model(model) && !is_observer(model);
        let without_observer = observer.is_refuted().then(|| {
            let grid = Grid::of_models(records, &clusters, is_shown);
            Box::new(Self::of(grid, &clusters, &questions, observer.clone()))
        });
        let grid = Grid::of_models(records, &clusters, is_model);
        Self {
            without_observer,
            ..Self::of(grid, &clusters, &questions, observer)
        }
    }

    /// What is shown: without the observer, if one of its controls is not at chance.
    #[must_use]
    pub fn shown(&self) -> &Self {
        self.without_observer.as_deref().unwrap_or(self)
    }

    fn of(
        grid: Grid<'a>,
        clusters: &Clusters,
        questions: &[OfferedChoices],
        observer: ObserverSummary,
    ) -> Self {
        let draws = Resamples::new(clusters.count());
        let health = healths(&grid);
        Self {
            unit: clusters.unit(),
            summary: summarize(&grid, &health, questions.iter().cloned()),
            health,
            comparisons: comparisons(&grid),
            curves: grid
                .groups()
                .into_iter()
                .flat_map(|family| curves(&grid, &draws, family))
                .collect(),
            confusions: confusions(&grid),
            hallucinations: hallucinations(&grid),
            first_failures: first_failures(&grid),
            agreements: agreements(&grid, &draws),
            observer,
            without_observer: None,
            grid,
        }
    }

    /// Whether a subject is less accurate than the same model without images, or than any such model if its own was not asked.
    #[must_use]
    pub fn below_blind(&self, subject: &Subject, family: Option<&Family>) -> bool {
        self.comparisons.iter().any(|comparison| {
            comparison.kind == ComparisonKind::Blind
                && comparison.family.as_ref() == family
                && comparison.first == *subject
                && comparison.paired.difference.value < 0.0
        })
    }
}
