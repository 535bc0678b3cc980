//! Sources and trials in parts of another division of the same run: [`OtherParts`].

use std::collections::{BTreeSet, HashSet};
use std::fs;
use std::path::{Path, PathBuf};

use crate::error::{Error, Result};
use crate::runs::placed_trials::{append, trials_of};
use crate::store::{self, Store};
use crate::types::flags::spelled_setting;
use crate::types::manifests::{RunManifest, differences};
use crate::types::{FrameId, TextPlace, TrialKey};
use darkqa_score::answers::record::Detail;

/// The parts of a run in another number than now, as when a job array was stopped and goes on with another size.
pub(crate) struct OtherParts(Vec<(PathBuf, RunManifest)>);

impl OtherParts {
    /// The parts of other divisions beside the folder of a part.
    ///
    /// # Errors
    /// If one is of another run, or another process writes to it: both might ask the same.
    pub(crate) fn beside<D: Detail>(folder: &Path, manifest: &RunManifest) -> Result<Self> {
        let mut parts = Vec::new();
        let (Some(own), Some(whole)) = (division(manifest), folder.parent()) else {
            return Ok(Self(parts));
        };
        let entries = fs::read_dir(whole).map_err(|e| Error::file(whole, "read", e))?;
        for entry in entries {
            let path = entry.map_err(|e| Error::file(whole, "read", e))?.path();
            if store::schema(&path)?.is_none_or(|schema| schema != D::SCHEMA) {
                continue;
            }
            let Some(other) = store::read_manifest(&path, D::SCHEMA)? else {
                continue;
            };
            if division(&other).is_none_or(|division| division == own) {
                continue;
            }
            let wrong = |problem: String| {
                let path = path.clone();
                Err(Error::Run { path, problem })
            };
            if let Some((field, before, now)) =
                differences(&other.identity, &manifest.identity).next()
            {
                let field = spelled_setting(field);
                return wrong(format!(
                    "this part is of another run: its {field} is {before}, now it is {now}; use another --out, or the same {field}"
                ));
            }
            if store::is_locked(&path)? {
                return wrong(format!(
                    "another process is writing to this part of another division, and both might ask the same; wait for it, or end it, before \
                     --shard {} begins",
                    manifest.shard.as_deref().unwrap_or_default()
                ));
            }
            parts.push((path, other));
        }
        parts.sort_by(|one, other| one.0.cmp(&other.0));
        Ok(Self(parts))
    }

    /// Copies the replies to these trials from the other parts, and the notes about the images of these sources. Returns the number of
    /// replies.
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
        for (part, (folder, other)) in self.0.iter().enumerate() {
            let trials = trials_of::<D>(folder, other)?;
            let mut answered: Vec<(TextPlace, TrialKey)> = trials
                .iter()
                .filter(|trial| wanted.contains(&trial.key()) && !trial.failed())
                .map(|trial| (trial.text().in_log(part), trial.key()))
                .collect();
            answered.sort_unstable();
            let new = answered.into_iter().filter(|(_, key)| keys.insert(*key));
            found.extend(new.map(|(place, key)| (key, place)));
        }
        if found.is_empty() {
            return Ok(0);
        }
        let parts: Vec<(&Path, &RunManifest)> = self
            .0
            .iter()
            .map(|(folder, manifest)| (&**folder, manifest))
            .collect();
        append(store, manifest, &parts, found.iter().copied())?;
        let folders: Vec<&Path> = parts.iter().map(|(folder, _)| *folder).collect();
        store.add_thumbnails_of(&folders, |frame| sources.contains(frame))?;
        store.add_fidelity_of(&folders, |frame| sources.contains(frame))?;
        store.sync()?;
        Ok(found.len())
    }
}

/// The number of parts, if a run is a part.
fn division(manifest: &RunManifest) -> Option<&str> {
    let (_, count) = manifest.shard.as_deref()?.split_once('/')?;
    Some(count)
}
