//! Whether the report in the folder of a run is still that of its records: [`Stamp`], in `report.stamp`. A large run that
//! is continued with nothing left to ask is then neither scored nor reported again.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::text::terminal::terminal_columns;
use darkqa_base::error::{Error, Result};
use darkqa_base::files;
use darkqa_base::types::Digest;
use darkqa_base::types::manifests::RunManifest;
use darkqa_runs::outcome::{Outcome, StdoutFormat};
use darkqa_score::answers::record::Detail;
use darkqa_store::{IndexedStart, NOTE_FILES, Store, program_build};

/// The file of the stamp.
pub const STAMP: &str = "report.stamp";

/// What a report was made from, and what was made.
#[derive(Debug, Serialize, Deserialize)]
struct Stamp {
    /// The digest of everything that decides the report and its text.
    inputs: Digest,
    /// The digest of each file of the report, by its name.
    files: BTreeMap<String, Digest>,
    /// The text for standard output.
    text: String,
}

/// Notes what a report was made from: its `files`, by name, and its text. Runs without an index of all records have no
/// stamp.
///
/// # Errors
/// If a file cannot be read or written.
pub(super) fn write<D: Detail>(
    store: &Store<D>,
    manifest: &RunManifest,
    show: StdoutFormat,
    files: Vec<String>,
    text: &str,
) -> Result<()> {
    let Some(log) = IndexedStart::stated_digest::<D>(store.folder()) else {
        return Ok(());
    };
    let stamp = Stamp {
        inputs: inputs(store, log, manifest, show)?,
        files: files
            .into_iter()
            .map(|name| {
                let digest = Digest::from_bytes(&files::bytes(&store.folder().join(&name))?);
                Ok((name, digest))
            })
            .collect::<Result<_>>()?,
        text: text.to_owned(),
    };
    let content = serde_json::to_vec(&stamp).map_err(|e| Error::data(STAMP, e))?;
    store.write(STAMP, &content)
}

/// The outcome of a report that would be made from the same inputs as the one in the folder of a run; `None` if an input
/// or a file of the report has changed.
///
/// # Errors
/// If a file of the run cannot be read.
pub fn unchanged<D: Detail>(store: &Store<D>, manifest: &RunManifest, show: StdoutFormat) -> Result<Option<Outcome>> {
    let folder = store.folder();
    let log = store.indexed().and_then(|indexed| indexed.digest_of_whole(folder));
    let stamp = files::read(&folder.join(STAMP)).ok().and_then(|text| serde_json::from_slice::<Stamp>(&text).ok());
    let (Some(log), Some(stamp)) = (log, stamp) else {
        return Ok(None);
    };
    let is_same = |(name, digest): (&String, &Digest)| {
        files::read(&folder.join(name)).is_ok_and(|content| Digest::from_bytes(&content) == *digest)
    };
    if stamp.inputs != inputs(store, log, manifest, show)? || !stamp.files.iter().all(is_same) {
        return Ok(None);
    }
    Ok(Some(Outcome::wrote(folder, manifest.status, stamp.text).in_format(show)))
}

/// The digest of everything that decides the report on a run, given the digest of its records.
fn inputs<D: Detail>(store: &Store<D>, log: Digest, manifest: &RunManifest, show: StdoutFormat) -> Result<Digest> {
    let folder = store.folder();
    let described = (program_build(), folder.display().to_string(), terminal_columns(), show, log, manifest);
    let described = serde_json::to_vec(&described).map_err(|e| Error::data(STAMP, e))?;
    // A file that does not exist counts as an empty one.
    let notes = NOTE_FILES.map(|name| files::read(&folder.join(name)).unwrap_or_default());
    Ok(Digest::from_parts(std::iter::once(&*described).chain(notes.iter().map(Vec::as_slice))))
}
