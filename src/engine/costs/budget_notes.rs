//! Warnings about requests whose cost may exceed `--max-cost`: [`BudgetNotes`].

use crate::ask::Spending;
use crate::engine::costs::budget::Budget;
use crate::engine::costs::money::MoneySettings;
use crate::engine::models::ModelUnderTest;
use crate::types::text::money;

/// Warnings about `--max-cost`, at most one for each model.
#[derive(Debug)]
pub(crate) struct BudgetNotes<'a> {
    models: &'a [ModelUnderTest],
    /// True for models that the user was warned about.
    has_warned: Vec<bool>,
    /// True for models whose stated charges the user was told about, by kind of notice.
    has_told_charges: Vec<[bool; 3]>,
}

impl<'a> BudgetNotes<'a> {
    pub(crate) fn new(models: &'a [ModelUnderTest]) -> Self {
        Self { models, has_warned: vec![false; models.len()], has_told_charges: vec![[false; 3]; models.len()] }
    }

    /// Names models whose price is unknown although the table has a similar one: another version or service tier.
    pub(crate) fn warn_unpriced(&self, settings: &MoneySettings) {
        for model in self.models {
            if let Some(reason) = Budget::unpriced(settings, model) {
                tracing::warn!("{}: its cost is not known: {reason}", model.name);
            }
        }
    }

    /// Says once for each model that its server states other charges than the price table, charges that are no
    /// plausible price, or a service tier without a price.
    pub(crate) fn warn_of_charges(&mut self, model: usize, budget: &Budget) {
        let charges = budget.charges(model);
        let name = &self.models[model].name;
        let [differing, implausible, tier] = &mut self.has_told_charges[model];
        if let Some(pair) = charges.differing().filter(|_| !*differing) {
            *differing = true;
            tracing::warn!(
                "{name}: a reply is charged {}, as its server states, where the price table gives {}: the stated charges count, and each \
                 request reserves as much more",
                dollars(pair.stated),
                dollars(pair.listed)
            );
        }
        if let Some(pair) = charges.implausible().filter(|_| !*implausible) {
            *implausible = true;
            tracing::warn!(
                "{name}: a reply states a charge of ${}, where the price table gives {}: more than 100 times off is no plausible price in \
                 US dollars, so the price table counts (--prices FILE has your own)",
                pair.stated,
                dollars(pair.listed)
            );
        }
        if charges.has_unknown_tier() && !*tier {
            *tier = true;
            tracing::warn!(
                "{name}: a reply is at a service tier without a price in the table, and counts at the price of the tier asked for; its \
                 factor belongs in [tiers.NAME] of your own table (--prices FILE)"
            );
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

    /// Warns if a reply was charged more tokens than its limit, or if models have no limit any more because their
    /// server refuses one.
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

/// A small sum of money, with three significant digits.
fn dollars(sum: f64) -> String {
    if sum <= 0.0 || sum >= 0.01 {
        return money(sum);
    }
    let decimals = 2 - sum.log10().floor() as i32;
    format!("${sum:.0$}", decimals.clamp(4, 12) as usize)
}
