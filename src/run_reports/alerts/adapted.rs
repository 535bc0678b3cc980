//! Alerts about requests that were changed because a server refused or did not answer the first: [`adaptation_alerts`].

use serde_json::Value;

use crate::run_reports::join::JoinedRun;
use crate::run_reports::settings::joined_with_and;
use crate::runs::renamed::ADAPTED_FOR;
use crate::text::alert::{Alert, AlertKind};

/// One alert for each model whose requests were changed in a run.
pub(super) fn adaptation_alerts(runs: &[JoinedRun]) -> Vec<Alert> {
    let mut alerts = Vec::new();
    for run in runs {
        for (field, changes) in &run.manifest.settings {
            let Some(model) = field.strip_prefix(ADAPTED_FOR) else {
                continue;
            };
            let changes: Vec<&str> = changes
                .as_array()
                .into_iter()
                .flatten()
                .filter_map(Value::as_str)
                .collect();
            let place = match runs {
                [_] => String::new(),
                _ => format!(" in {}", run.name),
            };
            let text = format!(
                "Requests to {model} were changed{place}, because what was sent first was refused or not answered in time: {}.",
                joined_with_and(&changes)
            );
            alerts.push(Alert::new(AlertKind::Parameters, text));
        }
    }
    alerts
}
