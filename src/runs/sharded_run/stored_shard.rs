//! One part of a run: [`StoredPart`].

use std::path::{Path, PathBuf};

use crate::error::{Error, Result};
use crate::runs::shard::Shard;
use crate::runs::stored::manifest;
use crate::types::manifests::{RunManifest, RunPart};

/// One shard, as read from its folder.
pub(super) struct StoredPart {
    pub(super) shard: Shard,
    pub(super) folder: PathBuf,
    pub(super) manifest: RunManifest,
}

impl StoredPart {
    /// The shard in a folder.
    ///
    /// # Errors
    /// If the folder holds no shard, or a file in it cannot be read.
    pub(super) fn open(folder: &Path) -> Result<Self> {
        let wrong = |problem: &str| Error::Run {
            path: folder.to_owned(),
            problem: problem.to_owned(),
        };
        let manifest = manifest(folder)?;
        let Some(shard) = manifest.shard.as_deref() else {
            return Err(wrong("the run is not a shard: it was made without --shard"));
        };
        Ok(Self {
            shard: shard.parse()?,
            folder: folder.to_owned(),
            manifest,
        })
    }

    /// Whether each source of the part is in one of the others with as many trials, and with the same models, enhancers and other columns.
    pub(super) fn is_covered_by(&self, others: &[&Self]) -> bool {
        let Some(own) = &self.manifest.part else {
            return false;
        };
        let alike: Vec<&RunPart> = others
            .iter()
            .filter(|other| self.has_columns_in(other))
            .filter_map(|other| other.manifest.part.as_ref())
            .collect();
        own.trials
            .iter()
            .zip(own.place.first..)
            .all(|(trials, source)| {
                let place = |part: &&RunPart| {
                    let place = source.checked_sub(part.place.first)?;
                    part.trials.get(place).copied()
                };
                alike.iter().filter_map(place).any(|other| other >= *trials)
            })
    }

    /// Whether another part has every column value that this one has.
    fn has_columns_in(&self, other: &Self) -> bool {
        self.manifest.columns.iter().all(|(column, values)| {
            let known = other.manifest.columns.get(column);
            values
                .keys()
                .all(|value| known.is_some_and(|known| known.contains_key(value)))
        })
    }
}

/// The error about a command that names no part.
pub(super) fn no_part() -> Error {
    Error::usage("RUN", "no shard is named")
}
