//! Agreement of one subject with the answers of its model at L0: [`AgreementCell`].

use std::collections::BTreeSet;

use super::bank_index::BankIndex;
use super::counts::BankCounts;
use super::evidence::{Bounds, NoEvidence, evidence};
use super::kappa::kappa;
use super::light::{is_cannot_tell, is_refused};
use super::question_in_light::QuestionInLight;
use crate::bootstrap::Resamples;
use crate::choice::ParsingMode;
use crate::estimate::ClusterCount;
use crate::estimate::Estimate;
use crate::grid::Grid;
use crate::model_in_condition::ModelInCondition;
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
            let Some(reading) = result.reading(self.mode) else {
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
