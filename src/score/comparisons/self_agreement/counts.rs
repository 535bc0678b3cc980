//! Counts of answers at L0 and in a condition, by question of the bank: [`BankCounts`].

use std::collections::BTreeMap;

use super::bank_index::BankIndex;
use super::question_in_light::entropy;
use crate::choice::ParsingMode;
use crate::grid::Grid;
use darkqa_base::types::Family;

/// Counts of answers to one question of the bank, over the items with an answer at L0 and a reply in the condition.
#[derive(Debug, Clone, Default)]
pub(super) struct AnswerCounts<'g> {
    /// Number of items.
    pub(super) items: usize,
    /// Number of items with an answer at L0 and in the condition, by answer. Unreadable replies are not counted.
    pub(super) answers: BTreeMap<&'g str, [usize; 2]>,
    /// Number of choices of the question.
    choices: usize,
}

/// Counts of the answers of a subject, for all clusters together and for each cluster.
pub(super) struct BankCounts<'g> {
    pub(super) whole: BTreeMap<usize, AnswerCounts<'g>>,
    /// Counts by cluster and question.
    pub(super) by_cluster: BTreeMap<(u32, usize), AnswerCounts<'g>>,
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
            let (Some(question), Some(reading)) = (bank.position(&item.asked.question), result.reading(mode)) else {
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
