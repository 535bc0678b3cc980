//! Models of a run that have another name now: [`note`], [`rename`].
//!
//! The name of a model is in no trial's key, so its replies stay. Their records keep the old name, and are read with the new one.

use std::collections::BTreeMap;

use serde_json::{Value, json};

use super::identity::Columns;
use crate::types::Record;
use crate::types::manifest::RunManifest;

/// The entry of a manifest that holds the names.
const RENAMED: &str = "renamed models";

/// Adds to the settings of a manifest which models of the stored one have another name in these columns, and takes the old names out
/// of its columns. Two names are of one model if all that decides its replies is the same.
pub(super) fn note(manifest: &mut RunManifest, stored: &RunManifest, now: &Columns) {
    let empty = BTreeMap::new();
    let now = now.get("model").unwrap_or(&empty);
    let before = stored.columns.get("model").unwrap_or(&empty);
    let mut names = read(stored);
    names.retain(|old, _| !now.contains_key(old));
    for (new, content) in now {
        let same = |(old, other): &(&String, &Value)| {
            !now.contains_key(*old) && decides(content) == decides(other)
        };
        for (old, _) in before.iter().filter(same) {
            names.insert(old.clone(), new.clone());
            if let Some(models) = manifest.columns.get_mut("model") {
                models.remove(old);
            }
        }
    }
    let latest = names.clone();
    for name in names.values_mut() {
        if let Some(newer) = latest.get(name) {
            name.clone_from(newer);
        }
    }
    for model in &mut manifest.models {
        if let Some(name) = names.get(&model.name) {
            model.name.clone_from(name);
        }
    }
    if names.is_empty() {
        manifest.settings.remove(RENAMED);
    } else {
        manifest.settings.insert(RENAMED.to_owned(), json!(names));
    }
}

/// What decides the replies of a model: all but the address.
fn decides(content: &Value) -> Value {
    let mut content = content.clone();
    if let Some(fields) = content.as_object_mut() {
        fields.remove("--base-url");
    }
    content
}

/// The new name of each model that has one.
fn read(manifest: &RunManifest) -> BTreeMap<String, String> {
    let names = manifest.settings.get(RENAMED).cloned();
    names
        .and_then(|names| serde_json::from_value(names).ok())
        .unwrap_or_default()
}

/// Gives the records the names that the models have now.
pub(super) fn rename<D>(records: &mut [Record<D>], manifest: &RunManifest) {
    let names = read(manifest);
    if names.is_empty() {
        return;
    }
    for record in records {
        if let Some(name) = names.get(&record.model) {
            record.model.clone_from(name);
        }
    }
}
