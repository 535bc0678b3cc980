//! Where the report of one run goes: [`ReportFolder`], [`write_in_place`].

use std::path::Path;

use crate::error::{Error, Result};
use crate::files;
use crate::runs::stored::RunLayout;
use crate::store::{AddressChange, Store};
use crate::types::manifests::RunManifest;
use darkqa_score::answers::record::Detail;

/// The folder that the report of one run is written into.
pub(super) enum ReportFolder<'a, D: Detail> {
    /// The folder of the run.
    Run(&'a Store<D>),
    /// The folder of its parts. Each part has its own manifest, so that the folder is no run.
    Parts(&'a Path),
}

impl<D: Detail> ReportFolder<'_, D> {
    /// Its path.
    pub(super) fn path(&self) -> &Path {
        match self {
            Self::Run(store) => store.folder(),
            Self::Parts(folder) => folder,
        }
    }

    /// Writes the files of a report, and the manifest that the run has now.
    ///
    /// # Errors
    /// If a file cannot be written.
    pub(super) fn write(
        &self,
        contents: &[(String, Vec<u8>)],
        manifest: &RunManifest,
    ) -> Result<()> {
        for (name, content) in contents {
            match self {
                Self::Run(store) => store.write(name, content)?,
                Self::Parts(folder) => {
                    let path = folder.join(name);
                    refuse_link(folder, &path)?;
                    files::write(&path, content)?;
                }
            }
        }
        match self {
            Self::Run(store) => store.write_manifest(manifest),
            Self::Parts(_) => Ok(()),
        }
    }
}

/// Refuses to write into a subfolder that is a link: a folder of parts may come from a stranger, and the link may lead anywhere.
fn refuse_link(folder: &Path, path: &Path) -> Result<()> {
    match path.parent() {
        Some(inner) if inner != folder && inner.is_symlink() => Err(Error::data(
            inner.display(),
            "a link; the report would be written to where it leads. Delete the link, or name --out",
        )),
        _ => Ok(()),
    }
}

/// Has the report of one run written where its files are; returns the text for standard output, or `None` if that folder cannot be
/// written to, which is said.
///
/// # Errors
/// If the report cannot be made.
pub(super) fn write_in_place<D: Detail>(
    (folder, layout): (&Path, RunLayout),
    manifest: &RunManifest,
    write: impl FnOnce(&ReportFolder<'_, D>) -> Result<String>,
) -> Result<Option<String>> {
    let written = match layout {
        RunLayout::Whole => match Store::open_read(folder, manifest, AddressChange::Allowed) {
            Ok(store) => return write(&ReportFolder::Run(&store)).map(Some),
            // A run that another process writes, or in a read-only folder, is shown anyway.
            Err(error) => Err(error),
        },
        RunLayout::Parts => write(&ReportFolder::Parts(folder)),
    };
    Ok(match written {
        Ok(text) => Some(text),
        Err(error) => {
            tracing::warn!("the report is not written: {error}");
            None
        }
    })
}
