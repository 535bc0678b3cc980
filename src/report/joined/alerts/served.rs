//! Alerts about the model names in replies: [`served_alerts`].

use std::collections::{BTreeMap, BTreeSet};

use crate::report::joined::join::{Joined, JoinedRun};
use crate::report::joined::settings::{has_human_answers, joined_with_and};
use crate::report::text::alert::{Alert, AlertKind};
use crate::types::text::model_names::{is_other_model, is_same_name};
use crate::types::text::plural;
use darkqa_score::answers::record::Detail;
use darkqa_score::model_in_condition::without_run;

/// Alerts about models with several names in the replies of one run, with the number of replies of each name at each
/// level, and about models whose only name is evidently that of another model.
pub(super) fn served_alerts<D: Detail>(joined: &Joined<D>) -> Vec<Alert> {
    let mut served = BTreeMap::<&str, BTreeSet<&str>>::new();
    let mut mixed = BTreeSet::new();
    for run in joined.runs.iter().filter(|run| !has_human_answers(&run.manifest)) {
        for (model, names) in &run.served {
            served.entry(model).or_default().extend(names.iter().map(String::as_str));
            if has_several(names) {
                mixed.insert(without_run(model));
            }
        }
    }
    let other = served.iter().filter_map(|(model, names)| {
        let [name] = *names.iter().copied().collect::<Vec<_>>().as_slice() else {
            return None;
        };
        is_other_model(asked_id(&joined.runs, model), name).then(|| {
            format!("Replies of {model} name another model: {name}. Check which model the server has loaded, or serves under this name.")
        })
    });
    let mixed = mixed_names(joined, &mixed);
    other.chain(mixed).map(|text| Alert::new(AlertKind::Served, text)).collect()
}

/// True if names differ in more than case and path.
pub(super) fn has_several(names: &BTreeSet<String>) -> bool {
    names.first().is_some_and(|first| names.iter().any(|name| !is_same_name(first, name)))
}

/// The id of a model at its endpoint, or its name in tables if no run states it.
fn asked_id<'a>(runs: &'a [JoinedRun], model: &'a str) -> &'a str {
    runs.iter()
        .find_map(|run| {
            let models = run.manifest.columns.get("model")?;
            models.get(without_run(model))?.get("--model")?.as_str()
        })
        .unwrap_or(model)
}

/// One sentence for each of these models, with the number of replies of each name at each level.
fn mixed_names<D: Detail>(joined: &Joined<D>, models: &BTreeSet<&str>) -> Vec<String> {
    let mut counts = BTreeMap::<&str, BTreeMap<&str, BTreeMap<String, usize>>>::new();
    for trial in joined.trials.iter() {
        let Some(name) = trial.served_model().filter(|_| models.contains(without_run(trial.model()))) else {
            continue;
        };
        let level =
            trial.condition().map_or_else(|| "without images".to_owned(), |condition| format!("at {condition}"));
        let levels = counts.entry(trial.model()).or_default().entry(name).or_default();
        *levels.entry(level).or_default() += 1;
    }
    counts
        .iter()
        .filter(|(_, names)| names.len() > 1)
        .map(|(model, names)| {
            let names: Vec<String> = names
                .iter()
                .map(|(name, levels)| {
                    let levels: Vec<String> = levels
                        .iter()
                        .map(|(level, count)| format!("{count} {level}"))
                        .collect();
                    format!("{name} ({})", levels.join(", "))
                })
                .collect();
            format!(
                "{model} was served as {}: {} in one column are no comparison of light. A --model with a date or version, or a gateway \
                 without fallbacks, keeps one.",
                joined_with_and(&names),
                plural(names.len(), "model", "models")
            )
        })
        .collect()
}
