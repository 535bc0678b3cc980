//! The divisions of a run into shards, by the shards in its folder: [`Division`].

use std::collections::BTreeMap;
use std::fs;
use std::num::NonZeroU32;
use std::path::Path;

use serde_json::{Value, json};

use crate::runs::shard::Shard;
use crate::runs::slurm_array::{ArrayTask, TaskRange};
use crate::store;
use crate::types::manifests::RunManifest;

/// Manifest setting of a shard: the Slurm array whose tasks do the shards, as `0-3`.
const ENTRY: &str = "Slurm array of this part";

/// A division of a run into shards, of which some exist.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Division {
    /// Number of shards.
    pub(super) count: NonZeroU32,
    /// The Slurm array whose tasks do the shards; `None` if they were named by hand or by an earlier version.
    tasks: Option<TaskRange>,
}

impl Division {
    /// The shard of a task that repeats one of this division, and the array of the division; `None` if it does not
    /// repeat one.
    pub(super) fn shard_of(&self, task: ArrayTask) -> Option<(Shard, TaskRange)> {
        let tasks = self.tasks.filter(|tasks| task.repeats(*tasks))?;
        let shard = Shard::new(tasks.index(task.number)?, self.count)?;
        Some((shard, tasks))
    }
}

/// The divisions of the run in a folder, by their numbers of shards. Empty if the folder has no shard or cannot be
/// read.
pub(super) fn divisions_in(folder: &Path) -> Vec<Division> {
    let mut shards: Vec<Shard> = fs::read_dir(folder)
        .into_iter()
        .flatten()
        .filter_map(|entry| Shard::of_folder(entry.ok()?.file_name().to_str()?))
        .collect();
    shards.sort_by_key(|shard| (shard.count(), *shard));
    let mut divisions = BTreeMap::<NonZeroU32, Option<TaskRange>>::new();
    for shard in shards {
        let tasks = divisions.entry(shard.count()).or_default();
        // One manifest of a division suffices.
        if tasks.is_none() {
            *tasks = tasks_of(&folder.join(shard.folder()));
        }
    }
    divisions.into_iter().map(|(count, tasks)| Division { count, tasks }).collect()
}

/// The array in the manifest of a shard; `None` if there is none, or if the manifest cannot be read: opening the shard
/// reports that error.
fn tasks_of(shard: &Path) -> Option<TaskRange> {
    let settings = store::read_settings(shard).ok()?;
    settings.get(ENTRY)?.as_str()?.parse().ok()
}

/// The manifest setting that notes the array of a shard.
pub(crate) fn tasks_setting(tasks: TaskRange) -> (String, Value) {
    (ENTRY.to_owned(), json!(tasks.to_string()))
}

/// Removes the note from the manifest of a run joined from shards.
pub(super) fn remove_tasks_setting(manifest: &mut RunManifest) {
    manifest.settings.remove(ENTRY);
}
