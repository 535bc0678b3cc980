//! Alerts about requests that were changed because a server refused or did not answer the first, by the program
//! ([`adaptation_alerts`]) and by the user ([`change_alerts`]).

use serde_json::Value;

use crate::ask::ChangedSetting;
use crate::report::joined::join::JoinedRun;
use crate::report::joined::settings::joined_with_and;
use crate::report::text::alert::{Alert, AlertKind};
use crate::runs::changed_settings;
use crate::runs::renamed::ADAPTED_FOR;
use crate::types::flags::setting_spelling;
use crate::types::manifests::judge_flag;
use crate::types::text::plural;

/// One alert for each model whose requests were changed in a run.
pub(super) fn adaptation_alerts(runs: &[JoinedRun]) -> Vec<Alert> {
    let mut alerts = Vec::new();
    for run in runs {
        for (field, changes) in &run.manifest.settings {
            let Some(model) = field.strip_prefix(ADAPTED_FOR) else {
                continue;
            };
            let changes: Vec<&str> = changes.as_array().into_iter().flatten().filter_map(Value::as_str).collect();
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

/// One alert for each setting of a model or judge that changed within a run. Token limits are in the records, whose
/// alert names them.
pub(super) fn change_alerts(runs: &[JoinedRun]) -> Vec<Alert> {
    let mut alerts = Vec::new();
    for run in runs {
        let place = match runs {
            [_] => String::new(),
            _ => format!(" in {}", run.name),
        };
        for (model, is_judge, changes) in changed_settings::all(&run.manifest.settings) {
            for change in changes {
                if change.flag == "--max-tokens" && !change.now.is_null() {
                    continue;
                }
                let text = change_sentence(model, is_judge, &place, &change);
                alerts.push(Alert::new(AlertKind::Parameters, text));
            }
        }
    }
    alerts
}

/// Sentence about a setting that changed within a run.
fn change_sentence(model: &str, is_judge: bool, place: &str, change: &ChangedSetting) -> String {
    let ChangedSetting { flag, first, now, after } = change;
    let (judge, flag) = if is_judge { ("the judge ", judge_flag(flag)) } else { ("", flag.clone()) };
    let flag = setting_spelling(&flag);
    let [first, now] = [first, now].map(value_words);
    if *after == 0 {
        return format!("The {flag} of {judge}{model} is {now} in all replies{place}; the run began with {first}.");
    }
    format!(
        "The {flag} of {judge}{model} has two values{place}, because the server refused the first: {first} in {}, then {now}.",
        plural(*after, "reply", "replies")
    )
}

/// A value of a setting in words.
fn value_words(value: &Value) -> String {
    match value {
        Value::Null => "unset".to_owned(),
        Value::String(text) => text.clone(),
        other => other.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn changes_are_sentences() {
        let change =
            |after| ChangedSetting { flag: "--temperature".into(), first: json!("auto"), now: json!("default"), after };
        assert_eq!(
            change_sentence("m", false, "", &change(5)),
            "The --temperature of m has two values, because the server refused the first: auto in 5 replies, then default."
        );
        assert_eq!(
            change_sentence("j", true, " in b", &change(0)),
            "The --judge-temperature of the judge j is default in all replies in b; the run began with auto."
        );
    }
}
