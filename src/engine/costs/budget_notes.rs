//! Notices about the upper bound that `--max-cost` is: [`BudgetNotes`].

use crate::ask::Spending;
use crate::engine::costs::budget::Budget;
use crate::engine::models::ModelUnderTest;

/// Notices about the limit of cost, each said once for each model.
#[derive(Debug)]
pub(crate) struct BudgetNotes<'a> {
    models: &'a [ModelUnderTest],
    /// Models for which the user knows that their replies have no bound.
    said: Vec<bool>,
}

impl<'a> BudgetNotes<'a> {
    pub(crate) fn new(models: &'a [ModelUnderTest]) -> Self {
        Self {
            models,
            said: vec![false; models.len()],
        }
    }

    /// Warns of models whose replies have no upper bound, if there is a limit.
    pub(crate) fn say_unlimited(&mut self, spending: &Spending) {
        if spending.limit().is_none() {
            return;
        }
        let models = self.models.iter().zip(&mut self.said);
        for (model, said) in models.filter(|(model, said)| is_unlimited(model) && !**said) {
            *said = true;
            tracing::warn!(
                "{}: no token limit holds for its replies and their thinking, so --max-cost is no upper bound: requests in flight may \
                 exceed it (remedies: --max-tokens with its field, --thinking off, or a thinking budget)",
                model.name
            );
        }
    }

    /// Warns if a reply was charged more tokens than its limit, or if a model has no limit any more, because its server refuses one.
    pub(crate) fn say_exceeded(&mut self, model: usize, budget: &Budget) {
        let spending = budget.spending();
        self.say_unlimited(spending);
        let excess = budget.excess(model);
        if self.said[model] || spending.limit().is_none() || excess.replies() == 0 {
            return;
        }
        self.said[model] = true;
        let model = &self.models[model];
        tracing::warn!(
            "{}: a reply was charged {} tokens, more than its limit of {}: the requests in flight may exceed --max-cost; from now on more \
             tokens are reserved for each reply",
            model.name,
            excess.longest(),
            model.model.reply_limit().unwrap_or_default()
        );
    }
}

/// Whether no limit holds for the replies of a model.
fn is_unlimited(model: &ModelUnderTest) -> bool {
    model.model.is_remote() && model.model.reply_limit().is_none()
}
