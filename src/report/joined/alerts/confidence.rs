//! Alerts about models whose replies lack the requested probabilities: [`confidence_alerts`].

use std::collections::{BTreeMap, BTreeSet};

use serde_json::Value;

use crate::report::joined::join::JoinedRun;
use crate::report::text::alert::{Alert, AlertKind};
use crate::types::{ChoiceDetail, TrialRef, Trials};

/// One alert for each model that was asked with `--request probabilities` and none of whose replies has probabilities.
pub(super) fn confidence_alerts(runs: &[JoinedRun], trials: &Trials<ChoiceDetail>) -> Vec<Alert> {
    let asked: BTreeSet<&String> = runs
        .iter()
        .filter_map(|run| run.manifest.columns.get("model"))
        .flat_map(BTreeMap::iter)
        .filter(|(_, content)| content["--probabilities"] == Value::Bool(true))
        .map(|(name, _)| name)
        .collect();
    let stated: BTreeSet<&str> = trials.iter().filter(|trial| trial.options().is_some()).map(TrialRef::model).collect();
    let replied: BTreeSet<&str> = trials.iter().filter(|trial| !trial.failed()).map(TrialRef::model).collect();
    asked
        .into_iter()
        .filter(|name| replied.contains(&***name) && !stated.contains(&***name)).map(|name| {
        let text = format!(
            "The confidence of {name} is not available: its server states no probabilities of tokens, or its replies do not begin \
             with a choice."
        );
        Alert::new(AlertKind::Parameters, text)
    }).collect()
}
