//! Settings of models that changed within a run, and settings that a server refused, as the manifest states them.
//!
//! The column of a model and the keys of its trials keep the settings with which the run began.

use std::collections::BTreeMap;

use serde_json::Value;

use crate::ask::ChangedSetting;
use crate::types::manifests::RunManifest;

/// Prefix of the manifest settings that list the settings of a model that changed within the run; its name follows.
pub(crate) const CHANGED_FOR: &str = "changed for ";

/// Prefix of the manifest settings that list the flags of a model whose values a server refused; its name follows.
pub(crate) const REFUSED_FOR: &str = "refused for ";

/// Words before the name of a judge, whose settings differ from those of a model of the same name.
const JUDGE: &str = "the judge ";

/// Key of a manifest setting about a model or judge.
pub(crate) fn key(prefix: &str, model: &str, is_judge: bool) -> String {
    let judge = if is_judge { JUDGE } else { "" };
    format!("{prefix}{judge}{model}")
}

/// True if later commands must keep the manifest setting.
pub(crate) fn is_kept(key: &str) -> bool {
    [CHANGED_FOR, REFUSED_FOR].iter().any(|prefix| key.starts_with(prefix))
}

/// The strings in an array; none if the value is missing or not an array.
pub(crate) fn strings(value: Option<&Value>) -> Vec<String> {
    value.and_then(|value| serde_json::from_value(value.clone()).ok()).unwrap_or_default()
}

/// The changes in the value of a manifest setting with the prefix [`CHANGED_FOR`].
pub(crate) fn changes(value: Option<&Value>) -> Vec<ChangedSetting> {
    value.and_then(|value| serde_json::from_value(value.clone()).ok()).unwrap_or_default()
}

/// The changed settings of all models and judges of a run: the name, true for a judge, and the changes.
pub(crate) fn all(settings: &BTreeMap<String, Value>) -> impl Iterator<Item = (&str, bool, Vec<ChangedSetting>)> {
    settings.iter().filter_map(|(key, value)| {
        let owner = key.strip_prefix(CHANGED_FOR)?;
        let judge = owner.strip_prefix(JUDGE);
        Some((judge.unwrap_or(owner), judge.is_some(), changes(Some(value))))
    })
}

/// The current value of a model's setting, by its flag; `None` if it is unset.
pub(crate) fn current(manifest: &RunManifest, model: &str, flag: &str) -> Option<Value> {
    let changes = changes(manifest.settings.get(&key(CHANGED_FOR, model, false)));
    let changed = changes.into_iter().rfind(|change| change.flag == flag);
    let first = || manifest.columns.get("model")?.get(model)?.get(flag).cloned();
    changed.map_or_else(first, |change| Some(change.now)).filter(|value| !value.is_null())
}
