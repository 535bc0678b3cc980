//! All results of a run: [`Findings`].

use super::accuracies::{
    AccuracySummary, CommonItems, Curve, FirstFailure, Health, OfferedChoices, StrictScore, curves,
    first_failures, healths, summarize,
};
use super::answers::confusion::{Confusion, Hallucination, confusions, hallucinations};
use super::bootstrap::Resamples;
use super::calibration::{Calibration, calibrations};
use super::choice::ReadingMode;
use super::cluster::{ClusterUnit, Clusters, FrameTies};
use super::comparisons::{
    Agreement, BestInTheDark, Comparison, ComparisonKind, FindingByReading, ModelsLeftOut,
    PooledFinding, PooledKind, agreements, best_in_the_dark, by_reading, comparisons,
    light_agreements, lights_between, models_left_out, pool, pooled,
};
use super::grid::Grid;
use super::observed::ObserverSummary;
use super::photographs::pair_darkness::{self, PairDarkness};
use super::photographs::{FidelityFindings, PhotographedSet};
use super::significance::Significance;
use super::subject::{ModelInCondition, is_control, is_observer};
use darkqa_ground::types::{
    ChoiceDetail, Family, ImageFidelity, ModelListing, RunQuestion, Trials, Variant,
};

/// All results that are computed from the trials of a run.
#[derive(Debug)]
pub struct Findings<'a> {
    /// The trials by subject and item.
    pub grid: Grid<'a>,
    /// The unit that is treated as independent.
    pub unit: ClusterUnit,
    /// Accuracies by subject, family and reading.
    pub summary: AccuracySummary,
    /// Counts of replies, unreadable replies and failures of each subject.
    pub health: Vec<Health>,
    /// Differences of all models together, ordered by kind, variant, enhancer, family and level.
    pub pooled: Vec<PooledFinding>,
    /// The same over all darker levels of a set together, and over all lighter ones; sentences test them before single levels.
    pub averaged: Vec<PooledFinding>,
    /// Models that the pooled findings leave out, because they answered less than others.
    pub left_out: Vec<ModelsLeftOut>,
    /// Whether each finding about noise holds under every noise profile; empty with one reading.
    pub by_reading: Vec<FindingByReading>,
    /// The models by their mean accuracy in the dark, if there are two or more.
    pub best: Option<BestInTheDark>,
    /// The same in the lenient parsing.
    pub lenient_best: Option<BestInTheDark>,
    /// Paired differences between subjects.
    pub comparisons: Vec<Comparison>,
    /// Thresholds and areas, for all families together and for each family.
    pub curves: Vec<Curve>,
    /// Confidence and accuracy of the subjects whose probabilities of choices are known.
    pub calibrations: Vec<Calibration>,
    /// Answers given against true answers.
    pub confusions: Vec<Confusion>,
    /// Rates of false positives and false negatives.
    pub hallucinations: Vec<Hallucination>,
    /// First level at which each item is answered wrongly, by curve.
    pub first_failures: Vec<FirstFailure>,
    /// Agreement of models in each condition.
    pub agreements: Vec<Agreement>,
    /// Agreement of each model with itself in two lights that show the same.
    pub light_agreements: Vec<Agreement>,
    /// The light in which the photographs of the set were taken.
    pub set: PhotographedSet,
    /// How dark the photographs in the dark are beside their frames, by name.
    pub pairs: Vec<PairDarkness>,
    /// Relation between the similarity of images to their clean frames and the answers; `None` if it was not measured.
    pub fidelity: Option<FidelityFindings>,
    /// Items that all models share; `None` if all were asked the same questions.
    pub common: Option<CommonItems>,
    /// Shares of groups with only right answers; `None` if questions have no groups.
    pub strict: Option<StrictScore>,
    /// Number of tests that sentences rest on, corrected together.
    pub tests: usize,
    /// Results of the observer and its controls. The controls are in no other result.
    pub observer: ObserverSummary,
    /// The results without the observer, if one of its controls is not at chance; these are shown then.
    pub without_observer: Option<Box<Self>>,
}

impl<'a> Findings<'a> {
    /// Computes the results of the trials. `ties` relates frames to each other; `questions` are all questions of the run, for the chance
    /// line; `measured` holds the images that were compared with their clean frames.
    #[must_use]
    pub fn new(
        trials: &'a Trials<ChoiceDetail>,
        ties: &FrameTies,
        questions: impl IntoIterator<Item = OfferedChoices>,
        measured: &[ImageFidelity],
    ) -> Self {
        let listing = ModelListing::default();
        Self::listed(trials, ties, questions, measured, &listing)
    }

    /// The same results with the models as listed.
    #[must_use]
    pub fn listed(
        trials: &'a Trials<ChoiceDetail>,
        ties: &FrameTies,
        questions: impl IntoIterator<Item = OfferedChoices>,
        measured: &[ImageFidelity],
        listing: &ModelListing,
    ) -> Self {
        let clusters = Clusters::new(trials.questions(), ties);
        let questions: Vec<OfferedChoices> = questions.into_iter().collect();
        let observer = ObserverSummary::new(trials, &clusters);
        let is_model = |model: &str| !is_control(model);
        let is_shown = |model: &str| is_model(model) && !is_observer(model);
        let without_observer = observer.is_hidden().then(|| {
            let grid = Grid::for_models(trials, &clusters, listing, is_shown);
            Box::new(Self::build(
                grid,
                &clusters,
                &questions,
                observer.clone(),
                measured,
            ))
        });
        let grid = Grid::for_models(trials, &clusters, listing, is_model);
        Self {
            without_observer,
            ..Self::build(grid, &clusters, &questions, observer, measured)
        }
    }

    /// The same results of a set whose photographs were taken in this light.
    #[must_use]
    pub fn for_set(mut self, set: PhotographedSet) -> Self {
        self.set = set;
        let shown = self.without_observer.take();
        self.without_observer = shown.map(|shown| Box::new(shown.for_set(set)));
        self
    }

    /// The same results with the strict score of the groups that these questions name.
    #[must_use]
    pub fn for_groups(mut self, questions: &[RunQuestion]) -> Self {
        self.strict = StrictScore::new(&self.grid, questions);
        let shown = self.without_observer.take();
        self.without_observer = shown.map(|shown| Box::new(shown.for_groups(questions)));
        self
    }

    /// The findings to report: without the observer, if one of its controls is not at chance or none was asked.
    #[must_use]
    pub fn shown(&self) -> &Self {
        self.without_observer.as_deref().unwrap_or(self)
    }

    fn build(
        grid: Grid<'a>,
        clusters: &Clusters,
        questions: &[OfferedChoices],
        observer: ObserverSummary,
        measured: &[ImageFidelity],
    ) -> Self {
        let draws = Resamples::new(clusters.count());
        let mut findings = Self::for_sentences(grid, clusters, questions, observer, measured);
        let grid = &findings.grid;
        findings.curves = grid
            .groups()
            .into_iter()
            .flat_map(|family| curves(grid, &draws, family))
            .collect();
        findings.first_failures = first_failures(grid);
        findings.agreements = agreements(grid);
        findings.light_agreements = light_agreements(grid);
        findings
    }

    /// The results that sentences rest on; without curves, first failures and agreements, which are left empty.
    fn for_sentences(
        grid: Grid<'a>,
        clusters: &Clusters,
        questions: &[OfferedChoices],
        observer: ObserverSummary,
        measured: &[ImageFidelity],
    ) -> Self {
        let draws = Resamples::new(clusters.count());
        let health = healths(&grid);
        let (pooled, averaged) = pooled(&grid);
        let mut findings = Self {
            unit: clusters.unit(),
            summary: summarize(&grid, &health, questions.iter().cloned()),
            health,
            pooled,
            averaged,
            left_out: models_left_out(&grid),
            by_reading: by_reading(&grid),
            best: best_in_the_dark(&grid, ReadingMode::Strict),
            lenient_best: best_in_the_dark(&grid, ReadingMode::Lenient),
            comparisons: comparisons(&grid),
            curves: Vec::new(),
            calibrations: calibrations(&grid, &draws),
            confusions: confusions(&grid),
            hallucinations: hallucinations(&grid),
            first_failures: Vec::new(),
            agreements: Vec::new(),
            light_agreements: Vec::new(),
            set: PhotographedSet::default(),
            pairs: pair_darkness::from_grid(&grid),
            fidelity: FidelityFindings::new(&grid, measured),
            common: CommonItems::new(&grid),
            strict: None,
            tests: 0,
            observer,
            without_observer: None,
            grid,
        };
        findings.correct_sentences();
        findings
    }

    /// The results that the sentences about trials rest on, for simulations: without curves, first failures and agreements.
    #[must_use]
    pub fn sentences_only(trials: &'a Trials<ChoiceDetail>, ties: &FrameTies) -> Self {
        let clusters = Clusters::new(trials.questions(), ties);
        let observer = ObserverSummary::new(trials, &clusters);
        let grid = Grid::new(trials, &clusters);
        Self::for_sentences(grid, &clusters, &[], observer, &[])
    }

    /// Adds the comparisons of one light with another between different names of one model, which was asked in the same way under
    /// each of them.
    #[must_use]
    pub fn with_lights_between(mut self, names: &[String]) -> Self {
        self.comparisons.extend(lights_between(&self.grid, names));
        let shown = self.without_observer.take();
        self.without_observer = shown.map(|shown| Box::new(shown.with_lights_between(names)));
        self
    }

    /// The models that findings about a variant are about: those with images, without people and without those that answered less than
    /// others there, sorted.
    #[must_use]
    pub fn models_of(&self, variant: &Variant) -> Vec<&str> {
        let mut models = pool(&self.grid);
        let apart: Vec<&String> = self
            .left_out
            .iter()
            .filter(|set| {
                set.kind == PooledKind::Darkness && set.variant == *variant && !set.is_more
            })
            .flat_map(|set| &set.models)
            .collect();
        models.retain(|model| !apart.iter().any(|name| name == model));
        models
    }

    /// The blind models that are significantly more accurate than a subject: the subject's own model, or any if that one was not asked
    /// without images. The test is paired, with Holm's correction over the conditions of the two models.
    #[must_use]
    pub fn below_blind(&self, subject: &ModelInCondition, family: Option<&Family>) -> Vec<&str> {
        self.comparisons
            .iter()
            .filter(|comparison| {
                comparison.kind == ComparisonKind::Blind
                    && comparison.family.as_ref() == family
                    && comparison.first == *subject
                    && comparison.strict.significance == Significance::Worse
            })
            .map(|comparison| &*comparison.second.model)
            .collect()
    }
}
