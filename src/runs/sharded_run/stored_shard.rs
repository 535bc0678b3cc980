//! One shard of a run: [`StoredShard`].

use std::path::{Path, PathBuf};

use crate::error::{Error, Result};
use crate::runs::shard::Shard;
use crate::runs::stored::read_run_manifest;
use crate::types::manifests::{RunManifest, RunPart};

/// A shard as read from its folder.
pub(super) struct StoredShard {
    pub(super) shard: Shard,
    pub(super) folder: PathBuf,
    pub(super) manifest: RunManifest,
}

impl StoredShard {
    /// Reads the shard in a folder.
    ///
    /// # Errors
    /// If the folder has no shard, or a file in it cannot be read.
    pub(super) fn open(folder: &Path) -> Result<Self> {
        let manifest = read_run_manifest(folder)?;
        let Some(shard) = manifest.shard.as_deref() else {
            return Err(Error::Run {
                path: folder.to_owned(),
                problem: "the run is not a shard: it was made without --shard".to_owned(),
            });
        };
        Ok(Self { shard: shard.parse()?, folder: folder.to_owned(), manifest })
    }

    /// True if every source of this shard is in another one with at least as many trials, and the other has all models,
    /// enhancers and other column values of this one.
    pub(super) fn is_covered_by(&self, others: &[&Self]) -> bool {
        let Some(own) = &self.manifest.part else {
            return false;
        };
        let candidates: Vec<&RunPart> = others
            .iter()
            .filter(|other| self.has_columns_in(other))
            .filter_map(|other| other.manifest.part.as_ref())
            .collect();
        own.trials.iter().zip(own.place.first..).all(|(trials, source)| {
            candidates.iter().any(|part| {
                source
                    .checked_sub(part.place.first)
                    .and_then(|place| part.trials.get(place))
                    .is_some_and(|other| other >= trials)
            })
        })
    }

    /// True if another shard has every column value of this one.
    fn has_columns_in(&self, other: &Self) -> bool {
        self.manifest.columns.iter().all(|(column, values)| {
            let known = other.manifest.columns.get(column);
            values.keys().all(|value| known.is_some_and(|known| known.contains_key(value)))
        })
    }
}

/// The error for a command without a shard.
pub(super) fn no_shard_error() -> Error {
    Error::usage("RUN", "no shard is named")
}
