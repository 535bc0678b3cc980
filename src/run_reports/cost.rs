//! The cost of the replies of a run: [`cost`], [`dollars`].

use std::collections::HashMap;

use serde_json::Value;

use crate::ask::{Price, Prices};
use crate::error::Result;
use crate::report::forecast::money;
use crate::score::record::Detail;
use crate::types::manifest::RunManifest;
use crate::types::{TrialRef, Via};

/// The cost of replies of a model at list prices, in US dollars; `None` if the model has no known price or no reply says its tokens.
pub(super) fn dollars<'t, D: Detail + 't>(
    model: &str,
    trials: impl Iterator<Item = TrialRef<'t, D>>,
) -> Result<Option<f64>> {
    let prices = Prices::built_in()?;
    let replies = trials.filter(|trial| trial.has_reply());
    let charged = replies.filter_map(|trial| charged(&prices, model, trial));
    let charged: Vec<f64> = charged.collect();
    Ok((!charged.is_empty()).then(|| charged.iter().sum()))
}

/// The cost of a reply; `None` if it is not known.
fn charged<D: Detail>(prices: &Prices, model: &str, trial: TrialRef<'_, D>) -> Option<f64> {
    charged_at(prices.of(model)?, prices.batch, trial)
}

/// The cost of a reply at this price; `batch` is the share of it that a batch costs.
fn charged_at<D: Detail>(price: Price, batch: f64, trial: TrialRef<'_, D>) -> Option<f64> {
    let share = match trial.via() {
        Via::Direct | Via::File => 1.0,
        Via::Batch => batch,
    };
    Some(share * price.charged(trial.usage()?))
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

/// The cost of a run's replies at list prices, as text; `None` if no model of the run has a known price.
pub(super) fn cost<'t, D: Detail + 't>(
    trials: impl Iterator<Item = TrialRef<'t, D>>,
    manifest: &RunManifest,
) -> Result<Option<String>> {
    let prices = Prices::built_in()?;
    let (mut dollars, mut counted, mut unknown) = (0.0, 0_usize, 0_usize);
    let mut by_model = HashMap::new();
    for trial in trials.filter(|trial| trial.has_reply()) {
        let model = trial.model();
        let price = by_model
            .entry(model)
            .or_insert_with(|| price(&prices, manifest, model));
        match price.and_then(|price| charged_at(price, prices.batch, trial)) {
            Some(cost) => {
                dollars += cost;
                counted += 1;
            }
            None => unknown += 1,
        }
    }
    let note = match unknown {
        0 => String::new(),
        n => format!("; {n} replies without a known price or usage"),
    };
    let date = &prices.as_of;
    Ok((counted > 0).then(|| format!("{} at the list prices of {date}{note}", money(dollars))))
}
