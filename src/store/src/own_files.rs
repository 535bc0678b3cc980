//! Check that a run folder has no links, so that writing changes no file elsewhere: [`check_own`].
//!
//! A run folder may come from a stranger. A link in it would have this program write into a file or a folder outside of it.

use std::ffi::OsStr;
use std::fs::{self, DirEntry, Metadata};
use std::path::Path;

use super::folder::{BATCH, BATCH_STATE, FIDELITY, RECORDS, THUMBNAILS};
use darkqa_ground::error::{Error, Result};

/// The subfolders of a run that lines are appended in.
const INNER: [&str; 1] = [BATCH];
/// The files that are appended to. All others are replaced by new files, so that the target of a link stays unchanged.
const APPENDED: [&str; 4] = [RECORDS, THUMBNAILS, FIDELITY, BATCH_STATE];

/// Refuses a run folder in which a folder or a file that is appended to is a link, or an entry is a pipe or a device. The folder itself
/// may be reached by a link.
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
    let unreadable = |e| Error::file(folder, "read", e);
    for entry in fs::read_dir(folder).map_err(unreadable)? {
        let entry = entry.map_err(unreadable)?;
        if let Some(what) = foreign(&entry) {
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

/// Kind of an entry that would redirect writing elsewhere; `None` for a regular one.
fn foreign(entry: &DirEntry) -> Option<&'static str> {
    let name = entry.file_name();
    // Without following links.
    let own = entry.metadata().ok()?;
    if own.is_symlink() {
        let is_list = Path::new(&name).extension() == Some(OsStr::new("jsonl"));
        return (is_list || entry.path().is_dir()).then_some("a link");
    }
    if !own.is_file() && !own.is_dir() {
        return Some("a pipe or a device");
    }
    let is_appended = APPENDED.iter().any(|appended| name == *appended);
    (is_appended && own.is_file() && names(&own) > 1)
        .then_some("a file with a second name (a hard link)")
}

/// The number of names of a file.
#[cfg(unix)]
fn names(file: &Metadata) -> u64 {
    std::os::unix::fs::MetadataExt::nlink(file)
}

/// The number of names of a file; not known here.
#[cfg(not(unix))]
fn names(_: &Metadata) -> u64 {
    1
}
