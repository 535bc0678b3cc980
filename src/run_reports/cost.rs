//! Cost of the trials of a run: [`cost_text`], [`PricedRun`].

use std::collections::HashMap;

use serde_json::Value;

use crate::ask::{Price, Prices};
use crate::error::Result;
use crate::report::forecast::money;
use crate::types::manifests::RunManifest;
use crate::types::text;
use crate::types::{TrialRef, Via};
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

    /// The cost of a trial; `None` if the price of its model is unknown. `model` is the name under which the run asked the model.
    pub(super) fn trial_cost<D: Detail>(
        &mut self,
        model: &str,
        trial: TrialRef<'_, D>,
    ) -> Option<TrialCost> {
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
        price.map(|price| TrialCost::new(price, self.prices.batch, trial))
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
#[derive(Debug, Clone, Copy)]
pub(super) struct TrialCost {
    /// Cost of the reply; `None` without a reply, or if the server did not report its tokens.
    pub(super) reply: Option<f64>,
    /// Cost of attempts without a usable reply; `None` if there were none.
    pub(super) lost: Option<f64>,
}

impl TrialCost {
    /// The cost of a trial at a price. `batch` is the price of a batch request as a fraction of the direct price.
    fn new<D: Detail>(price: Price, batch: f64, trial: TrialRef<'_, D>) -> Self {
        let share = match trial.via() {
            Via::Direct | Via::File => 1.0,
            Via::Batch => batch,
        };
        let lost = Some(trial.lost()).filter(|lost| !lost.is_none());
        let usage = trial.usage().filter(|_| trial.has_reply());
        Self {
            reply: usage.map(|usage| share * price.charged(usage)),
            lost: lost.map(|lost| share * price.charged(lost.usage)),
        }
    }
}

/// The price of a model of a run: from the run's models file, else from the price table by the name that the endpoint knows.
pub(crate) fn price(prices: &Prices, manifest: &RunManifest, model: &str) -> Option<Price> {
    stated_price(manifest, model).or_else(|| {
        let columns = manifest
            .columns
            .get("model")
            .and_then(|models| models.get(model));
        let id = columns.and_then(|content| content.get("--model")?.as_str());
        prices.find(id.unwrap_or(model))
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

/// The cost of a run's trials at the prices in its manifest, as text. Attempts without a usable reply are included. `None` if no model of
/// the run has a known price.
///
/// # Errors
/// If the prices in the manifest are invalid.
pub(super) fn cost_text<'t, D: Detail + 't>(
    trials: impl Iterator<Item = TrialRef<'t, D>>,
    manifest: &RunManifest,
) -> Result<Option<String>> {
    let mut run = PricedRun::new(manifest)?;
    let (mut dollars, mut counted, mut unknown) = (0.0, 0_usize, 0_usize);
    let (mut lost_dollars, mut attempts) = (0.0, 0_u32);
    for trial in trials.filter(|trial| trial.has_reply() || !trial.lost().is_none()) {
        let cost = run.trial_cost(trial.model(), trial);
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
        n => format!(
            "; {} without a known price or usage",
            text::plural(n, "reply", "replies")
        ),
    };
    let (source, all) = (run.source(), money(dollars + lost_dollars));
    Ok((counted > 0 || attempts > 0).then(|| format!("{all} at {source}{lost}{note}")))
}
