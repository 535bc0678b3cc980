//! Cost of the stored records of a run: [`StoredCosts`].

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::ask::{ChargeRatios, Price, TokenBound, stated_charge};
use crate::engine::costs::money::MoneySettings;
use crate::store::StoredTrial;
use crate::types::{Unstated, Usage, Via};

/// Cost of stored records in US dollars, and the charges that servers state in them.
#[derive(Debug, Default)]
pub(crate) struct StoredCosts {
    by_model: BTreeMap<String, ModelCosts>,
}

#[derive(Debug, Default)]
struct ModelCosts {
    charges: Arc<ChargeRatios>,
    /// Cost of the requests with stated tokens or a stated charge, in US dollars.
    known: f64,
    /// Number of requests without stated tokens, and the upper bound of their cost at the price table.
    unstated: (u32, f64),
    /// Number of replies that were charged more than the price table says.
    dearer: usize,
}

impl StoredCosts {
    /// Adds a record of a model with this price; without one, only stated charges count.
    pub(crate) fn add(&mut self, price: Option<Price>, money: &MoneySettings, record: &StoredTrial) {
        let lost = record.lost();
        let usages = [record.usage(), lost.map(|lost| lost.usage)];
        if price.is_none() && usages.iter().flatten().all(|usage| usage.cost.is_none()) {
            return;
        }
        let share = match record.via {
            Via::Direct | Via::File => 1.0,
            Via::Batch => money.prices.batch,
        };
        let model = self.by_model.entry(record.model.to_string()).or_default();
        for usage in usages.into_iter().flatten() {
            model.add(price, share, usage);
        }
        if let Some((price, lost)) = price.zip(lost) {
            let unstated = lost.unstated;
            let dollars = share * price.max_cost(bound(unstated));
            model.unstated.0 = model.unstated.0.saturating_add(unstated.requests);
            model.unstated.1 += dollars;
        }
    }

    /// Sum of all costs in US dollars.
    pub(crate) fn sum(&self) -> f64 {
        let known: f64 = self.by_model.values().map(|model| model.known).sum();
        known + self.unstated().1
    }

    /// Number of requests without stated tokens, and the upper bound of their cost in US dollars: as dear as the other
    /// requests.
    pub(crate) fn unstated(&self) -> (u32, f64) {
        self.by_model.values().fold((0, 0.0), |(count, sum), model| {
            let (requests, dollars) = model.unstated;
            let dollars = model.charges.factor() * dollars;
            (u32::saturating_add(count, requests), sum + dollars)
        })
    }

    /// Charges that the server of a model states.
    pub(crate) fn charges(&self, model: &str) -> Arc<ChargeRatios> {
        let costs = self.by_model.get(model);
        costs.map_or_else(Arc::default, |costs| Arc::clone(&costs.charges))
    }

    /// Number of replies by model that were charged more than the price table says; models without such replies are
    /// left out.
    pub(crate) fn dearer(&self) -> BTreeMap<String, usize> {
        let models = self.by_model.iter().filter(|(_, model)| model.dearer > 0);
        models.map(|(name, model)| (name.clone(), model.dearer)).collect()
    }
}

impl ModelCosts {
    /// Adds requests whose tokens cost a share of their price.
    fn add(&mut self, price: Option<Price>, share: f64, usage: Usage) {
        let Some(price) = price else {
            self.known += stated_charge(usage, 0.0).unwrap_or(0.0);
            return;
        };
        self.charges.record(price, usage, share);
        let charged = price.charged_in_part(usage, share);
        self.known += charged;
        self.dearer += usize::from(charged > DEARER * share * price.list_charge(usage));
    }
}

/// Ratio of a charge to the list price from which it counts as dearer; chosen: more than rounding.
const DEARER: f64 = 1.05;

fn bound(unstated: Unstated) -> TokenBound {
    TokenBound { prompt: unstated.prompt_tokens, reply: unstated.completion_tokens }
}
