//! The manifest of the run that parts are together: [`joined_manifest`].

use std::collections::BTreeMap;

use super::coverage::Coverage;
use super::part::{StoredPart, no_part};
use crate::error::{Error, Result};
use crate::runs::part_cost::PartCost;
use crate::types::InputSummary;
use crate::types::keyed_flag::spelled_setting;
use crate::types::manifest::{RunManifest, differences};

/// Checks that all are parts of the same run.
///
/// # Errors
/// If one is not; names the first difference.
pub(super) fn check_same_run(parts: &[StoredPart]) -> Result<()> {
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

/// The first difference between two manifests that makes them different runs: the field, and its value in each.
fn difference(first: &RunManifest, other: &RunManifest) -> Option<(String, String, String)> {
    let identity = differences(&first.identity, &other.identity).next();
    let identity = identity.map(|(field, own, other)| (spelled_setting(field), own, other));
    identity.or_else(|| {
        let column = first.column_differences(other).into_iter().next()?;
        let setting = spelled_setting(&column.field);
        let field = format!("{setting} of the {} {}", column.column, column.value);
        Some((field, column.first, column.second))
    })
}

/// The manifest of the run, without the numbers of its trials.
///
/// # Errors
/// If there is no part.
pub(super) fn joined_manifest(parts: &[StoredPart], coverage: &Coverage) -> Result<RunManifest> {
    let manifests = parts.iter().map(|part| &part.manifest);
    let first = manifests.clone().next();
    let mut manifest = first.ok_or_else(no_part)?.clone();
    manifest.shard = None;
    manifest.part = None;
    PartCost::forget(&mut manifest);
    for other in manifests.clone() {
        for (column, values) in &other.columns {
            let all = manifest.columns.entry(column.clone()).or_default();
            all.extend(values.clone());
        }
    }
    manifest.enhancers = BTreeMap::new();
    for (name, note) in manifests.clone().flat_map(|other| &other.enhancers) {
        let earlier = manifest.enhancers.remove(name);
        let note = note.clone().after(earlier);
        manifest.enhancers.insert(name.clone(), note);
    }
    let mut inputs: Option<InputSummary> = None;
    let once = manifests
        .clone()
        .zip(coverage.once())
        .filter_map(|(other, is_taken)| other.inputs.as_ref().filter(|_| is_taken));
    for other in once {
        inputs.get_or_insert_default().join(other);
    }
    manifest.inputs = inputs;
    let created = manifests
        .clone()
        .map(|manifest| manifest.created.clone())
        .min();
    let updated = manifests
        .clone()
        .map(|manifest| manifest.updated.clone())
        .max();
    // The records of all shards are stored as they are; the first version has no name in a manifest.
    let readings = manifests.clone().map(|manifest| &manifest.reply_reading);
    manifest.reply_reading = readings.min().cloned().flatten();
    manifest.created = created.unwrap_or_default();
    manifest.updated = updated.unwrap_or_default();
    Ok(manifest)
}
