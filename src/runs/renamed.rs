//! Models of a run that were renamed, have other settings under their name, or are no longer asked:
//! [`note_renamed_models`], [`rename_record`].
//!
//! The key of a trial does not contain the model's name, so a renamed model keeps its replies. Records keep the name
//! that they were written with, and are shown under the current one ([`RecordedNames`]).
//!
//! Settings of models that changed within a run, and settings that a server refused, as the manifest states them.
//!
//! The column of a model and the keys of its trials keep the settings with which the run began.

use std::collections::{BTreeMap, BTreeSet};

use serde_json::{Value, json};

use darkqa_ask::ChangedSetting;
use darkqa_base::error::Result;
use darkqa_base::types::manifests::{Fit, RecordedNames, RunManifest, StoredViews, Views};
use darkqa_base::types::replies::OBSERVER;
use darkqa_base::types::{Control, Digest, Record, Trials};
use darkqa_score::answers::record::Detail;

/// Prefix of the manifest settings that hold the changes to the requests to a model; the model's name follows.
pub const ADAPTED_FOR: &str = "adapted for ";

/// Manifest setting that lists the models that are no longer in the models file.
const LEFT_OUT: &str = "models left out";

/// Whether the settings of a model may change within a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SettingsChange {
    /// A model with other settings is another model of the same run; used with a models file, which names each model.
    Allowed,
    /// A model with other settings belongs to another run.
    Refused,
}

/// Models of the current command.
#[derive(Debug, Clone, Copy)]
pub struct CurrentModels<'a> {
    /// Settings that determine the replies of each model, by name.
    pub models: &'a BTreeMap<String, Value>,
    /// Inputs of each model, by name.
    pub views: &'a Views,
    /// Whether the settings of the stored models may change.
    pub settings: SettingsChange,
}

/// Notes in a manifest which models of the stored manifest have another name now. Two names belong to the same model if
/// all settings that determine its replies are equal, and both get images or neither does. A model whose name another
/// model has taken becomes `NAME (before)`.
///
/// # Errors
/// If a number in the settings of a model is not finite.
pub fn note_renamed_models(manifest: &mut RunManifest, stored: &RunManifest, command: CurrentModels<'_>) -> Result<()> {
    let CurrentModels { models: now, settings, .. } = command;
    let empty = BTreeMap::new();
    let before = stored.columns.get("model").unwrap_or(&empty);
    let stored_views = StoredViews::from_manifest(stored);
    let new_names = new_names(before, &stored_views, command);
    let mut names = RecordedNames::from_manifest(stored);
    names.rename(&new_names);
    for (name, content) in now {
        let digest = Digest::canonical("darkqa.model-name/1", &reply_settings(content))?.to_string();
        names.ensure(name, || format!("{name} [{}]", &digest[..8]));
    }
    names.write_to(manifest);
    let new_name = |name: &String| new_names.get(name).unwrap_or(name).clone();
    for model in &mut manifest.models {
        // Names in the models file are already current.
        if !now.contains_key(&model.name) {
            model.name = new_name(&model.name);
        }
    }
    if let Some(models) = manifest.columns.get_mut("model") {
        *models = before.iter().map(|(name, content)| (new_name(name), content.clone())).chain(now.clone()).collect();
    }
    // Two models may have swapped names: remove all old entries before inserting new ones.
    for key in new_names.keys().flat_map(|name| model_keys(name)) {
        if stored.settings.contains_key(&key) {
            manifest.settings.remove(&key);
        }
    }
    for (name, new) in &new_names {
        for (key, new_key) in model_keys(name).into_iter().zip(model_keys(new)) {
            if let Some(note) = stored.settings.get(&key) {
                manifest.settings.insert(new_key, note.clone());
            }
        }
    }
    if settings == SettingsChange::Allowed || stored_views.is_complete() {
        let stored_names = before.keys().map(|name| (name, new_name(name)));
        stored_views.write_to(manifest, stored_names, command.views);
    }
    let left_out = left_out(manifest, stored, now, &new_names, settings);
    if left_out.is_empty() {
        manifest.settings.remove(LEFT_OUT);
    } else {
        manifest.settings.insert(LEFT_OUT.to_owned(), json!(left_out));
    }
    Ok(())
}

/// Keys of the manifest settings about a model.
fn model_keys(name: &str) -> [String; 3] {
    [ADAPTED_FOR, CHANGED_FOR, REFUSED_FOR].map(|prefix| format!("{prefix}{name}"))
}

/// New name of each renamed model.
fn new_names(
    before: &BTreeMap<String, Value>,
    views: &StoredViews,
    command: CurrentModels<'_>,
) -> BTreeMap<String, String> {
    let CurrentModels { models: now, settings, .. } = command;
    // How well a stored model matches a current one; `None` if they are different models.
    let fit = |old: &String, new: &String| {
        let is_same = reply_settings(before.get(old)?) == reply_settings(now.get(new)?);
        let fit = views.compare(old, command.views.get(new)?);
        (is_same && fit > Fit::Disjoint).then_some(fit)
    };
    let keeps_name = |name: &String| match (before.get(name), now.get(name)) {
        // A model that gets other inputs now keeps its name, unless the name fits another stored model.
        (Some(old), Some(new)) => {
            reply_settings(old) == reply_settings(new)
                && (fit(name, name).is_some() || !before.keys().any(|old| fit(old, name).is_some()))
        }
        _ => false,
    };
    let mut new_names: BTreeMap<String, String> = BTreeMap::new();
    let mut taken = BTreeSet::new();
    // Take the best fits first.
    for min_fit in [Fit::Equal, Fit::Overlapping, Fit::Unknown] {
        for new in now.keys().filter(|new| !keeps_name(new)) {
            if taken.contains(new) {
                continue;
            }
            let renamed = before.keys().find(|old| {
                let is_free = !new_names.contains_key(*old) && !keeps_name(old);
                *old != new && is_free && fit(old, new) >= Some(min_fit)
            });
            if let Some(old) = renamed {
                new_names.insert(old.clone(), new.clone());
                taken.insert(new.clone());
            }
        }
    }
    if settings == SettingsChange::Refused {
        return new_names;
    }
    // Rename stored models whose name another model has now.
    for name in now.keys().filter(|name| before.contains_key(*name) && !keeps_name(name)) {
        if new_names.contains_key(name) {
            continue;
        }
        let free_name = std::iter::once(format!("{name} (before)"))
            .chain((2..=before.len() + now.len() + 2).map(|n| format!("{name} (before {n})")))
            .find(|candidate| {
                let is_kept = before.contains_key(candidate) && !new_names.contains_key(candidate);
                !is_kept && !now.contains_key(candidate) && !new_names.values().any(|new| new == candidate)
            });
        if let Some(new) = free_name {
            new_names.insert(name.clone(), new);
        }
    }
    new_names
}

/// Models that this command neither asks nor lists. Without a models file, only those that were left out before.
fn left_out(
    manifest: &RunManifest,
    stored: &RunManifest,
    now: &BTreeMap<String, Value>,
    new_names: &BTreeMap<String, String>,
    settings: SettingsChange,
) -> BTreeSet<String> {
    let left_out_before: BTreeSet<String> = left_out_models(stored)
        .iter()
        .map(|name| new_names.get(name).unwrap_or(name).clone())
        .chain(new_names.values().cloned())
        .collect();
    let has = |name: &str| now.contains_key(name) || manifest.models.iter().any(|model| model.name == name);
    manifest
        .columns
        .get("model")
        .into_iter()
        .flatten()
        .map(|(name, _)| name)
        .filter(|name| settings == SettingsChange::Allowed || left_out_before.contains(*name))
        .filter(|name| {
            // Controls are asked together with the observer.
            let asked = Control::from_model_name(name).map_or(name.as_str(), |_| OBSERVER);
            !has(name) && !has(asked)
        })
        .cloned()
        .collect()
}

/// Settings that determine the replies of a model: all except the base URL.
fn reply_settings(content: &Value) -> Value {
    let mut content = content.clone();
    if let Some(fields) = content.as_object_mut() {
        fields.remove("--base-url");
    }
    content
}

/// Models that reports leave out.
pub fn left_out_models(manifest: &RunManifest) -> Vec<String> {
    manifest.settings.get(LEFT_OUT).cloned().and_then(|names| serde_json::from_value(names).ok()).unwrap_or_default()
}

/// Changes the model name in a record to the current one.
pub fn rename_record<D>(record: &mut Record<D>, names: &RecordedNames) {
    let current = names.table_name(&record.model);
    if current != record.model {
        record.model = current.to_owned();
    }
}

/// Changes the model names in trials to the current ones.
pub fn rename_trials<D: Detail>(trials: &mut Trials<D>, manifest: &RunManifest) {
    let names = RecordedNames::from_manifest(manifest);
    trials.rename(|model| {
        let current = names.table_name(model);
        (current != model).then(|| current.to_owned())
    });
}

/// Prefix of the manifest settings that list the settings of a model that changed within the run; its name follows.
pub const CHANGED_FOR: &str = "changed for ";

/// Prefix of the manifest settings that list the flags of a model whose values a server refused; its name follows.
pub const REFUSED_FOR: &str = "refused for ";

/// Words before the name of a judge, whose settings differ from those of a model of the same name.
const JUDGE: &str = "the judge ";

/// Key of a manifest setting about a model or judge.
pub fn key(prefix: &str, model: &str, is_judge: bool) -> String {
    let judge = if is_judge { JUDGE } else { "" };
    format!("{prefix}{judge}{model}")
}

/// True if later commands must keep the manifest setting.
pub fn is_kept(key: &str) -> bool {
    [CHANGED_FOR, REFUSED_FOR].iter().any(|prefix| key.starts_with(prefix))
}

/// The strings in an array; none if the value is missing or not an array.
pub fn strings(value: Option<&Value>) -> Vec<String> {
    value.and_then(|value| serde_json::from_value(value.clone()).ok()).unwrap_or_default()
}

/// The changes in the value of a manifest setting with the prefix [`CHANGED_FOR`].
pub fn changes(value: Option<&Value>) -> Vec<ChangedSetting> {
    value.and_then(|value| serde_json::from_value(value.clone()).ok()).unwrap_or_default()
}

/// The changed settings of all models and judges of a run: the name, true for a judge, and the changes.
pub fn all(settings: &BTreeMap<String, Value>) -> impl Iterator<Item = (&str, bool, Vec<ChangedSetting>)> {
    settings.iter().filter_map(|(key, value)| {
        let owner = key.strip_prefix(CHANGED_FOR)?;
        let judge = owner.strip_prefix(JUDGE);
        Some((judge.unwrap_or(owner), judge.is_some(), changes(Some(value))))
    })
}

/// The current value of a model's setting, by its flag; `None` if it is unset.
pub fn current(manifest: &RunManifest, model: &str, flag: &str) -> Option<Value> {
    let changes = changes(manifest.settings.get(&key(CHANGED_FOR, model, false)));
    let changed = changes.into_iter().rfind(|change| change.flag == flag);
    let first = || manifest.columns.get("model")?.get(model)?.get(flag).cloned();
    changed.map_or_else(first, |change| Some(change.now)).filter(|value| !value.is_null())
}
