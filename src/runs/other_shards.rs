//! Shards of the same run with another number of shards: [`OtherShards`].

use std::collections::{BTreeSet, HashSet};
use std::fs;
use std::path::{Path, PathBuf};

use crate::error::{Error, Result};
use crate::runs::shard_records::{append_records, latest_trials};
use crate::store::{self, Store};
use crate::types::flags::setting_spelling;
use crate::types::manifests::{RunManifest, differences};
use crate::types::{FrameId, TextPlace, TrialKey};
use darkqa_score::answers::record::Detail;

/// Shards of a run that was divided into another number of shards, for example because a job array was stopped and
/// restarted with another size. Their replies are reused.
pub(crate) struct OtherShards(Vec<(PathBuf, RunManifest)>);

impl OtherShards {
    /// Finds the shards of other divisions in the parent folder of a shard.
    ///
    /// # Errors
    /// If one belongs to another run, or another process is writing to it and might ask the same questions.
    pub(crate) fn find<D: Detail>(folder: &Path, manifest: &RunManifest) -> Result<Self> {
        let mut shards = Vec::new();
        let (Some(own), Some(run)) = (shard_count(manifest), folder.parent()) else {
            return Ok(Self(shards));
        };
        let entries = fs::read_dir(run).map_err(|e| Error::file(run, "read", e))?;
        for entry in entries {
            let path = entry.map_err(|e| Error::file(run, "read", e))?.path();
            if store::schema(&path)?.is_none_or(|schema| schema != D::SCHEMA) {
                continue;
            }
            let Some(other) = store::read_manifest(&path, D::SCHEMA)? else {
                continue;
            };
            if shard_count(&other).is_none_or(|count| count == own) {
                continue;
            }
            if let Some((field, before, now)) = differences(&other.identity, &manifest.identity).next() {
                let field = setting_spelling(field);
                return Err(Error::Run {
                    path: path.clone(),
                    problem: format!(
                        "this part is of another run: its {field} is {before}, now it is {now}; use another --out, or the same {field}"
                    ),
                });
            }
            if store::is_locked(&path)? {
                return Err(Error::Run {
                    path: path.clone(),
                    problem: format!(
                        "another process is writing to this part of another division, and both might ask the same; wait for it, or end it, \
                         before --shard {} begins",
                        manifest.shard.as_deref().unwrap_or_default()
                    ),
                });
            }
            shards.push((path, other));
        }
        shards.sort_by(|one, other| one.0.cmp(&other.0));
        Ok(Self(shards))
    }

    /// Copies the replies to the trials in `wanted` from the other shards, with the thumbnails and fidelity notes of
    /// `sources`. Returns the number of replies.
    ///
    /// # Errors
    /// If a record cannot be read or written.
    pub(crate) fn copy_into<D: Detail>(
        &self,
        store: &mut Store<D>,
        manifest: &RunManifest,
        wanted: &HashSet<TrialKey>,
        sources: &BTreeSet<&FrameId>,
    ) -> Result<usize> {
        let mut found: Vec<(TrialKey, TextPlace)> = Vec::new();
        let mut keys = HashSet::new();
        for (number, (folder, other)) in self.0.iter().enumerate() {
            let trials = latest_trials::<D>(folder, other)?;
            let mut answered: Vec<(TextPlace, TrialKey)> = trials
                .iter()
                .filter(|trial| wanted.contains(&trial.key()) && !trial.failed())
                .map(|trial| (trial.text().in_log(number), trial.key()))
                .collect();
            answered.sort_unstable();
            found.extend(answered.into_iter().filter(|(_, key)| keys.insert(*key)).map(|(place, key)| (key, place)));
        }
        if found.is_empty() {
            return Ok(0);
        }
        let shards: Vec<(&Path, &RunManifest)> =
            self.0.iter().map(|(folder, manifest)| (&**folder, manifest)).collect();
        append_records(store, manifest, &shards, found.iter().copied())?;
        let folders: Vec<&Path> = shards.iter().map(|(folder, _)| *folder).collect();
        store.add_thumbnails_from(&folders, |frame| sources.contains(frame))?;
        store.add_fidelity_from(&folders, |frame| sources.contains(frame))?;
        store.sync()?;
        Ok(found.len())
    }
}

/// The number of shards in the manifest of a shard; `None` if the run is not a shard.
fn shard_count(manifest: &RunManifest) -> Option<&str> {
    let (_, count) = manifest.shard.as_deref()?.split_once('/')?;
    Some(count)
}
