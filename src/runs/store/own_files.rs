//! Check that a run folder has no links: [`check_own`].
//!
//! A run folder may have been downloaded. Through a link in it, this program would write to a file or folder outside of
//! the run.

use std::ffi::OsStr;
use std::fs::{self, DirEntry, Metadata};
use std::path::Path;

use super::folder::{BATCH, BATCH_STATE, FIDELITY, RECORDS, THUMBNAILS};
use darkqa_base::error::{Error, Result};

/// The subfolders of a run with files that are appended to.
const INNER: [&str; 1] = [BATCH];
/// The files that are appended to. All others are replaced by new files, so that the target of a link stays unchanged.
const APPENDED: [&str; 4] = [RECORDS, THUMBNAILS, FIDELITY, BATCH_STATE];

/// Refuses a run folder in which a folder or a file that is appended to is a link, or an entry is a pipe or a device.
/// The folder itself may be reached by a link.
///
/// # Errors
/// Names the link.
pub(super) fn check_own(folder: &Path) -> Result<()> {
    check_entries(folder)?;
    for inner in INNER {
        let inner = folder.join(inner);
        if inner.is_dir() {
            check_entries(&inner)?;
        }
    }
    Ok(())
}

fn check_entries(folder: &Path) -> Result<()> {
    for entry in fs::read_dir(folder).map_err(|e| Error::file(folder, "read", e))? {
        let entry = entry.map_err(|e| Error::file(folder, "read", e))?;
        if let Some(what) = foreign_kind(&entry) {
            return Err(Error::Run {
                path: entry.path(),
                problem: format!(
                    "this is {what}, and what is written into the run would go there; put a file or folder of its own in its place, or use a \
                     copy of the run"
                ),
            });
        }
    }
    Ok(())
}

/// Description of an entry through which the program would write elsewhere; `None` for a regular entry.
fn foreign_kind(entry: &DirEntry) -> Option<&'static str> {
    let name = entry.file_name();
    // The metadata of the entry itself, without following a link.
    let own = entry.metadata().ok()?;
    if own.is_symlink() {
        let is_list = Path::new(&name).extension() == Some(OsStr::new("jsonl"));
        return (is_list || entry.path().is_dir()).then_some("a link");
    }
    if !own.is_file() && !own.is_dir() {
        return Some("a pipe or a device");
    }
    let is_appended = APPENDED.iter().any(|appended| name == *appended);
    (is_appended && own.is_file() && link_count(&own) > 1).then_some("a file with a second name (a hard link)")
}

/// The number of hard links of a file.
#[cfg(unix)]
fn link_count(file: &Metadata) -> u64 {
    std::os::unix::fs::MetadataExt::nlink(file)
}

/// 1, because the number of hard links is not available.
#[cfg(not(unix))]
fn link_count(_: &Metadata) -> u64 {
    1
}
