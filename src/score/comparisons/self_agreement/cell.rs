//! Agreement of one subject with the answers of its model at L0: [`AgreementCell`].
//!
//! Counts of answers at L0 and in a condition, by question of the bank: [`BankCounts`].
//!
//! Agreement beyond the agreement expected from answer frequencies: [`kappa`].

use std::collections::{BTreeMap, BTreeSet};

use super::bank_index::BankIndex;
use super::evidence::{Bounds, NoEvidence, evidence};
use super::light::{QuestionInLight, entropy, is_cannot_tell, is_refused};
use crate::bootstrap::Resamples;
use crate::choice::ParsingMode;
use crate::estimate::{ClusterCount, Estimate};
use crate::grid::Grid;
use crate::model_in_condition::ModelInCondition;
use crate::statistics::estimate::{degrees_of_freedom, student};
use darkqa_base::types::{AxisLevel, Family, View};

/// Agreement of one subject on one family in one parsing, with the numbers needed to interpret it.
#[derive(Debug, Clone, PartialEq)]
pub struct AgreementCell {
    pub subject: ModelInCondition,
    /// Question family; `None` for all families together.
    pub family: Option<Family>,
    /// Parsing of the replies.
    pub mode: ParsingMode,
    /// Share of the replies with the same answer as at L0, over questions with an answer at L0. An unreadable reply
    /// counts as a disagreement. Its interval holds for all values of the missing replies. `None` without a reply.
    pub agreement: Option<Estimate>,
    /// Agreement on the informative questions only.
    pub informative: Option<Estimate>,
    /// κ with the expected agreement by question; `None` if it is not defined.
    pub kappa: Option<Estimate>,
    /// Mean entropy of the answers by question, from 0 to 1: at L0, and in this condition.
    pub entropies: [Option<f64>; 2],
    /// Share of the evidence that is left, or the reason why it is not given; for conditions other than the floor and
    /// the ceiling.
    pub evidence: Option<Result<Estimate, NoEvidence>>,
    /// Share of unreadable replies.
    pub unread: Option<Estimate>,
    /// Number of refusals.
    pub refused: usize,
    /// Number of trials without a reply. They are not counted.
    pub failed: usize,
    /// Share of the replies “cannot tell from the image”; `None` if the questions have no such choice.
    pub cannot_tell: Option<Estimate>,
}

/// Role of a cell among those of its model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CellRole {
    /// Floor: no image was shown.
    Floor,
    /// Ceiling: the same images were shown again.
    Ceiling,
    /// Other images were shown: darker, or enhanced.
    Other,
}

impl AgreementCell {
    /// Role of this cell among those of its model.
    pub fn role(&self) -> CellRole {
        let subject = &self.subject;
        if subject.view == Some(View::Blind) {
            CellRole::Floor
        } else if subject.level == Some(AxisLevel::L0) && subject.enhancer.is_none() {
            CellRole::Ceiling
        } else {
            CellRole::Other
        }
    }

    /// Number of replies behind the agreement.
    pub fn replies(&self) -> usize {
        self.agreement.map_or(0, |agreement| agreement.n)
    }
}

/// Computes the cells of the grid of a model, scored against its answers at L0; ordered by subject, then by family.
pub(super) fn cells(
    grid: &Grid<'_>,
    draws: &Resamples,
    bank: &BankIndex<'_>,
    questions: &[QuestionInLight],
    mode: ParsingMode,
) -> Vec<AgreementCell> {
    let informative: BTreeSet<usize> =
        questions.iter().filter(|question| question.is_informative()).map(|question| question.index).collect();
    let is_informative: Vec<bool> = grid
        .items
        .iter()
        .map(|item| bank.position(&item.asked.question).is_some_and(|question| informative.contains(&question)))
        .collect();
    let informative_grid = grid.select_items(&is_informative);
    let mut cells = Vec::new();
    for subject in 0..grid.subjects.len() {
        for family in grid.groups() {
            let counts = grid.counts(subject, family, mode);
            let part = CellItems { grid, subject, family, mode };
            let failed = grid.failed(subject, family);
            let mut cell = part.cell(bank, &counts, &failed);
            cell.informative = informative_grid.accuracy(subject, family, mode);
            if cell.role() == CellRole::Other {
                let bounds = Bounds::new(grid, &cell.subject, family, mode, draws);
                let share = bounds.map(|bounds| evidence(&counts, &failed, &bounds, draws));
                cell.evidence = share.transpose();
            }
            cells.push(cell);
        }
    }
    // A family that a subject was not asked about has no cell.
    cells.retain(|cell| cell.agreement.is_some() || cell.failed > 0);
    cells
}

/// The items of a cell.
struct CellItems<'g, 'r> {
    grid: &'g Grid<'r>,
    subject: usize,
    family: Option<&'g Family>,
    mode: ParsingMode,
}

impl CellItems<'_, '_> {
    /// Computes the cell, except the fields that depend on other cells.
    fn cell(&self, bank: &BankIndex<'_>, counts: &[ClusterCount], failed: &[u32]) -> AgreementCell {
        let (grid, subject, mode) = (self.grid, self.subject, self.mode);
        let agreement = Estimate::with_missing(counts, failed);
        let answers = BankCounts::new(grid, subject, self.family, mode, bank);
        AgreementCell {
            subject: grid.subjects[subject].clone(),
            family: self.family.cloned(),
            mode,
            agreement,
            informative: None,
            kappa: agreement.and_then(|agreement| kappa(&answers, counts, agreement)),
            entropies: answers.entropies(),
            evidence: None,
            unread: self.share(|chosen, _| chosen.is_none()),
            refused: self.refused(),
            failed: failed.iter().map(|count| *count as usize).sum(),
            cannot_tell: self.cannot_tell(),
        }
    }

    /// Share of the replies for which `counts_reply` is true; it takes the parsed answer, if there is one, and the
    /// choices.
    fn share(&self, counts_reply: impl Fn(Option<&str>, &[String]) -> bool) -> Option<Estimate> {
        let mut counts = vec![ClusterCount::default(); self.grid.clusters];
        for (item, result) in self.grid.family_items(self.subject, self.family) {
            let Some(reading) = result.parsed(self.mode) else {
                continue;
            };
            let choices = &*item.asked.choices;
            let answer = reading.and_then(|index| choices.get(usize::from(index)));
            let count = &mut counts[item.cluster as usize];
            count.replies += 1;
            count.right += u32::from(counts_reply(answer.map(String::as_str), choices));
        }
        Estimate::clustered(&counts)
    }

    /// Share of the replies “cannot tell from the image”; `None` if the questions have no such choice.
    fn cannot_tell(&self) -> Option<Estimate> {
        let offers_cannot_tell = self
            .grid
            .family_items(self.subject, self.family)
            .flat_map(|(item, _)| item.asked.choices.iter())
            .any(|choice| is_cannot_tell(choice));
        if offers_cannot_tell { self.share(|answer, _| answer.is_some_and(is_cannot_tell)) } else { None }
    }

    fn refused(&self) -> usize {
        self.grid
            .items
            .iter()
            .enumerate()
            .filter(|(_, item)| item.is_in_family(self.family))
            .filter_map(|(index, _)| self.grid.trial(self.subject, index))
            .filter(|trial| is_refused(*trial))
            .count()
    }
}

/// Counts of answers to one question of the bank, over the items with an answer at L0 and a reply in the condition.
#[derive(Debug, Clone, Default)]
pub(super) struct ItemAnswerCounts<'g> {
    /// Number of items.
    pub(super) items: usize,
    /// Number of items with an answer at L0 and in the condition, by answer. Unreadable replies are not counted.
    pub(super) answers: BTreeMap<&'g str, [usize; 2]>,
    /// Number of choices of the question.
    choices: usize,
}

/// Counts of the answers of a subject, for all clusters together and for each cluster.
pub(super) struct BankCounts<'g> {
    pub(super) whole: BTreeMap<usize, ItemAnswerCounts<'g>>,
    /// Counts by cluster and question.
    pub(super) by_cluster: BTreeMap<(u32, usize), ItemAnswerCounts<'g>>,
}

impl<'g> BankCounts<'g> {
    /// Counts the answers of a subject to questions of a family.
    pub(super) fn new(
        grid: &'g Grid<'_>,
        subject: usize,
        family: Option<&Family>,
        mode: ParsingMode,
        bank: &BankIndex<'_>,
    ) -> Self {
        let mut counts = Self { whole: BTreeMap::new(), by_cluster: BTreeMap::new() };
        for (index, item) in grid.items.iter().enumerate() {
            let result = grid.result(subject, index);
            let (Some(question), Some(reading)) = (bank.position(&item.asked.question), result.parsed(mode)) else {
                continue;
            };
            if !item.is_in_family(family) {
                continue;
            }
            let asked = item.asked;
            let answers =
                [asked.truth, reading.map(usize::from)].map(|index| asked.choices.get(index?).map(String::as_str));
            let whole = counts.whole.entry(question).or_default();
            let of_cluster = (item.cluster, question);
            let of_cluster = counts.by_cluster.entry(of_cluster).or_default();
            for counts in [whole, of_cluster] {
                counts.items += 1;
                counts.choices = asked.choices.len();
                for (side, answer) in answers.into_iter().enumerate() {
                    if let Some(answer) = answer {
                        counts.answers.entry(answer).or_default()[side] += 1;
                    }
                }
            }
        }
        counts
    }

    /// Number of items.
    pub(super) fn items(&self) -> usize {
        self.whole.values().map(|counts| counts.items).sum()
    }

    /// Entropy of the answers, averaged over the questions, from 0 to 1: at L0, and in the condition. `None` without an
    /// answer.
    pub(super) fn entropies(&self) -> [Option<f64>; 2] {
        [0, 1].map(|side| {
            let entropies: Vec<f64> = self
                .whole
                .values()
                .filter_map(|counts| entropy(counts.answers.values().map(|answers| answers[side]), counts.choices))
                .collect();
            (!entropies.is_empty()).then(|| entropies.iter().sum::<f64>() / entropies.len() as f64)
        })
    }
}

/// Expected agreement above which κ is undefined, because all answers agree by their frequencies alone.
const MAX_EXPECTED: f64 = 1.0 - 1e-9;

/// Estimates Cohen's κ (Cohen 1960, Educ. Psychol. Meas. 20:37) between the answers in a condition and those at L0. The
/// expected agreement is computed by question: e = (1/N) Σ_q Σ_k a_qk b_qk / n_q, for n_q items of question q, a_qk of
/// them with answer k at L0 and b_qk in the condition. Answer frequencies pooled over different questions would make e
/// too small and κ too large.
///
/// `None` if e is 1, so that only agreement is possible. The interval is that of the linearization of κ in the counts
/// of the clusters, with Student's quantile, as for two models
/// ([`clustered_kappa`](crate::comparisons::clustered_kappa)). `agreement` is the share of items that agree; without
/// any spread between clusters, the interval of κ follows from its interval.
pub(super) fn kappa(counts: &BankCounts<'_>, by_cluster: &[ClusterCount], agreement: Estimate) -> Option<Estimate> {
    let all = counts.items() as f64;
    let expected = counts.whole.values().map(expected).sum::<f64>() / all;
    if all == 0.0 || expected > MAX_EXPECTED {
        return None;
    }
    let observed = agreement.value;
    let scaled = |agreement: f64| (agreement - expected) / (1.0 - expected);
    let value = scaled(observed);
    let mut influences = vec![0.0; by_cluster.len()];
    for ((cluster, question), own) in &counts.by_cluster {
        let change = expected_change(&counts.whole[question], own) - expected * own.items as f64;
        influences[*cluster as usize] -= change / all * (1.0 - observed);
    }
    for (influence, count) in influences.iter_mut().zip(by_cluster) {
        let change = f64::from(count.right) - observed * f64::from(count.replies);
        *influence += change / all * (1.0 - expected);
        *influence /= (1.0 - expected) * (1.0 - expected);
    }
    let influences: Vec<f64> = influences
        .iter()
        .zip(by_cluster)
        .filter(|(_, count)| count.replies > 0)
        .map(|(influence, _)| *influence)
        .collect();
    let c = influences.len() as f64;
    let variance = c / (c - 1.0) * influences.iter().map(|x| x * x).sum::<f64>();
    let (low, high) = if variance > 1e-18 {
        let half = student(degrees_of_freedom(&influences)) * variance.sqrt();
        (value - half, value + half)
    } else {
        (scaled(agreement.low), scaled(agreement.high))
    };
    // A single cluster gives no information about the spread.
    let (low, high) = if low.is_finite() && high.is_finite() { (low, high) } else { (-1.0, 1.0) };
    Some(Estimate { value, low: low.max(-1.0).min(value), high: high.min(1.0).max(value), n: counts.items() })
}

/// Number of items of a question that are expected to agree by the answer frequencies.
fn expected(counts: &ItemAnswerCounts<'_>) -> f64 {
    counts.answers.values().map(|[light, here]| *light as f64 * *here as f64).sum::<f64>() / counts.items as f64
}

/// Derivative of the expected number of agreeing items of a question in the direction of the counts of a cluster.
fn expected_change(whole: &ItemAnswerCounts<'_>, own: &ItemAnswerCounts<'_>) -> f64 {
    let items = whole.items as f64;
    own.answers
        .iter()
        .map(|(answer, [light, here])| {
            let [whole_light, whole_here] = whole.answers[answer];
            whole_here as f64 * *light as f64 + whole_light as f64 * *here as f64
        })
        .sum::<f64>()
        / items
        - expected(whole) / items * own.items as f64
}
