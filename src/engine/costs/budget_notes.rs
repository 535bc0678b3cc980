//! Warnings about requests whose cost may exceed `--max-cost`: [`BudgetNotes`].

use crate::ask::Spending;
use crate::engine::costs::budget::Budget;
use crate::engine::models::ModelUnderTest;

/// Warnings about `--max-cost`, at most one for each model.
#[derive(Debug)]
pub(crate) struct BudgetNotes<'a> {
    models: &'a [ModelUnderTest],
    /// True for models that the user was warned about.
    has_warned: Vec<bool>,
}

impl<'a> BudgetNotes<'a> {
    pub(crate) fn new(models: &'a [ModelUnderTest]) -> Self {
        Self {
            models,
            has_warned: vec![false; models.len()],
        }
    }

    /// Warns of models whose replies have no upper bound, if `--max-cost` is set.
    pub(crate) fn warn_unlimited(&mut self, spending: &Spending) {
        if spending.limit().is_none() {
            return;
        }
        for (model, has_warned) in self.models.iter().zip(&mut self.has_warned) {
            if *has_warned || !is_unlimited(model) {
                continue;
            }
            *has_warned = true;
            tracing::warn!(
                "{}: no token limit holds for its replies and their thinking, so --max-cost is no upper bound: requests in flight may \
                 exceed it (remedies: --max-tokens with its field, --thinking off, or a thinking budget)",
                model.name
            );
        }
    }

    /// Warns if a reply was charged more tokens than its limit, or if models have no limit any more because their server refuses one.
    pub(crate) fn warn_exceeded(&mut self, model: usize, budget: &Budget) {
        let spending = budget.spending();
        self.warn_unlimited(spending);
        let excess = budget.excess(model);
        if self.has_warned[model] || spending.limit().is_none() || excess.replies() == 0 {
            return;
        }
        self.has_warned[model] = true;
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

/// True if the replies of a model at an endpoint have no token limit.
fn is_unlimited(model: &ModelUnderTest) -> bool {
    model.model.is_remote() && model.model.reply_limit().is_none()
}
