//! Models of a run that have another name now, other settings under their name, or are asked no more: [`note`], [`rename`].
//!
//! The name of a model is in no trial's key, so its replies stay. Their records keep the name that they have, and are read with the
//! one of now ([`RecordedNames`]).

use std::collections::{BTreeMap, BTreeSet};

use serde_json::{Value, json};

use super::identity::Columns;
use super::models::ADAPTED_FOR;
use crate::error::Result;
use crate::types::control::OBSERVER;
use crate::types::manifest::RunManifest;
use crate::types::recorded_names::RecordedNames;
use crate::types::{Control, Digest, Record};

/// The entry of a manifest's settings that holds the models which its file of models no longer has.
const LEFT_OUT: &str = "models left out";

/// Whether a model may get other settings in a run that has it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum OtherSettings {
    /// It is another model then: its name is its own in a file of models.
    Allowed,
    /// The run is another one.
    Refused,
}

/// Notes in a manifest which models of the stored one have another name in these columns. Two names are of one model if all that
/// decides its replies is the same. A model whose name another one has now is `NAME (before)`.
///
/// # Errors
/// If a number in the settings of a model is not finite.
pub(super) fn note(
    manifest: &mut RunManifest,
    stored: &RunManifest,
    now: &Columns,
    settings: OtherSettings,
) -> Result<()> {
    let empty = BTreeMap::new();
    let now = now.get("model").unwrap_or(&empty);
    let before = stored.columns.get("model").unwrap_or(&empty);
    let moves = moves(before, now, settings);
    let mut names = RecordedNames::of(stored);
    names.rename(&moves);
    for (name, content) in now {
        let digest = Digest::canonical("darkqa.model-name/1", &decides(content))?.to_string();
        names.ensure(name, || format!("{name} [{}]", &digest[..8]));
    }
    names.note(manifest);
    let new = |name: &String| moves.get(name).unwrap_or(name).clone();
    for model in &mut manifest.models {
        // Names of a file of models are those of now.
        if !now.contains_key(&model.name) {
            model.name = new(&model.name);
        }
    }
    if let Some(models) = manifest.columns.get_mut("model") {
        let known = before
            .iter()
            .map(|(name, content)| (new(name), content.clone()));
        *models = known.chain(now.clone()).collect();
    }
    for (name, new) in &moves {
        if let Some(changes) = stored.settings.get(&format!("{ADAPTED_FOR}{name}")) {
            let changes = changes.clone();
            manifest.settings.remove(&format!("{ADAPTED_FOR}{name}"));
            manifest
                .settings
                .insert(format!("{ADAPTED_FOR}{new}"), changes);
        }
    }
    let left = left_out(manifest, stored, now, &moves, settings);
    if left.is_empty() {
        manifest.settings.remove(LEFT_OUT);
    } else {
        manifest.settings.insert(LEFT_OUT.to_owned(), json!(left));
    }
    Ok(())
}

/// The new name of each model that has one.
fn moves(
    before: &BTreeMap<String, Value>,
    now: &BTreeMap<String, Value>,
    settings: OtherSettings,
) -> BTreeMap<String, String> {
    let is_same = |name: &String| match (before.get(name), now.get(name)) {
        (Some(old), Some(new)) => decides(old) == decides(new),
        _ => false,
    };
    let mut moves = BTreeMap::new();
    for (new, content) in now.iter().filter(|(new, _)| !is_same(new)) {
        let mut same = before.iter().filter(|(old, other)| {
            *old != new && !is_same(old) && decides(content) == decides(other)
        });
        if let Some((old, _)) = same.next() {
            moves.insert(old.clone(), new.clone());
        }
    }
    if settings == OtherSettings::Refused {
        return moves;
    }
    let displaced = now.keys().filter(|name| before.contains_key(*name));
    for name in displaced.filter(|name| !is_same(name)) {
        if moves.contains_key(name) {
            continue;
        }
        let free = |candidate: &String| {
            let stays = before.contains_key(candidate) && !moves.contains_key(candidate);
            !stays && !now.contains_key(candidate) && !moves.values().any(|new| new == candidate)
        };
        let first = std::iter::once(format!("{name} (before)"));
        let mut candidates = first.chain((2..).map(|n| format!("{name} (before {n})")));
        if let Some(new) = candidates.find(free) {
            moves.insert(name.clone(), new);
        }
    }
    moves
}

/// The models that this command neither asks nor lists. Without a file of models these are those that were left out before.
fn left_out(
    manifest: &RunManifest,
    stored: &RunManifest,
    now: &BTreeMap<String, Value>,
    moves: &BTreeMap<String, String>,
    settings: OtherSettings,
) -> BTreeSet<String> {
    let known = manifest.columns.get("model").into_iter().flatten();
    let known: BTreeSet<String> = known.map(|(name, _)| name.clone()).collect();
    let earlier: BTreeSet<String> = read(stored).into_iter().collect();
    let earlier = earlier
        .iter()
        .map(|name| moves.get(name).unwrap_or(name).clone());
    let earlier: BTreeSet<String> = earlier.chain(moves.values().cloned()).collect();
    let is_listed = |name: &str| {
        // A control is asked with the observer.
        let asked = Control::of_model(name).map_or(name, |_| OBSERVER);
        let has = |name: &str| {
            now.contains_key(name) || manifest.models.iter().any(|model| model.name == name)
        };
        has(name) || has(asked)
    };
    let is_left = |name: &String| {
        let is_candidate = settings == OtherSettings::Allowed || earlier.contains(name);
        is_candidate && !is_listed(name)
    };
    known.into_iter().filter(is_left).collect()
}

/// What decides the replies of a model: all but the address.
fn decides(content: &Value) -> Value {
    let mut content = content.clone();
    if let Some(fields) = content.as_object_mut() {
        fields.remove("--base-url");
    }
    content
}

/// The models that a report leaves out.
fn read(manifest: &RunManifest) -> Vec<String> {
    let names = manifest.settings.get(LEFT_OUT).cloned();
    names
        .and_then(|names| serde_json::from_value(names).ok())
        .unwrap_or_default()
}

/// Gives the records the names that the models have now.
pub(super) fn rename<D>(records: &mut [Record<D>], manifest: &RunManifest) {
    let names = RecordedNames::of(manifest);
    for record in records {
        let shown = names.shown(&record.model);
        if shown != record.model {
            record.model = shown.to_owned();
        }
    }
}

/// Takes the records of models that a report leaves out of these records.
pub(super) fn leave_out<D>(records: &mut Vec<Record<D>>, manifest: &RunManifest) -> Vec<Record<D>> {
    let names = read(manifest);
    if names.is_empty() {
        return Vec::new();
    }
    records
        .extract_if(.., |record| names.contains(&record.model))
        .collect()
}
