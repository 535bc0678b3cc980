//! All results of a run: [`Findings`].

use super::accuracies::{
    AccuracySummary, CommonItems, Curve, FirstFailure, Health, OfferedChoices, StrictScore, curves, first_failures,
    healths, summarize,
};
use super::answers::confusion::{Confusion, Hallucination, confusions, hallucinations};
use super::bootstrap::Resamples;
use super::calibration::{Calibration, calibrations};
use super::choice::ParsingMode;
use super::cluster::{ClusterUnit, Clusters, FrameTies};
use super::comparisons::{
    Agreement, BestInTheDark, Claim, Comparison, ComparisonKind, FamilyContrast, FindingByProfile, ModelsLeftOut,
    PooledFinding, PooledKind, agreements, best_in_the_dark, by_profile, comparisons, family_contrasts,
    light_agreements, lights_between, models_left_out, pool, pooled,
};
use super::grid::Grid;
use super::model_in_condition::{ModelInCondition, is_control, is_observer};
use super::observed::ObserverSummary;
use super::photographs::{self, FidelityFindings, PairDarkness, PhotographedSet};
use super::significance::Verdict;
use super::variation::RunVariation;
use darkqa_base::types::{ChoiceDetail, Family, ImageFidelity, ModelListing, RunQuestion, Trials, Variant};

/// All results that are computed from the trials of a run.
#[derive(Debug)]
pub struct Findings<'a> {
    /// Trials by subject and item.
    pub grid: Grid<'a>,
    /// Unit that is treated as independent.
    pub unit: ClusterUnit,
    /// Accuracies by subject, family and parsing.
    pub summary: AccuracySummary,
    /// Counts of replies, unreadable replies and failures of each subject.
    pub health: Vec<Health>,
    /// Differences of all models together, ordered by kind, variant, enhancer, family and level.
    pub pooled: Vec<PooledFinding>,
    /// Differences averaged over the darker levels of a set, and over the lighter ones. Sentences test them before
    /// single levels.
    pub averaged: Vec<PooledFinding>,
    /// In each variant, the two families whose losses are furthest apart.
    pub contrasts: Vec<FamilyContrast>,
    /// Models that the pooled findings leave out because they answered fewer items than others.
    pub left_out: Vec<ModelsLeftOut>,
    /// Test results of each claim about noise under every noise profile; empty with a single profile.
    pub by_profile: Vec<FindingByProfile>,
    /// Ranking of the models by mean accuracy in the dark; `None` with fewer than two models.
    pub best: Option<BestInTheDark>,
    /// The same ranking in the lenient parsing.
    pub lenient_best: Option<BestInTheDark>,
    /// Paired differences between subjects.
    pub comparisons: Vec<Comparison>,
    /// Variation over wordings, orders and draws; `None` if every question was asked in one of each.
    pub variation: Option<RunVariation>,
    /// Thresholds and areas, for all families together and for each family.
    pub curves: Vec<Curve>,
    /// Confidence and accuracy of each subject with known probabilities of the choices.
    pub calibrations: Vec<Calibration>,
    /// Confusion tables: true answers by given answers.
    pub confusions: Vec<Confusion>,
    /// Rates of false positives and false negatives.
    pub hallucinations: Vec<Hallucination>,
    /// First level at which each item is answered wrongly, by curve.
    pub first_failures: Vec<FirstFailure>,
    /// Agreement of models in each condition.
    pub agreements: Vec<Agreement>,
    /// Agreement of each model with itself between two kinds of images of the same scenes.
    pub light_agreements: Vec<Agreement>,
    /// Light in which the photographs of the data set were taken.
    pub set: PhotographedSet,
    /// Exposure drop of the dark photographs relative to their frames, by name.
    pub pairs: Vec<PairDarkness>,
    /// Relation between the fidelity of images and right answers; `None` if fidelity was not measured.
    pub fidelity: Option<FidelityFindings>,
    /// Items that all models share; `None` if all were asked the same questions.
    pub common: Option<CommonItems>,
    /// Shares of groups with only right answers; `None` if questions have no groups.
    pub strict: Option<StrictScore>,
    /// Number of tests behind sentences, which are corrected together.
    pub tests: usize,
    /// Results of the observer and its controls. All other results exclude the controls.
    pub observer: ObserverSummary,
    /// Results without the observer, to be reported if one of its controls is not at chance.
    pub without_observer: Option<Box<Self>>,
}

impl<'a> Findings<'a> {
    /// Computes the results of the trials. `ties` relates frames to each other; `questions` are all questions of the
    /// run, for the chance line; `measured` lists the images that were compared with their clean frames.
    #[must_use]
    pub fn new(
        trials: &'a Trials<ChoiceDetail>,
        ties: &FrameTies,
        questions: impl IntoIterator<Item = OfferedChoices>,
        measured: &[ImageFidelity],
    ) -> Self {
        let listing = ModelListing::default();
        Self::with_listing(trials, ties, questions, measured, &listing)
    }

    /// Like [`Self::new`], with the models in the order of `listing`.
    #[must_use]
    pub fn with_listing(
        trials: &'a Trials<ChoiceDetail>,
        ties: &FrameTies,
        questions: impl IntoIterator<Item = OfferedChoices>,
        measured: &[ImageFidelity],
        listing: &ModelListing,
    ) -> Self {
        let clusters = Clusters::new(trials.questions(), ties);
        let questions: Vec<OfferedChoices> = questions.into_iter().collect();
        let observer = ObserverSummary::new(trials, &clusters);
        let without_observer = observer.is_hidden().then(|| {
            let grid = Grid::for_models(trials, &clusters, listing, |model| !is_control(model) && !is_observer(model));
            Box::new(Self::build(grid, &clusters, &questions, observer.clone(), measured))
        });
        let grid = Grid::for_models(trials, &clusters, listing, |model| !is_control(model));
        Self { without_observer, ..Self::build(grid, &clusters, &questions, observer, measured) }
    }

    /// Sets the light in which the photographs of the data set were taken.
    #[must_use]
    pub fn with_set(mut self, set: PhotographedSet) -> Self {
        self.set = set;
        let shown = self.without_observer.take();
        self.without_observer = shown.map(|shown| Box::new(shown.with_set(set)));
        self
    }

    /// Adds the strict score of the groups that these questions name.
    #[must_use]
    pub fn with_groups(mut self, questions: &[RunQuestion]) -> Self {
        self.strict = StrictScore::new(&self.grid, questions);
        let shown = self.without_observer.take();
        self.without_observer = shown.map(|shown| Box::new(shown.with_groups(questions)));
        self
    }

    /// Findings to report: those without the observer if one of its controls is not at chance, or if no control was
    /// asked.
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
            .flat_map(|family| curves(grid, &draws, family, &findings.summary.unbalanced))
            .collect();
        findings.variation = RunVariation::new(grid, &findings.comparisons);
        findings.first_failures = first_failures(grid);
        findings.agreements = agreements(grid);
        findings.light_agreements = light_agreements(grid);
        findings
    }

    /// Computes only the results behind sentences; curves, first failures and agreements are left empty.
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
            contrasts: family_contrasts(&grid, &pooled),
            pooled,
            averaged,
            left_out: models_left_out(&grid),
            by_profile: by_profile(&grid),
            best: best_in_the_dark(&grid, ParsingMode::Strict),
            lenient_best: best_in_the_dark(&grid, ParsingMode::Lenient),
            comparisons: comparisons(&grid),
            variation: None,
            curves: Vec::new(),
            calibrations: calibrations(&grid, &draws),
            confusions: confusions(&grid),
            hallucinations: hallucinations(&grid),
            first_failures: Vec::new(),
            agreements: Vec::new(),
            light_agreements: Vec::new(),
            set: PhotographedSet::default(),
            pairs: photographs::from_grid(&grid),
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

    /// Computes only the results behind sentences about trials, for simulations.
    #[must_use]
    pub fn sentences_only(trials: &'a Trials<ChoiceDetail>, ties: &FrameTies) -> Self {
        let clusters = Clusters::new(trials.questions(), ties);
        let observer = ObserverSummary::new(trials, &clusters);
        let grid = Grid::new(trials, &clusters);
        Self::for_sentences(grid, &clusters, &[], observer, &[])
    }

    /// Adds comparisons between different images of the same level for one model that was asked under several names.
    #[must_use]
    pub fn with_lights_between(mut self, names: &[String]) -> Self {
        self.comparisons.extend(lights_between(&self.grid, names));
        let shown = self.without_observer.take();
        self.without_observer = shown.map(|shown| Box::new(shown.with_lights_between(names)));
        self
    }

    /// Ranking of the models in the dark, if its leader is detected to be the best in both parsings.
    #[must_use]
    pub fn detected_best(&self) -> Option<&BestInTheDark> {
        let (strict, lenient) = (self.best.as_ref()?, self.lenient_best.as_ref()?);
        let is_same = strict.leader().model == lenient.leader().model;
        (strict.is_detected() && lenient.is_detected() && is_same).then_some(strict)
    }

    /// Models that findings about a variant are about, sorted: models with images, without people and without models
    /// that answered fewer items than others in this variant.
    #[must_use]
    pub fn models_of(&self, variant: &Variant) -> Vec<&str> {
        let mut models = pool(&self.grid);
        let apart: Vec<&String> = self
            .left_out
            .iter()
            .filter(|set| set.kind == PooledKind::Darkness && set.variant == *variant && !set.is_more)
            .flat_map(|set| &set.models)
            .collect();
        models.retain(|model| !apart.iter().any(|name| name == model));
        models
    }

    /// True if sentences may be about this comparison of a model with a blind model: raw dark images, in one family or,
    /// if the pooled findings are about several models, over all families.
    #[must_use]
    pub fn is_tested_against_blind(&self, comparison: &Comparison) -> bool {
        let first = &comparison.first;
        if comparison.kind != ComparisonKind::Blind || first.enhancer.is_some() || first.variant.kind.is_none() {
            return false;
        }
        let models = self.models_of(&first.variant);
        models.contains(&&*first.model) && (comparison.family.is_some() || models.len() > 1)
    }

    /// Blind models that are detected to be more accurate than a subject: the subject's own model, or any model if that
    /// one was not asked without images. The test is paired, and corrected over all tests behind sentences.
    #[must_use]
    pub fn below_blind(&self, subject: &ModelInCondition, family: Option<&Family>) -> Vec<&str> {
        self.comparisons
            .iter()
            .filter(|comparison| {
                comparison.kind == ComparisonKind::Blind
                    && comparison.family.as_ref() == family
                    && comparison.first == *subject
                    && comparison.claim() == Claim::Detected(Verdict::Worse)
            })
            .map(|comparison| &*comparison.second.model)
            .collect()
    }
}
