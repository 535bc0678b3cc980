//! Agreement of each model with its own answers in the light, for questions without known true answers: [`SelfAgreement`].
//!
//! The reference of a model is its own answer at L0, for each question and order of choices. A trial is scored against it as another trial
//! is scored against the truth, so that the counts by cluster, the paired tests, Holm's correction and the crossing of a curve are those of
//! the other reports; nothing here is an accuracy. By the triangle inequality the accuracy that is lost in a condition is at most one minus
//! the agreement there, whatever the true answers are.
//!
//! Agreement alone is weak evidence: a model that answers no to everything agrees with itself. It is therefore reported with κ with the
//! expected agreement by question, the entropy of the answers, the agreement of the model without an image (the floor) and of the same
//! question asked again at L0 (the ceiling), and the share of the way from the floor to the ceiling ([`evidence`]).
//!
//! Sources: metamorphic testing for want of an oracle (Spieker and Gotlieb 2019, arXiv:1910.00262); flips of predictions under
//! corruption (Hendrycks and Dietterich 2019, arXiv:1903.12261, ImageNet-P); consistency of vision-language models under corruption
//! (Bench-C, arXiv:2511.19032).

mod bank_index;
pub mod cell;
mod counts;
pub mod evidence;
mod kappa;
pub mod light;
pub mod models_in_light;
pub mod question_in_light;

#[cfg(test)]
mod tests;

use std::collections::BTreeMap;

use self::bank_index::BankIndex;
use self::cell::{AgreementCell, cells};
use self::evidence::{EvidenceCurve, curves};
use self::light::{LightAnswers, LightReplies};
use self::models_in_light::{ModelsInLight, models_in_light};
use self::question_in_light::{QuestionInLight, questions_in_light};
use super::comparison::{Comparison, ComparisonKind, comparisons};
use crate::accuracies::{Health, healths};
use crate::answers::confusion::{Confusion, Hallucination, confusions, hallucinations};
use crate::bootstrap::Resamples;
use crate::choice::ReadingMode;
use crate::cluster::{ClusterUnit, Clusters, FrameTies};
use crate::grid::Grid;
use crate::head::{TestTree, adjusted};
use crate::photographs::PhotographedSet;
use darkqa_ground::types::{ChoiceDetail, ModelListing, RunQuestion, Trials};

/// All results of a run without true answers.
#[derive(Debug)]
pub struct SelfAgreement<'a> {
    /// The answers, by subject and item.
    pub grid: Grid<'a>,
    /// The unit that is treated as independent.
    pub unit: ClusterUnit,
    /// Counts of each model's replies in the light, in each reading.
    pub light: Vec<LightReplies>,
    /// The agreement of each subject with its model's answers in the light. The cell of L0 is that of the questions asked again.
    pub cells: Vec<AgreementCell>,
    /// Every question of the bank, for each model, in the strict parsing.
    pub questions: Vec<QuestionInLight>,
    /// Paired differences between the conditions of one model, in the strict parsing: which of them agrees with L0.
    pub comparisons: Vec<Comparison>,
    /// The exposure drop at which half of the evidence is lost.
    pub curves: Vec<EvidenceCurve>,
    /// Answers given against those at L0.
    pub confusions: Vec<Confusion>,
    /// Rates of “yes” where the answer at L0 is no, and the other way round.
    pub hallucinations: Vec<Hallucination>,
    /// Counts of replies, unreadable replies and failures of each subject.
    pub health: Vec<Health>,
    /// How far two models agree with each other in the light.
    pub between: Vec<ModelsInLight>,
    /// The light in which the photographs were taken.
    pub set: PhotographedSet,
}

impl<'a> SelfAgreement<'a> {
    /// Computes the results of trials without true answers. `ties` relates frames to each other.
    #[must_use]
    pub fn new(
        trials: &'a Trials<ChoiceDetail>,
        ties: &FrameTies,
        questions: &'a [RunQuestion],
        listing: &ModelListing,
    ) -> Self {
        let clusters = Clusters::new(trials.questions(), ties);
        let draws = Resamples::new(clusters.count());
        let bank = BankIndex::new(questions);
        let grid = Grid::without_truths(trials, &clusters, listing);
        let mut models: Vec<String> = grid
            .subjects
            .iter()
            .map(|subject| subject.model.clone())
            .collect();
        models.dedup();
        let mut all = Self {
            unit: clusters.unit(),
            light: Vec::new(),
            cells: Vec::new(),
            questions: Vec::new(),
            comparisons: Vec::new(),
            curves: Vec::new(),
            confusions: Vec::new(),
            hallucinations: Vec::new(),
            health: healths(&grid),
            between: models_in_light(trials, &clusters, &models, &bank),
            set: PhotographedSet::default(),
            grid,
        };
        for model in &models {
            let answers = LightAnswers::new(trials, model);
            for mode in ReadingMode::ALL {
                let replies = answers.replies(mode);
                let held = answers.held_against(trials, mode);
                let grid = Grid::new(&held, &clusters);
                let questions = questions_in_light(model, &answers, &bank, mode);
                all.cells
                    .extend(cells(&grid, &draws, &bank, &questions, mode));
                all.light.push(replies);
                if mode == ReadingMode::Strict {
                    let found = comparisons(&grid);
                    all.comparisons.extend(
                        found
                            .into_iter()
                            .filter(|found| found.kind != ComparisonKind::Model),
                    );
                    all.curves.extend(curves(&grid, &draws));
                    all.confusions.extend(confusions(&grid));
                    all.hallucinations.extend(hallucinations(&grid));
                    all.questions.extend(questions);
                }
            }
        }
        // The kinds stand together, as in other reports; the sort is stable.
        all.comparisons
            .sort_by_key(|found| (found.kind, found.family.is_some()));
        correct(&mut all.comparisons);
        all
    }

    /// The same results of a set whose photographs were taken in this light.
    #[must_use]
    pub fn for_set(self, set: PhotographedSet) -> Self {
        Self { set, ..self }
    }

    /// The models, in their order.
    pub fn models(&self) -> Vec<&str> {
        let light = self.light.iter();
        light
            .filter(|light| light.mode == ReadingMode::Strict)
            .map(|light| &*light.model)
            .collect()
    }

    /// Number of items: questions about images, each in one order of its choices, without those that were only asked again.
    pub fn items(&self) -> usize {
        self.grid
            .items
            .iter()
            .filter(|item| item.asked.repeat == 0)
            .count()
    }

    /// Counts of a model's replies in the light, in the strict parsing.
    pub fn light_of(&self, model: &str) -> Option<&LightReplies> {
        let mut light = self.light.iter();
        light.find(|light| light.model == model && light.mode == ReadingMode::Strict)
    }

    /// The cells of all families together in the strict parsing.
    pub fn whole(&self) -> impl Iterator<Item = &AgreementCell> + Clone {
        self.cells
            .iter()
            .filter(|cell| cell.family.is_none() && cell.mode == ReadingMode::Strict)
    }

    /// Numbers of the bank's questions of a model: those that can tell something, and all.
    pub fn informative(&self, model: &str) -> (usize, usize) {
        let questions = self
            .questions
            .iter()
            .filter(|question| question.model == model);
        let informative = questions.clone().filter(|found| found.is_informative());
        (informative.count(), questions.count())
    }

    /// Whether the bank cannot tell anything of a model: its commonest answer to every question is that about nearly all images.
    pub fn cannot_tell(&self, model: &str) -> bool {
        let (informative, all) = self.informative(model);
        informative == 0 && all > 0
    }
}

/// Corrects the comparisons that sentences are about over all of them: each model at the darkest level of each variant, and each
/// enhancer at each level.
fn correct(comparisons: &mut [Comparison]) {
    let mut darkest = BTreeMap::<_, usize>::new();
    let mut enhanced = BTreeMap::<_, Vec<usize>>::new();
    for (index, comparison) in comparisons.iter().enumerate() {
        let first = &comparison.first;
        if comparison.family.is_some() || !comparison.strict.significance.is_possible() {
            continue;
        }
        match comparison.kind {
            // The levels of a variant ascend: the last one is the darkest.
            ComparisonKind::Level => {
                darkest.insert((first.model.clone(), first.variant.clone()), index);
            }
            ComparisonKind::Enhancer => {
                let tests = enhanced.entry(first.enhancer.clone()).or_default();
                tests.push(index);
            }
            _ => {}
        }
    }
    let questions: Vec<Vec<usize>> = std::iter::once(darkest.into_values().collect())
        .chain(enhanced.into_values())
        .filter(|tests: &Vec<usize>| !tests.is_empty())
        .collect();
    let tests = questions
        .iter()
        .map(|tests| TestTree::group(tests.iter().copied().map(TestTree::leaf)));
    let tests = TestTree::group(tests);
    let corrected = adjusted(&tests, |index: usize| comparisons[index].strict.paired.p);
    for (index, p) in corrected {
        // The answers at L0 are those of the strict parsing, so that it is the only one.
        let comparison = &mut comparisons[index];
        comparison.strict.p_report = Some(p);
        comparison.lenient = comparison.strict.clone();
    }
}
