//! The cost of the replies of a run: [`cost`], [`dollars`].

use std::collections::HashMap;

use serde_json::Value;

use crate::ask::{Price, Prices};
use crate::error::Result;
use crate::report::forecast::money;
use crate::text::words;
use crate::types::manifest::RunManifest;
use crate::types::{TrialRef, Via};
use darkqa_score::record::Detail;

/// The cost of a model's trials in US dollars, attempts without a reply included, at the prices of the first of these runs that knows the model;
/// `None` if none does, or no reply states its tokens.
///
/// # Errors
/// If the prices in a manifest are broken.
pub(super) fn dollars<'m, 't, D: Detail + 't>(
    runs: impl IntoIterator<Item = &'m RunManifest>,
    model: &str,
    trials: impl Iterator<Item = TrialRef<'t, D>>,
) -> Result<Option<f64>> {
    for manifest in runs {
        let prices = Prices::of_settings(&manifest.settings)?;
        if let Some(price) = price(&prices, manifest, model) {
            let charged = trials.flat_map(|trial| {
                let charged = Charged::new(price, prices.batch, trial);
                [charged.reply, charged.lost]
            });
            let charged: Vec<f64> = charged.flatten().collect();
            return Ok((!charged.is_empty()).then(|| charged.iter().sum()));
        }
    }
    Ok(None)
}

/// The cost of a trial, in US dollars.
#[derive(Debug, Clone, Copy)]
struct Charged {
    /// `None` without a reply, or if the server did not state its tokens.
    reply: Option<f64>,
    /// The cost of attempts without a usable reply; `None` if there are none.
    lost: Option<f64>,
}

impl Charged {
    /// The cost at a price; `batch` is the share of it that a batch costs.
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

/// The price of a model of a run: the one that its file of models states, else that of the table by the name that the endpoint knows.
pub(crate) fn price(prices: &Prices, manifest: &RunManifest, model: &str) -> Option<Price> {
    let mut stated = manifest
        .settings
        .get("models")
        .and_then(Value::as_array)
        .into_iter()
        .flatten();
    let stated = stated.find(|entry| entry["name"] == *model);
    let stated = stated.and_then(|entry| serde_json::from_value(entry.get("price")?.clone()).ok());
    let columns = manifest
        .columns
        .get("model")
        .and_then(|models| models.get(model));
    let id = columns.and_then(|content| content.get("--model")?.as_str());
    stated.or_else(|| prices.of(id.unwrap_or(model)))
}

/// The cost of a run's replies at the prices that the run had, as text, attempts without a usable reply included; `None` if no model of the run has a known
/// price.
pub(super) fn cost<'t, D: Detail + 't>(
    trials: impl Iterator<Item = TrialRef<'t, D>>,
    manifest: &RunManifest,
) -> Result<Option<String>> {
    let prices = Prices::of_settings(&manifest.settings)?;
    let (mut dollars, mut counted, mut unknown) = (0.0, 0_usize, 0_usize);
    let (mut lost_dollars, mut attempts) = (0.0, 0_u32);
    let mut by_model = HashMap::new();
    for trial in trials.filter(|trial| trial.has_reply() || !trial.lost().is_none()) {
        let model = trial.model();
        let price = by_model
            .entry(model)
            .or_insert_with(|| price(&prices, manifest, model));
        let charged = price.map(|price| Charged::new(price, prices.batch, trial));
        match charged.and_then(|charged| charged.reply) {
            Some(cost) => {
                dollars += cost;
                counted += 1;
            }
            None => unknown += usize::from(trial.has_reply()),
        }
        if let Some(lost) = charged.and_then(|charged| charged.lost) {
            lost_dollars += lost;
            attempts += trial.lost().attempts;
        }
    }
    let lost = match attempts {
        0 => String::new(),
        attempts => format!(
            ", {} of it for {} without a usable reply",
            money(lost_dollars),
            words::counted(attempts as usize, "attempt")
        ),
    };
    let note = match unknown {
        0 => String::new(),
        n => format!("; {n} replies without a known price or usage"),
    };
    let (source, all) = (prices.source(), money(dollars + lost_dollars));
    Ok((counted > 0 || attempts > 0).then(|| format!("{all} at {source}{lost}{note}")))
}
