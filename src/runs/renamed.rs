//! Models of a run that have another name now, other settings under their name, or are asked no more: [`note`], [`rename`].
//!
//! The name of a model is in no trial's key, so its replies stay. Their records keep the name that they have, and are read with the
//! one of now ([`RecordedNames`]).

use std::collections::{BTreeMap, BTreeSet};

use serde_json::{Value, json};

use crate::error::Result;
use crate::types::control::OBSERVER;
use crate::types::manifest::RunManifest;
use crate::types::model_views::{Fit, StoredViews, Views};
use crate::types::recorded_names::RecordedNames;
use crate::types::{Control, Digest, Record, Trials};
use darkqa_score::record::Detail;

/// The beginning of the fields of a manifest that hold the changes to requests to a model; its name follows.
pub(crate) const ADAPTED_FOR: &str = "adapted for ";

/// The entry of a manifest's settings that holds the models which its file of models no longer has.
const LEFT_OUT: &str = "models left out";

/// Whether a model may get other settings in a run that has it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum OtherSettings {
    /// It is another model then: its name is its own in a file of models.
    Allowed,
    /// The run is another one.
    Refused,
}

/// The models of a command.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Now<'a> {
    /// Settings that determine the replies of each model, by name.
    pub(crate) models: &'a BTreeMap<String, Value>,
    /// The view of each model, by name.
    pub(crate) views: &'a Views,
    pub(crate) settings: OtherSettings,
}

/// Notes in a manifest which models of the stored one have another name in these columns. Two names are of one model if all that
/// decides its replies is the same, and both are shown images, or none. A model whose name another one has now is `NAME (before)`.
///
/// # Errors
/// If a number in the settings of a model is not finite.
pub(crate) fn note(
    manifest: &mut RunManifest,
    stored: &RunManifest,
    command: Now<'_>,
) -> Result<()> {
    let Now {
        models: now,
        settings,
        ..
    } = command;
    let empty = BTreeMap::new();
    let before = stored.columns.get("model").unwrap_or(&empty);
    let stored_views = StoredViews::from_manifest(stored);
    let moves = moves(before, &stored_views, command);
    let mut names = RecordedNames::from_manifest(stored);
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
    let adapted = |name: &String| format!("{ADAPTED_FOR}{name}");
    // Two models may have exchanged their names: all are taken out before one is put in.
    for name in moves
        .keys()
        .filter(|name| stored.settings.contains_key(&adapted(name)))
    {
        manifest.settings.remove(&adapted(name));
    }
    for (name, new) in &moves {
        if let Some(changes) = stored.settings.get(&adapted(name)) {
            manifest.settings.insert(adapted(new), changes.clone());
        }
    }
    let known = before.keys().map(|name| (name, new(name)));
    if settings == OtherSettings::Allowed || stored_views.is_noted() {
        stored_views.note(manifest, known, command.views);
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
    views: &StoredViews,
    command: Now<'_>,
) -> BTreeMap<String, String> {
    let Now {
        models: now,
        settings,
        ..
    } = command;
    // How well a model of before fits one of now; `None` if it is another one.
    let fit = |old: &String, new: &String| {
        let is_same = decides(before.get(old)?) == decides(now.get(new)?);
        let fit = views.fit(old, command.views.get(new)?);
        is_same.then_some(fit).filter(|fit| *fit > Fit::Apart)
    };
    let is_same = |name: &String| match (before.get(name), now.get(name)) {
        // A model that is shown something else now keeps its name unless another one of before has it now.
        (Some(old), Some(new)) => {
            decides(old) == decides(new)
                && (fit(name, name).is_some() || !before.keys().any(|old| fit(old, name).is_some()))
        }
        _ => false,
    };
    let mut moves: BTreeMap<String, String> = BTreeMap::new();
    let mut found = BTreeSet::new();
    for least in [Fit::Whole, Fit::Part, Fit::Unknown] {
        for new in now.keys().filter(|new| !is_same(new)) {
            let mut same = before.keys().filter(|old| {
                let is_free = !moves.contains_key(*old) && !is_same(old);
                *old != new && is_free && fit(old, new) >= Some(least)
            });
            if !found.contains(new)
                && let Some(old) = same.next()
            {
                moves.insert(old.clone(), new.clone());
                found.insert(new.clone());
            }
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
    let known: BTreeSet<String> = manifest
        .columns
        .get("model")
        .into_iter()
        .flatten()
        .map(|(name, _)| name.clone())
        .collect();
    let earlier: BTreeSet<String> = left_out_models(stored).into_iter().collect();
    let earlier: BTreeSet<String> = earlier
        .iter()
        .map(|name| moves.get(name).unwrap_or(name).clone())
        .chain(moves.values().cloned())
        .collect();
    let is_listed = |name: &str| {
        // A control is asked with the observer.
        let asked = Control::from_model_name(name).map_or(name, |_| OBSERVER);
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

/// Settings that determine the replies of a model: all but the address.
fn decides(content: &Value) -> Value {
    let mut content = content.clone();
    if let Some(fields) = content.as_object_mut() {
        fields.remove("--base-url");
    }
    content
}

/// The models that a report leaves out.
pub(crate) fn left_out_models(manifest: &RunManifest) -> Vec<String> {
    let names = manifest.settings.get(LEFT_OUT).cloned();
    names
        .and_then(|names| serde_json::from_value(names).ok())
        .unwrap_or_default()
}

/// Gives the records the names that the models have now.
pub(crate) fn rename<D>(records: &mut [Record<D>], manifest: &RunManifest) {
    let names = RecordedNames::from_manifest(manifest);
    for record in records {
        let shown = names.shown(&record.model);
        if shown != record.model {
            record.model = shown.to_owned();
        }
    }
}

/// Gives trials the names that the models have now.
pub(crate) fn rename_trials<D: Detail>(trials: &mut Trials<D>, manifest: &RunManifest) {
    let names = RecordedNames::from_manifest(manifest);
    trials.rename(|model| {
        let shown = names.shown(model);
        (shown != model).then(|| shown.to_owned())
    });
}
