//! The files of a run folder, and the check that a folder belongs to the requested run.
//!
//! Check that a run folder has no links: [`check_own`].
//!
//! A run folder may have been downloaded. Through a link in it, this program would write to a file or folder outside of
//! the run.

use std::collections::{BTreeMap, HashSet};
use std::ffi::OsStr;
use std::fs::{self, DirEntry, Metadata, TryLockError};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use jiff::Timestamp;
use rayon::slice::ParallelSliceMut;
use serde_json::Value;

use super::lines::{StoredLine, each_line, each_placed_line, each_readable_line, lines, set_file_aside};
use super::pieces::{LinePlace, open_if_exists};
use super::stored_trial::StoredTrial;
use darkqa_base::error::{Error, Result};
use darkqa_base::files::{self, FolderAccess, is_unfinished};
use darkqa_base::types::flags::setting_spelling;
use darkqa_base::types::manifests::{
    ColumnDifference, Columns, JUDGES, RecordedNames, RunManifest, differences, judge_flag,
};
use darkqa_base::types::{Distinct, ImageFidelity, Record, RunQuestion, Thumbnail, TrialKey};
use darkqa_score::answers::record::Detail;

/// The current time in UTC, to the second, as a manifest states it.
pub fn now() -> String {
    Timestamp::now().strftime("%Y-%m-%dT%H:%M:%SZ").to_string()
}

/// The file of a run's manifest.
pub const MANIFEST: &str = "manifest.json";
pub(super) const RECORDS: &str = "records.jsonl";

/// The file of a run's questions, with their texts and scenes.
pub(super) const QUESTIONS: &str = "questions.jsonl";

/// The file of small copies of the images that were sent.
pub(super) const THUMBNAILS: &str = "thumbnails.jsonl";

/// The file of similarities of images to their clean frames.
pub(super) const FIDELITY: &str = "fidelity.jsonl";

/// The files of a run that reports read.
pub const RUN_FILES: [&str; 5] = [MANIFEST, RECORDS, QUESTIONS, THUMBNAILS, FIDELITY];

/// The files of a run that reports read, besides its manifest and its records.
pub const NOTE_FILES: [&str; 3] = [QUESTIONS, THUMBNAILS, FIDELITY];

/// The subfolder of a run for Batch API files.
pub const BATCH: &str = "batch";

/// The file with the state of each batch.
pub const BATCH_STATE: &str = "state.jsonl";

/// The subfolder of a run for its plan, which is written before the run.
pub const PLAN: &str = "plan";

/// Whether a stored run may continue with another address of a model's endpoint.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AddressChange {
    /// Accept the new address: the user named this run (`--resume`), which states that it is the same model.
    Allowed,
    /// Refuse it: a different server may serve a different model under the same name.
    Refused,
}

/// The column of models.
const MODEL: &str = "model";

/// The field of a model's entry in the manifest with the address.
const ADDRESS: &str = "--base-url";

/// The field of an enhancer with the digest of its file and its sidecar.
const ENHANCER_FILE: &str = "--llie";

/// Writes a file into a folder, completely or not at all; a file with the same content is left untouched.
pub(super) fn write(folder: &Path, name: &str, content: &[u8]) -> Result<()> {
    if files::read(&folder.join(name)).is_ok_and(|existing| existing == content) {
        return Ok(());
    }
    files::write_synced(&folder.join(name), content)
}

pub(super) fn write_manifest(folder: &Path, manifest: &RunManifest) -> Result<()> {
    let mut text =
        serde_json::to_vec_pretty(manifest).map_err(|e| Error::file(folder.join(MANIFEST), "write", e.into()))?;
    text.push(b'\n');
    write(folder, MANIFEST, &text)
}

/// The last record of each trial in a run folder, in the order of each trial's first record. An incomplete last line is
/// skipped.
pub fn read_records<D: Detail>(folder: &Path) -> Result<Vec<Record<D>>> {
    let mut records: Vec<Record<D>> = Vec::new();
    each_line(&folder.join(RECORDS), |record| records.push(record))?;
    let merged = merge_by_key(
        records,
        |record| record.key,
        |last, earlier| {
            // A failure does not replace a reply.
            if last.failed() && !earlier.failed() {
                last.clone_from(earlier);
            }
        },
    );
    Ok(merged)
}

/// Keeps the last line of each key, at the place of the first line of that key. `add_earlier` merges each earlier line
/// of the key into it, the latest first.
pub(super) fn merge_by_key<T>(
    mut all: Vec<T>,
    key: impl Fn(&T) -> TrialKey,
    add_earlier: impl Fn(&mut T, &T),
) -> Vec<T> {
    // Sorted keys take a fifth of the memory of a map.
    let mut keys: Vec<(TrialKey, u32)> = all.iter().map(key).zip(0..).collect();
    keys.par_sort_unstable();
    let mut is_repeated = vec![false; all.len()];
    for places in keys.chunk_by(|one, next| one.0 == next.0).filter(|places| places.len() > 1) {
        let (first, last) = (places[0].1 as usize, places[places.len() - 1].1 as usize);
        for (_, place) in places[..places.len() - 1].iter().rev() {
            let (earlier, later) = all.split_at_mut(last);
            add_earlier(&mut later[0], &earlier[*place as usize]);
        }
        all.swap(first, last);
        for (_, place) in &places[1..] {
            is_repeated[*place as usize] = true;
        }
    }
    let mut is_repeated = is_repeated.into_iter();
    all.retain(|_| is_repeated.next() == Some(false));
    all
}

/// The questions of a run; empty for runs of earlier versions, which did not store them.
pub fn read_questions(folder: &Path) -> Result<Vec<RunQuestion>> {
    lines(&folder.join(QUESTIONS))
}

/// Calls `take` with each question of a run in order; with none for runs of earlier versions, which did not store them.
pub fn each_question(folder: &Path, take: impl FnMut(RunQuestion)) -> Result<()> {
    each_line(&folder.join(QUESTIONS), take)
}

/// Calls `take` with each question of a run in order and the place of its line.
pub fn each_placed_question(folder: &Path, take: impl FnMut(RunQuestion, LinePlace)) -> Result<()> {
    each_placed_line(&folder.join(QUESTIONS), take)
}

/// The small copies of images of a run; empty without such a file. Damaged lines are skipped with a warning.
#[must_use]
pub fn read_thumbnails(folder: &Path) -> Vec<Thumbnail> {
    let mut all = Vec::new();
    each_readable_note(&folder.join(THUMBNAILS), |thumbnail| all.push(thumbnail));
    all
}

/// The similarities of the images of a run to their clean frames; empty without such a file. Equal frames and
/// conditions share memory. Damaged lines are skipped with a warning.
#[must_use]
pub fn read_fidelity(folder: &Path) -> Vec<ImageFidelity> {
    let (mut frames, mut conditions) = (Distinct::default(), Distinct::default());
    let mut all: Vec<ImageFidelity> = Vec::new();
    each_readable_note(&folder.join(FIDELITY), |mut image: ImageFidelity| {
        frames.share(&mut image.frame);
        conditions.share(&mut image.condition);
        all.push(image);
    });
    all
}

/// Calls `take` with each readable note about images; warns about others, which a report then lacks.
fn each_readable_note<T: StoredLine>(path: &Path, take: impl FnMut(T)) {
    if let Some(damage) = each_readable_line(path, take) {
        tracing::warn!("{damage}; left out: the command that made the run makes it again");
    }
}

/// The newest run folder in `base` whose name ends in `-<hash>`.
#[must_use]
pub fn find(base: &Path, hash: &str) -> Option<PathBuf> {
    let ending = format!("-{hash}");
    fs::read_dir(base)
        .ok()?
        .flatten()
        .map(|entry| entry.path())
        .filter(|path| path.file_name().and_then(OsStr::to_str).is_some_and(|name| name.ends_with(&ending)))
        .filter(|path| is_run(path) || path.join(RECORDS).is_file())
        .max()
}

/// True if a folder contains the manifest of a run.
pub fn is_run(folder: &Path) -> bool {
    folder.join(MANIFEST).is_file()
}

/// True if another process writes to a run folder.
///
/// # Errors
/// If its records cannot be opened.
pub fn is_locked(folder: &Path) -> Result<bool> {
    let path = folder.join(RECORDS);
    let Some(records) = open_if_exists(&path)? else {
        return Ok(false);
    };
    match records.try_lock_shared() {
        Err(TryLockError::WouldBlock) => Ok(true),
        // Unknown on a file system without locks.
        Ok(()) | Err(TryLockError::Error(_)) => Ok(false),
    }
}

/// The schema of the run in a folder; `None` if the folder has no manifest.
///
/// # Errors
/// If the manifest cannot be read.
pub fn schema(folder: &Path) -> Result<Option<String>> {
    Ok(any_manifest(folder)?.map(|manifest| manifest.schema))
}

/// The manifest of a run folder; `None` if there is none.
///
/// # Errors
/// If it cannot be read, or if its schema is not `schema`.
pub fn read_manifest(folder: &Path, schema: &str) -> Result<Option<RunManifest>> {
    let Some(manifest) = any_manifest(folder)? else {
        return Ok(None);
    };
    if manifest.schema == schema {
        return Ok(Some(manifest));
    }
    let problem = schema_problem(&manifest.schema, schema, &manifest.version);
    let path = folder.join(MANIFEST);
    Err(Error::Run { path, problem })
}

/// The columns in the manifest of a run of any kind; none without a manifest.
pub fn read_columns(folder: &Path) -> Result<Columns> {
    Ok(any_manifest(folder)?.map_or_else(Columns::default, |manifest| manifest.columns))
}

/// The settings in the manifest of a run of any kind; none without a manifest.
pub fn read_settings(folder: &Path) -> Result<BTreeMap<String, Value>> {
    Ok(any_manifest(folder)?.map_or_else(BTreeMap::new, |manifest| manifest.settings))
}

/// The error text for a run with another schema than expected.
fn schema_problem(found: &str, expected: &str, version: &str) -> String {
    // All kinds of runs share one schema number, which is raised with the program's version.
    let newest = schema_parts(expected).map_or(0, |(_, number)| number);
    match schema_parts(found) {
        Some((name, number)) if KINDS.contains(&name) && number < newest => format!(
            "this run was made by an earlier version of darkqa-eval ({version}, schema {found:?}); run it again with this one"
        ),
        Some((name, number)) if KINDS.contains(&name) && number == newest => {
            format!("the run has the schema {found:?}, {expected:?} is expected here; use another folder")
        }
        _ => format!(
            "the schema {found:?} is not known to this version of darkqa-eval; the run was made by version {version}: read it with that"
        ),
    }
}

/// The name and number of a schema such as `darkqa.run/2`.
fn schema_parts(schema: &str) -> Option<(&str, u32)> {
    let (name, number) = schema.rsplit_once('/')?;
    Some((name, number.parse().ok()?))
}

/// The kinds of runs, by the names of their schemas.
const KINDS: [&str; 2] = ["darkqa.run", "darkqa.openeqa"];

/// Size limit of a manifest, in bytes. Chosen: a manifest of thousands of frames and models has a hundredth of it.
const MAX_MANIFEST_BYTES: u64 = 64 << 20;

fn any_manifest(folder: &Path) -> Result<Option<RunManifest>> {
    let path = folder.join(MANIFEST);
    // `NotADirectory` means that a parent of the path is a file.
    if let Err(e) = fs::symlink_metadata(&path)
        && matches!(e.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory)
    {
        return Ok(None);
    }
    let text = files::at_most(&path, MAX_MANIFEST_BYTES)?;
    serde_json::from_slice(&text).map(Some).map_err(|e| Error::Run {
        path: path.clone(),
        problem: format!("not the manifest of a run: {e}; the command that made the run, called again, makes it again"),
    })
}

/// Description of the damage if a run has records, but its manifest is missing or cannot be read.
///
/// # Errors
/// If the records cannot be opened.
pub fn manifest_damage(folder: &Path) -> Result<Option<String>> {
    let has_records = open_if_exists(&folder.join(RECORDS))?.is_some();
    Ok(match any_manifest(folder) {
        _ if !has_records => None,
        Ok(Some(_)) => None,
        Ok(None) => Some(format!("{}: missing", folder.join(MANIFEST).display())),
        Err(_) => Some(format!("{}: damaged", folder.join(MANIFEST).display())),
    })
}

/// Writes the manifest of a run that has lost its own; a damaged one is set aside.
///
/// # Errors
/// If a file cannot be written.
pub fn restore_manifest(folder: &Path, manifest: &RunManifest) -> Result<()> {
    let path = folder.join(MANIFEST);
    if fs::symlink_metadata(&path).is_ok() {
        set_file_aside(&path)?;
    }
    write_manifest(folder, manifest)
}

/// Checks that a stored run is the requested one: equal identity, equal shard, and the same meaning of every column
/// value that both contain.
///
/// # Errors
/// [`Error::Run`], which names the setting that differs.
pub fn check_same_run(
    folder: &Path,
    stored: &RunManifest,
    requested: &RunManifest,
    address_change: AddressChange,
) -> Result<()> {
    if let Some((field, before, after)) = differences(&stored.identity, &requested.identity).next() {
        let field = setting_spelling(field);
        return run_error(
            folder,
            format!(
                "this run has another {field}: it was {before}, now it is {after}; use another --out, or the same {field}"
            ),
        );
    }
    if stored.shard != requested.shard {
        let [before, after] = [stored, requested].map(|run| run.shard.as_deref().unwrap_or("none"));
        return run_error(
            folder,
            format!(
                "this run has another --shard: it was {before}, now it is {after}; use another --out, or the same --shard"
            ),
        );
    }
    for difference in stored.column_differences(requested) {
        let ColumnDifference { column, value, field, first: before, second: after } = difference;
        // If the requested run contains the stored model under another name, the model was renamed.
        let mut renamed = requested.columns.get(column).into_iter().flatten().filter(|(name, _)| *name != value);
        let content = stored.columns.get(column).and_then(|values| values.get(value));
        if column == MODEL && renamed.any(|(_, other)| Some(other) == content) {
            continue;
        }
        let is_address = field == ADDRESS;
        let flag = match column {
            JUDGES => setting_spelling(&judge_flag(&field)),
            _ => setting_spelling(&field),
        };
        // An address without a reply, such as a mistyped one, may always change.
        let is_allowed = address_change == AddressChange::Allowed;
        if is_address && (is_allowed || !has_reply(folder, stored, value)?) {
            tracing::warn!("{value} was asked at {before} in this run; from now on it is asked at {after}");
            continue;
        }
        if field == ENHANCER_FILE {
            return run_error(
                folder,
                format!(
                    "the {column} {value} ({flag}) is another one in this run: its file, its sidecar or its preset was changed since ({before} before, \
                 {after} now); restore it, or use another --out"
                ),
            );
        }
        let hint = if is_address { " (the same model at another address: --resume)" } else { "" };
        return run_error(
            folder,
            format!(
                "the {column} {value} has another {flag} in this run: it was {before}, now it is {after}; use another --out, or the same \
             {flag}{hint}"
            ),
        );
    }
    Ok(())
}

fn run_error(folder: &Path, problem: String) -> Result<()> {
    let path = folder.to_owned();
    Err(Error::Run { path, problem })
}

/// True if a run has a reply of a model, or may get one from a batch.
fn has_reply(folder: &Path, stored: &RunManifest, model: &str) -> Result<bool> {
    Ok(has_batches(folder) || count_replies(folder, stored, model)? > 0)
}

/// True if a run has files of batches, from which replies may come.
#[must_use]
pub fn has_batches(folder: &Path) -> bool {
    folder.join(BATCH).exists()
}

/// Number of trials of a model with a reply in a run of any kind; 0 without a run.
///
/// # Errors
/// If the manifest or the records cannot be read.
pub fn reply_count(folder: &Path, model: &str) -> Result<usize> {
    any_manifest(folder)?.map_or(Ok(0), |stored| count_replies(folder, &stored, model))
}

/// Number of trials of a model with a reply.
fn count_replies(folder: &Path, stored: &RunManifest, model: &str) -> Result<usize> {
    let names = RecordedNames::from_manifest(stored);
    let mut answered = HashSet::new();
    each_line(&folder.join(RECORDS), |trial: StoredTrial| {
        if !trial.failed() && names.table_name(&trial.model) == model {
            answered.insert(trial.key);
        }
    })?;
    Ok(answered.len())
}

/// Creates a run in a new or empty folder: writes the manifest before any other file. A new folder is private to this
/// user.
pub(super) fn create_run(folder: &Path, manifest: &RunManifest) -> Result<()> {
    FolderAccess::Private.create(folder)?;
    let inside = fs::read_dir(folder).map_err(|e| Error::file(folder, "read", e))?;
    // Unfinished files of a killed process and the plan of the run do not count.
    let has_files = inside.flatten().map(|entry| entry.file_name()).any(|name| !is_unfinished(&name) && name != PLAN);
    if has_files {
        let problem = "the folder is not empty and holds no run; use another --out".to_owned();
        return Err(Error::Run { path: folder.to_owned(), problem });
    }
    write_manifest(folder, manifest)
}

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
