//! The manifest of a run joined from its shards: [`joined_manifest`].

use std::collections::BTreeMap;

use super::coverage::Coverage;
use super::stored_shard::{StoredShard, no_shard_error};
use crate::error::{Error, Result};
use crate::runs::divisions::remove_tasks_setting;
use crate::runs::shard_budget::ShardBudget;
use crate::types::InputSummary;
use crate::types::flags::setting_spelling;
use crate::types::manifests::{RunManifest, differences};

/// Checks that all shards belong to the same run.
///
/// # Errors
/// If a shard belongs to another run; names the first difference.
pub(super) fn check_same_run(parts: &[StoredShard]) -> Result<()> {
    let Some(first) = parts.first() else {
        return Ok(());
    };
    for part in parts {
        let Some((field, own, other)) = difference(&part.manifest, &first.manifest) else {
            continue;
        };
        let problem = format!(
            "shard {} is of another run than {}: its {field} is {own}, that of the other run is {other}",
            part.shard,
            first.folder.display()
        );
        let path = part.folder.clone();
        return Err(Error::Run { path, problem });
    }
    Ok(())
}

/// First difference by which two manifests belong to different runs: the field, and its value in each.
fn difference(one: &RunManifest, other: &RunManifest) -> Option<(String, String, String)> {
    if let Some((field, first, second)) = differences(&one.identity, &other.identity).next() {
        return Some((setting_spelling(field), first, second));
    }
    let column = one.column_differences(other).into_iter().next()?;
    let setting = setting_spelling(&column.field);
    let field = format!("{setting} of the {} {}", column.column, column.value);
    Some((field, column.first, column.second))
}

/// Joins the manifests of the shards into the manifest of the run. The caller sets the counts of trials.
///
/// # Errors
/// If there is no shard.
pub(super) fn joined_manifest(parts: &[StoredShard], coverage: &Coverage) -> Result<RunManifest> {
    let mut manifest = parts.first().ok_or_else(no_shard_error)?.manifest.clone();
    manifest.shard = None;
    manifest.part = None;
    ShardBudget::remove_note(&mut manifest);
    remove_tasks_setting(&mut manifest);
    for part in parts {
        for (column, values) in &part.manifest.columns {
            let all = manifest.columns.entry(column.clone()).or_default();
            all.extend(values.clone());
        }
    }
    manifest.enhancers = BTreeMap::new();
    for (name, note) in parts.iter().flat_map(|part| &part.manifest.enhancers) {
        let earlier = manifest.enhancers.remove(name);
        let note = note.clone().with_earlier(earlier);
        manifest.enhancers.insert(name.clone(), note);
    }
    let mut inputs: Option<InputSummary> = None;
    for (part, is_counted) in parts.iter().zip(coverage.counted_once()) {
        if is_counted && let Some(part_inputs) = &part.manifest.inputs {
            inputs.get_or_insert_default().merge(part_inputs);
        }
    }
    manifest.inputs = inputs;
    for part in parts.iter().map(|part| &part.manifest) {
        // The records of the shards are not parsed again, so the oldest version counts; `None` is the first version.
        if part.reply_reading < manifest.reply_reading {
            manifest.reply_reading.clone_from(&part.reply_reading);
        }
        if part.created < manifest.created {
            manifest.created.clone_from(&part.created);
        }
        if part.updated > manifest.updated {
            manifest.updated.clone_from(&part.updated);
        }
    }
    Ok(manifest)
}
