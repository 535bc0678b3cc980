//! How far two models agree with each other in the light: [`ModelsInLight`].

use super::bank_index::BankIndex;
use super::counts::BankCounts;
use super::kappa::kappa;
use super::light::LightAnswers;
use crate::choice::ReadingMode;
use crate::cluster::Clusters;
use crate::estimate::Estimate;
use crate::grid::Grid;
use darkqa_ground::types::{ChoiceDetail, Trials};

/// Agreement of two models at L0, in the strict parsing, on the items that both answered readably. Each model has its own reference, so
/// that their agreements with themselves in the dark compare only as far as they agree here.
#[derive(Debug, Clone, PartialEq)]
pub struct ModelsInLight {
    pub first: String,
    pub second: String,
    /// Share of the items with the same answer.
    pub same: Estimate,
    /// κ with the expected agreement by question; `None` if it is not defined.
    pub kappa: Option<Estimate>,
}

/// Every pair of models that answered the same items in the light.
pub(super) fn models_in_light(
    trials: &Trials<ChoiceDetail>,
    clusters: &Clusters,
    models: &[String],
    bank: &BankIndex<'_>,
) -> Vec<ModelsInLight> {
    let mode = ReadingMode::Strict;
    let mut pairs = Vec::new();
    for (place, first) in models.iter().enumerate() {
        let answers = LightAnswers::new(trials, first);
        for second in &models[place + 1..] {
            let held = answers.held_against_other(trials, second, mode);
            let grid = Grid::new(&held, clusters);
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
