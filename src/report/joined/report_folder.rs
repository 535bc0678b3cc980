//! The folder that the report on one run is written into: [`ReportFolder`], [`write_in_place`].

use std::path::Path;

use crate::error::{Error, Result};
use crate::files;
use crate::runs::stored::RunLayout;
use crate::store::{AddressChange, Store};
use crate::types::manifests::RunManifest;
use darkqa_score::answers::record::Detail;

/// The folder that the report on one run is written into.
pub(super) enum ReportFolder<'a, D: Detail> {
    /// The folder of the run.
    Run(&'a Store<D>),
    /// The folder with the shards of the run. Each shard has its own manifest; the folder has none.
    Shards(&'a Path),
}

impl<D: Detail> ReportFolder<'_, D> {
    pub(super) fn path(&self) -> &Path {
        match self {
            Self::Run(store) => store.folder(),
            Self::Shards(folder) => folder,
        }
    }

    /// Writes the files of a report and, into the folder of a run, the manifest.
    ///
    /// # Errors
    /// If a file cannot be written.
    pub(super) fn write(&self, contents: &[(String, Vec<u8>)], manifest: &RunManifest) -> Result<()> {
        for (name, content) in contents {
            match self {
                Self::Run(store) => store.write(name, content)?,
                Self::Shards(folder) => {
                    let path = folder.join(name);
                    refuse_link(folder, &path)?;
                    files::write(&path, content)?;
                }
            }
        }
        match self {
            Self::Run(store) => store.write_manifest(manifest),
            Self::Shards(_) => Ok(()),
        }
    }
}

/// Refuses to write into a subfolder that is a symbolic link, because an untrusted folder of shards could redirect the
/// report elsewhere.
fn refuse_link(folder: &Path, path: &Path) -> Result<()> {
    match path.parent() {
        Some(inner) if inner != folder && inner.is_symlink() => Err(Error::data(
            inner.display(),
            "a link; the report would be written to where it leads. Delete the link, or name --out",
        )),
        _ => Ok(()),
    }
}

/// Calls `write` with the folder of a run; returns the text for standard output, or `None` with a warning if the folder
/// cannot be written to.
///
/// # Errors
/// If `write` fails for a run that could be opened for writing.
pub(super) fn write_in_place<D: Detail>(
    folder: &Path,
    layout: RunLayout,
    manifest: &RunManifest,
    write: impl FnOnce(&ReportFolder<'_, D>) -> Result<String>,
) -> Result<Option<String>> {
    let written = match layout {
        RunLayout::Whole => match Store::open_checked(folder, manifest, AddressChange::Allowed) {
            Ok(store) => return write(&ReportFolder::Run(&store)).map(Some),
            // A run that another process is writing, or in a read-only folder, is still reported on standard output.
            Err(error) => Err(error),
        },
        RunLayout::Shards => write(&ReportFolder::Shards(folder)),
    };
    Ok(match written {
        Ok(text) => Some(text),
        Err(error) => {
            tracing::warn!("the report is not written: {error}");
            None
        }
    })
}
