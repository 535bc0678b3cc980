//! Agreement of two models at L0: [`ModelsInLight`].

use super::bank_index::BankIndex;
use super::cell::{BankCounts, kappa};
use super::light::LightAnswers;
use crate::choice::ParsingMode;
use crate::cluster::Clusters;
use crate::estimate::Estimate;
use crate::grid::Grid;
use darkqa_base::types::{ChoiceDetail, Trials};

/// Agreement of two models at L0, in the strict parsing, on the items to which both gave a readable answer. Each model
/// has its own reference, so the agreements of the models with themselves in the dark are comparable only as far as the
/// models agree here.
#[derive(Debug, Clone, PartialEq)]
pub struct ModelsInLight {
    pub first: String,
    pub second: String,
    /// Share of the items with the same answer.
    pub same: Estimate,
    /// κ with the expected agreement by question; `None` if it is not defined.
    pub kappa: Option<Estimate>,
}

/// Computes the agreement of every pair of models that answered the same items at L0.
pub(super) fn models_in_light(
    trials: &Trials<ChoiceDetail>,
    clusters: &Clusters,
    models: &[String],
    bank: &BankIndex<'_>,
) -> Vec<ModelsInLight> {
    let mode = ParsingMode::Strict;
    let mut pairs = Vec::new();
    for (index, first) in models.iter().enumerate() {
        let answers = LightAnswers::new(trials, first);
        for second in &models[index + 1..] {
            let scored = answers.scored_against_other(trials, second, mode);
            let grid = Grid::new(&scored, clusters);
            if grid.subjects.is_empty() {
                continue;
            }
            let counts = grid.counts(0, None, mode);
            if let Some(same) = Estimate::clustered(&counts) {
                let answers = BankCounts::new(&grid, 0, None, mode, bank);
                pairs.push(ModelsInLight {
                    first: first.clone(),
                    second: second.clone(),
                    same,
                    kappa: kappa(&answers, &counts, same),
                });
            }
        }
    }
    pairs
}
