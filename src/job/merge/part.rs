//! A shard that is merged: [`MergePart`].

use std::path::{Path, PathBuf};

use crate::error::{Error, Result};
use crate::job::shard::Shard;
use crate::job::stored::manifest;
use crate::types::manifest::RunManifest;

/// One shard, as read from its folder.
pub(super) struct MergePart {
    pub(super) shard: Shard,
    pub(super) folder: PathBuf,
    pub(super) manifest: RunManifest,
}

impl MergePart {
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
}
