//! Alerts about models that a router served by several providers: [`provider_alerts`].

use std::collections::BTreeMap;

use crate::report::text::alert::{Alert, AlertKind};
use crate::types::Trials;
use crate::types::text::plural;
use darkqa_score::answers::record::Detail;

/// One alert for each model whose replies name several providers, with the number of replies of each.
pub(super) fn provider_alerts<D: Detail>(trials: &Trials<D>) -> Vec<Alert> {
    let mut counts = BTreeMap::<&str, BTreeMap<&str, usize>>::new();
    for trial in trials.iter() {
        if let Some(provider) = trial.provider() {
            let of_model = counts.entry(trial.model()).or_default();
            *of_model.entry(provider).or_default() += 1;
        }
    }
    counts.iter().filter(|(_, providers)| providers.len() > 1).map(|(model, providers)| {
        let named: Vec<String> = providers
            .iter()
            .map(|(name, count)| format!("{name} ({})", plural(*count, "reply", "replies"))).collect();
        let text = format!(
            "{model} was served by {}: providers and quantisations are mixed. --extra-body with provider names one.",
            named.join(", ")
        );
        Alert::new(AlertKind::Served, text)
    }).collect()
}
