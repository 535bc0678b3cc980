//! [`joined_manifest`]: the manifest of a run that is joined from its parts.

use std::collections::BTreeMap;

use super::coverage::Coverage;
use super::part::{StoredPart, no_part};
use crate::error::{Error, Result};
use crate::runs::part_cost::PartCost;
use crate::types::InputSummary;
use crate::types::flags::spelled_setting;
use crate::types::manifests::{RunManifest, differences};

/// Checks that all parts belong to the same run.
///
/// # Errors
/// If a part belongs to another run; names the first difference.
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

/// First difference by which two manifests belong to different runs: the field, and its value in each.
fn difference(one: &RunManifest, other: &RunManifest) -> Option<(String, String, String)> {
    if let Some((field, first, second)) = differences(&one.identity, &other.identity).next() {
        return Some((spelled_setting(field), first, second));
    }
    let column = one.column_differences(other).into_iter().next()?;
    let setting = spelled_setting(&column.field);
    let field = format!("{setting} of the {} {}", column.column, column.value);
    Some((field, column.first, column.second))
}

/// Joins the manifests of the parts into the manifest of the run. Its trial counts are left to the caller.
///
/// # Errors
/// If there is no part.
pub(super) fn joined_manifest(parts: &[StoredPart], coverage: &Coverage) -> Result<RunManifest> {
    let mut manifest = parts.first().ok_or_else(no_part)?.manifest.clone();
    manifest.shard = None;
    manifest.part = None;
    PartCost::forget(&mut manifest);
    for part in parts {
        for (column, values) in &part.manifest.columns {
            let all = manifest.columns.entry(column.clone()).or_default();
            all.extend(values.clone());
        }
    }
    manifest.enhancers = BTreeMap::new();
    for (name, note) in parts.iter().flat_map(|part| &part.manifest.enhancers) {
        let earlier = manifest.enhancers.remove(name);
        let note = note.clone().after(earlier);
        manifest.enhancers.insert(name.clone(), note);
    }
    let mut inputs: Option<InputSummary> = None;
    for (part, is_counted) in parts.iter().zip(coverage.once()) {
        if is_counted && let Some(part_inputs) = &part.manifest.inputs {
            inputs.get_or_insert_default().join(part_inputs);
        }
    }
    manifest.inputs = inputs;
    // The records of the parts keep their readings, so the oldest version counts; `None` is the first version.
    let reply_reading = parts.iter().map(|part| &part.manifest.reply_reading).min();
    manifest.reply_reading = reply_reading.cloned().flatten();
    let created = parts.iter().map(|part| &part.manifest.created).min();
    manifest.created = created.cloned().unwrap_or_default();
    let updated = parts.iter().map(|part| &part.manifest.updated).max();
    manifest.updated = updated.cloned().unwrap_or_default();
    Ok(manifest)
}
