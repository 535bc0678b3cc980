//! Agreement of each model with its own answers at L0, for questions whose true answers are unknown: [`SelfAgreement`].
//!
//! The reference answer is the model's own answer at L0, for each question and order of choices. It replaces the true
//! answer in scoring, so the counts by cluster, the paired tests, Holm's correction and the thresholds of curves are
//! those of the other reports. The results are agreements, not accuracies. By the triangle inequality, the accuracy
//! lost in a condition is at most 1 minus the agreement in that condition, whatever the true answers are.
//!
//! Agreement alone is weak evidence: a model that answers no to everything agrees with itself. Four other results put
//! it in context:
//! - κ, with the expected agreement computed for each question;
//! - the entropy of the answers;
//! - the floor, the agreement without an image, and the ceiling, the agreement when a question is repeated at L0;
//! - the position of the agreement between floor and ceiling ([`evidence`]).
//!
//! Sources: metamorphic testing without an oracle (Spieker and Gotlieb 2019, arXiv:1910.00262); prediction flips under
//! corruption (Hendrycks and Dietterich 2019, arXiv:1903.12261, ImageNet-P); consistency of vision-language models
//! under corruption (Bench-C, arXiv:2511.19032).

mod bank_index;
pub mod cell;
pub mod evidence;
pub mod light;
pub mod models_in_light;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;

use self::bank_index::BankIndex;
use self::cell::{AgreementCell, cells};
use self::evidence::{EvidenceCurve, curves};
use self::light::{LightAnswers, LightReplies};
use self::models_in_light::{ModelsInLight, models_in_light};
use super::comparison::{Comparison, ComparisonKind, comparisons};
use crate::accuracies::{Health, healths};
use crate::answers::confusion::{Confusion, Hallucination, confusions, hallucinations};
use crate::bootstrap::Resamples;
use crate::choice::ParsingMode;
use crate::cluster::{ClusterUnit, Clusters, FrameTies};
use crate::grid::Grid;
use crate::photographs::PhotographedSet;
use crate::tested_sentences::{TestTree, adjust_p_values};
use darkqa_base::types::{ChoiceDetail, ModelListing, RunQuestion, Trials};
use light::{QuestionInLight, questions_in_light};

/// All results of a run without true answers.
#[derive(Debug)]
pub struct SelfAgreement<'a> {
    /// Answers by subject and item.
    pub grid: Grid<'a>,
    /// Unit of clustering, treated as independent.
    pub unit: ClusterUnit,
    /// Counts of the replies of each model at L0, in each parsing.
    pub light: Vec<LightReplies>,
    /// Agreement of each subject with its model's answers at L0. At L0 itself, the agreement of repeated questions.
    pub cells: Vec<AgreementCell>,
    /// Answers of each model at L0 to each question of the bank, in the strict parsing.
    pub questions: Vec<QuestionInLight>,
    /// Paired differences in agreement between the conditions of one model, in the strict parsing.
    pub comparisons: Vec<Comparison>,
    /// Curves of the evidence ([`evidence`]), with the exposure drop at which half of it is lost.
    pub curves: Vec<EvidenceCurve>,
    /// Confusion matrices of the answers in each condition against the answers at L0.
    pub confusions: Vec<Confusion>,
    /// Rates of “yes” if the answer at L0 is no, and vice versa.
    pub hallucinations: Vec<Hallucination>,
    /// Counts of replies, unparsed replies and failures of each subject.
    pub health: Vec<Health>,
    /// Agreement between each pair of models at L0.
    pub between: Vec<ModelsInLight>,
    /// Real light in which the photographs were taken.
    pub set: PhotographedSet,
}

impl<'a> SelfAgreement<'a> {
    /// Computes the results of trials without true answers. `ties` connects frames that belong to one cluster.
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
        let mut models: Vec<String> = grid.subjects.iter().map(|subject| subject.model.clone()).collect();
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
            for mode in ParsingMode::ALL {
                let replies = answers.replies(mode);
                let scored = answers.scored_against_light(trials, mode);
                let grid = Grid::new(&scored, &clusters);
                let questions = questions_in_light(model, &answers, &bank, mode);
                all.cells.extend(cells(&grid, &draws, &bank, &questions, mode));
                all.light.push(replies);
                if mode == ParsingMode::Strict {
                    let found = comparisons(&grid);
                    all.comparisons.extend(found.into_iter().filter(|found| found.kind != ComparisonKind::Model));
                    all.curves.extend(curves(&grid, &draws));
                    all.confusions.extend(confusions(&grid));
                    all.hallucinations.extend(hallucinations(&grid));
                    all.questions.extend(questions);
                }
            }
        }
        // The order of other reports. The sort is stable, so the levels of a variant stay in ascending order.
        all.comparisons.sort_by_key(|found| (found.kind, found.family.is_some()));
        adjust_comparisons(&mut all.comparisons);
        all
    }

    /// Sets the light in which the photographs of the data set were taken.
    #[must_use]
    pub fn with_set(self, set: PhotographedSet) -> Self {
        Self { set, ..self }
    }

    /// Names of the models, in the order of the listing.
    pub fn models(&self) -> Vec<&str> {
        self.light.iter().filter(|light| light.mode == ParsingMode::Strict).map(|light| &*light.model).collect()
    }

    /// Number of items, without repeats. An item is a question about an image in one order of its choices.
    pub fn items(&self) -> usize {
        self.grid.items.iter().filter(|item| item.asked.repeat == 0).count()
    }

    /// Counts of the replies of a model at L0, in the strict parsing.
    pub fn light_of(&self, model: &str) -> Option<&LightReplies> {
        self.light.iter().find(|light| light.model == model && light.mode == ParsingMode::Strict)
    }

    /// Cells over all question families, in the strict parsing.
    pub fn whole(&self) -> impl Iterator<Item = &AgreementCell> + Clone {
        self.cells.iter().filter(|cell| cell.family.is_none() && cell.mode == ParsingMode::Strict)
    }

    /// Numbers of informative questions and of all questions in the bank that a model was asked at L0.
    pub fn informative(&self, model: &str) -> (usize, usize) {
        let questions: Vec<&QuestionInLight> =
            self.questions.iter().filter(|question| question.model == model).collect();
        let informative = questions.iter().filter(|question| question.is_informative()).count();
        (informative, questions.len())
    }

    /// True if no question of the bank is informative for a model: it answers each question alike for nearly all
    /// images.
    pub fn cannot_tell(&self, model: &str) -> bool {
        let (informative, all) = self.informative(model);
        informative == 0 && all > 0
    }
}

/// Sets `p_report` of the comparisons that the report's sentences use. They are corrected together: each model at the
/// darkest testable level of each variant, and each enhancer at each level.
fn adjust_comparisons(comparisons: &mut [Comparison]) {
    let mut darkest = BTreeMap::<_, usize>::new();
    let mut enhanced = BTreeMap::<_, Vec<usize>>::new();
    for (index, comparison) in comparisons.iter().enumerate() {
        let first = &comparison.first;
        if comparison.family.is_some() || !comparison.strict.tested.verdict.is_possible() {
            continue;
        }
        match comparison.kind {
            // The levels of a variant are in ascending order, so the last insert is the darkest level.
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
    let groups: Vec<Vec<usize>> = std::iter::once(darkest.into_values().collect())
        .chain(enhanced.into_values())
        .filter(|tests: &Vec<usize>| !tests.is_empty())
        .collect();
    let tests = TestTree::group(groups.iter().map(|tests| TestTree::group(tests.iter().copied().map(TestTree::leaf))));
    let corrected = adjust_p_values(&tests, |index: usize| comparisons[index].strict.tested.p);
    for (index, p) in corrected {
        // The reference answers are from the strict parsing, so a lenient comparison is not available.
        let comparison = &mut comparisons[index];
        comparison.strict.tested.p_report = Some(p);
        comparison.lenient = comparison.strict.clone();
    }
}
