//! Cost of the trials of a run: [`cost_text`], [`PricedRun`].

use std::collections::HashMap;

use serde_json::Value;

use darkqa_ask::{Price, Prices, stated_charge};
use darkqa_base::error::Result;
use darkqa_base::types::manifests::RunManifest;
use darkqa_base::types::text;
use darkqa_base::types::text::money;
use darkqa_base::types::{TrialRef, Usage, Via};
use darkqa_score::answers::record::Detail;

/// A run with the prices stored in its manifest.
pub(super) struct PricedRun<'m> {
    manifest: &'m RunManifest,
    prices: Prices,
    /// Prices found so far, by model; `None` for a model without a known price.
    by_model: HashMap<String, Option<Price>>,
    /// True if a model has a price in the models file.
    uses_models_file: bool,
    /// True if a model has its price from the price table.
    uses_table: bool,
}

impl<'m> PricedRun<'m> {
    /// Reads the prices of a run from its manifest.
    ///
    /// # Errors
    /// If the prices in the manifest are invalid.
    pub(super) fn new(manifest: &'m RunManifest) -> Result<Self> {
        Ok(Self {
            manifest,
            prices: Prices::from_settings(&manifest.settings)?,
            by_model: HashMap::new(),
            uses_models_file: false,
            uses_table: false,
        })
    }

    /// The cost of a trial; `None` if the price of its model is unknown. `model` is the name under which the run asked
    /// the model.
    pub(super) fn trial_cost<D: Detail>(&mut self, model: &str, trial: TrialRef<'_, D>) -> Option<TrialCost> {
        let price = if let Some(known) = self.by_model.get(model) {
            *known
        } else {
            let price = price(&self.prices, self.manifest, model);
            let is_stated = stated_price(self.manifest, model).is_some();
            self.uses_models_file |= is_stated;
            self.uses_table |= price.is_some() && !is_stated;
            self.by_model.insert(model.to_owned(), price);
            price
        };
        TrialCost::new(price, self.prices.batch, trial)
    }

    /// Source of the prices used so far, as a phrase that follows "at".
    fn source(&self) -> String {
        const MODELS_FILE: &str = "the prices of the models file";
        match (self.uses_models_file, self.uses_table) {
            (true, false) => MODELS_FILE.to_owned(),
            (true, true) => format!("{MODELS_FILE} and {}", self.prices.source()),
            (false, _) => self.prices.source(),
        }
    }
}

/// The cost of a trial, in US dollars.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct TrialCost {
    /// Cost of the reply; `None` without a reply, or if the server reports neither its tokens nor its charge.
    pub(super) reply: Option<f64>,
    /// Cost of attempts without a usable reply; `None` if there were none.
    pub(super) lost: Option<f64>,
    /// The part of both that the server states as its charge.
    stated: f64,
    /// The price of the tokens of this part by the price table; `None` if the price is unknown.
    listed: Option<f64>,
}

impl TrialCost {
    /// The cost of the reply and of attempts without a usable one; `None` if neither is known.
    pub(super) fn all(self) -> Option<f64> {
        match (self.reply, self.lost) {
            (None, None) => None,
            (reply, lost) => Some(reply.unwrap_or(0.0) + lost.unwrap_or(0.0)),
        }
    }

    /// The cost of a trial: as the server states it, else at a price. `batch` is the price of a batch request as a
    /// fraction of the direct price. `None` if neither is known.
    fn new<D: Detail>(price: Option<Price>, batch: f64, trial: TrialRef<'_, D>) -> Option<Self> {
        let share = match trial.via() {
            Via::Direct | Via::File => 1.0,
            Via::Batch => batch,
        };
        let mut cost = Self { listed: price.map(|_| 0.0), ..Self::default() };
        if let Some(usage) = trial.usage().filter(|_| trial.has_reply()) {
            cost.reply = cost.add(price, share, usage);
        }
        let lost = trial.lost();
        if !lost.is_none() {
            cost.lost = cost.add(price, share, lost.usage);
        }
        (price.is_some() || cost.reply.is_some() || cost.lost.is_some()).then_some(cost)
    }

    /// The cost of one usage; `None` if it is unknown.
    fn add(&mut self, price: Option<Price>, share: f64, usage: Usage) -> Option<f64> {
        let listed = price.map(|price| share * price.list_charge(usage));
        // Servers without prices of their own state 0.
        let stated = stated_charge(usage, listed.unwrap_or(0.0)).filter(|stated| price.is_some() || *stated > 0.0);
        let Some(stated) = stated else {
            return listed;
        };
        self.stated += stated;
        self.listed = self.listed.zip(listed).map(|(sum, listed)| sum + listed);
        Some(stated)
    }
}

/// The price of a model of a run: from the run's models file, else from the price table by the name that the endpoint
/// knows.
pub fn price(prices: &Prices, manifest: &RunManifest, model: &str) -> Option<Price> {
    stated_price(manifest, model).or_else(|| {
        let columns = manifest.columns.get("model").and_then(|models| models.get(model));
        let id = columns.and_then(|content| content.get("--model")?.as_str());
        let added = columns.and_then(|content| content.get("--extra-body")?.as_str());
        let added: Option<Value> = added.and_then(|json| serde_json::from_str(json).ok());
        let tier = added.as_ref().and_then(|added| added.get("service_tier")?.as_str());
        prices.price(id.unwrap_or(model), tier).ok()
    })
}

/// The price of a model in the run's models file.
fn stated_price(manifest: &RunManifest, model: &str) -> Option<Price> {
    let stated = manifest
        .settings
        .get("models")
        .and_then(Value::as_array)
        .into_iter()
        .flatten()
        .find(|entry| entry["name"] == *model);
    stated.and_then(|entry| serde_json::from_value(entry.get("price")?.clone()).ok())
}

/// The cost of a run's trials at the prices in its manifest, as text. Attempts without a usable reply are included.
/// `None` if no model of the run has a known price.
///
/// # Errors
/// If the prices in the manifest are invalid.
pub(super) fn cost_text<'t, D: Detail + 't>(
    trials: impl Iterator<Item = TrialRef<'t, D>>,
    manifest: &RunManifest,
) -> Result<Option<String>> {
    let mut run = PricedRun::new(manifest)?;
    let (mut stated, mut listed) = (0.0, Some(0.0));
    let (mut dollars, mut counted, mut unknown) = (0.0, 0_usize, 0_usize);
    let (mut lost_dollars, mut attempts) = (0.0, 0_u32);
    for trial in trials.filter(|trial| trial.has_reply() || !trial.lost().is_none()) {
        let cost = run.trial_cost(trial.model(), trial);
        if let Some(cost) = cost {
            stated += cost.stated;
            listed = listed.zip(cost.listed).map(|(sum, more)| sum + more);
        }
        match cost.and_then(|cost| cost.reply) {
            Some(reply) => {
                dollars += reply;
                counted += 1;
            }
            None => unknown += usize::from(trial.has_reply()),
        }
        if let Some(lost) = cost.and_then(|cost| cost.lost) {
            lost_dollars += lost;
            attempts = u32::saturating_add(attempts, trial.lost().attempts);
        }
    }
    let lost = match attempts {
        0 => String::new(),
        attempts => format!(
            ", {} of it for {} without a usable reply",
            money(lost_dollars),
            text::counted(attempts as usize, "attempt")
        ),
    };
    let note = match unknown {
        0 => String::new(),
        n => format!("; {} without a known price or usage", text::plural(n, "reply", "replies")),
    };
    let all = dollars + lost_dollars;
    let source = cost_source(all, stated, listed, &run.source());
    let all = money(all);
    Ok((counted > 0 || attempts > 0).then(|| format!("{all} {source}{lost}{note}")))
}

/// Source of a cost, of which the servers state a part; `listed` is the price of this part by the price table.
fn cost_source(all: f64, stated: f64, listed: Option<f64>, prices: &str) -> String {
    if stated <= 0.0 {
        return format!("at {prices}");
    }
    let is_all = all - stated <= ROUNDING * all;
    let part = if is_all {
        "as its replies state".to_owned()
    } else {
        format!("({} of it as its replies state, the rest at {prices})", money(stated))
    };
    match listed {
        Some(listed) if (stated - listed).abs() > TOLD_FROM * listed => {
            let those = if is_all { "" } else { " for these replies" };
            format!("{part}, against {}{those} at {prices}", money(listed))
        }
        _ => part,
    }
}

/// Share of a sum up to which a difference is a rounding error; chosen.
const ROUNDING: f64 = 1e-6;

/// Relative difference between stated charges and the price table from which both are printed; chosen, as during a run.
const TOLD_FROM: f64 = 0.05;
