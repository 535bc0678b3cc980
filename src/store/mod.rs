//! Stage 6, KEEP: `results/<run>/`.
//!
//! `records.jsonl` is the truth: one line a trial, appended and handed to the operating system the moment a reply has
//! arrived, so that a killed run loses nothing. `manifest.json` says what the run is, `questions.jsonl` what it asks, and
//! `thumbnails.jsonl` has small copies of the images it showed; everything else is made again from these.

mod lines;

use std::collections::{BTreeSet, HashMap};
use std::ffi::OsStr;
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::Write;
use std::marker::PhantomData;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use crate::error::{Error, Result};
use crate::types::manifest::{ColumnDifference, RunManifest, differences};
use crate::types::{
    ChoiceDetail, Detail, QuestionId, Record, RunQuestion, Thumbnail, TrialKey, Via,
};

use lines::{append, json_lines, lines, mend};

const MANIFEST: &str = "manifest.json";
const RECORDS: &str = "records.jsonl";
/// The questions of a run, with their words and scenes.
const QUESTIONS: &str = "questions.jsonl";
/// Small copies of images that were sent.
const THUMBNAILS: &str = "thumbnails.jsonl";
/// The folder of batches in a run.
pub const BATCH: &str = "batch";
/// The trials that were sent in batches.
const TRIALS: &str = "trials.jsonl";
/// What the name of a file ends in until it is whole.
const UNFINISHED: &str = ".part";

/// How often records are forced to the disk itself: what a power cut, not a killed process, may cost.
const SYNC_EVERY: Duration = Duration::from_secs(2);

/// Whether a kept run may go on at another address of its endpoint.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Moved {
    /// It may: the user has named this run as the one to go on with, and says so that it is the same model.
    Allowed,
    /// It may not: another server may serve another model by the same name.
    Refused,
}

/// The field of a run's identity that holds the address.
const ADDRESS: &str = "--base-url";

/// An open run folder, held by this process alone.
#[derive(Debug)]
pub struct Store<D = ChoiceDetail> {
    folder: PathBuf,
    records: File,
    synced: Instant,
    kind: PhantomData<D>,
}

impl<D: Detail> Store<D> {
    /// Opens a run folder, which is made where it does not exist.
    ///
    /// A last line that was cut off while it was written is taken away, so that the next one begins a line.
    ///
    /// # Errors
    /// Where the folder holds something else, another run (the message names the flag that differs), a broken record, or
    /// is held by another process.
    pub fn open(folder: &Path, manifest: &RunManifest, moved: Moved) -> Result<Self> {
        match read_manifest(folder, D::SCHEMA)? {
            Some(kept) => agree(folder, &kept, manifest, moved)?,
            None => claim(folder, manifest)?,
        }
        let path = folder.join(RECORDS);
        let records = OpenOptions::new()
            .read(true)
            .append(true)
            .create(true)
            .open(&path)
            .map_err(|e| Error::file(&path, "open", e))?;
        records.try_lock().map_err(|e| match e {
            TryLockError::WouldBlock => Error::Run {
                path: folder.to_owned(),
                problem:
                    "another process is writing to this run; wait for it, or use another --out"
                        .to_owned(),
            },
            TryLockError::Error(e) => Error::file(&path, "lock", e),
        })?;
        mend(&path, &records)?;
        Ok(Self {
            folder: folder.to_owned(),
            records,
            synced: Instant::now(),
            kind: PhantomData,
        })
    }

    /// What the run holds: the last record of each trial, in the order of their first.
    pub fn records(&self) -> Result<Vec<Record<D>>> {
        read_records(&self.folder)
    }

    /// Takes note that these trials are out in a batch.
    pub fn append_to_batch(&mut self, records: &[Record<D>]) -> Result<()> {
        let path = self.folder.join(BATCH).join(TRIALS);
        append(&path, records)?
            .sync_all()
            .map_err(|e| Error::file(&path, "write", e))
    }

    /// Keeps a small copy of an image.
    pub fn append_thumbnail(&mut self, thumbnail: &Thumbnail) -> Result<()> {
        append(
            &self.folder.join(THUMBNAILS),
            std::slice::from_ref(thumbnail),
        )
        .map(drop)
    }

    /// Keeps the questions of the run, these and those that it had, in the order of the data.
    ///
    /// # Errors
    /// If one that it had is another by now: other words, choices, answer or image.
    pub fn add_questions(&self, questions: Vec<RunQuestion>) -> Result<()> {
        let kept = read_questions(&self.folder)?;
        let places: HashMap<&QuestionId, &RunQuestion> = questions
            .iter()
            .map(|question| (&question.id, question))
            .collect();
        let mut rest = Vec::new();
        for known in kept {
            match places.get(&known.id) {
                None => rest.push(known),
                Some(now) if known.is_same(now) => {}
                Some(_) => {
                    let problem = format!(
                        "the question {} is another in this run: its words, choices, answer or image were changed; use another --out",
                        known.id
                    );
                    let path = self.folder.clone();
                    return Err(Error::Run { path, problem });
                }
            }
        }
        drop(places);
        let mut all = [questions, rest].concat();
        all.sort_by_key(|question| question.place);
        self.write_questions(&all)
    }

    /// Keeps the questions of the run.
    pub fn write_questions(&self, questions: &[RunQuestion]) -> Result<()> {
        self.write(
            QUESTIONS,
            &json_lines(&self.folder.join(QUESTIONS), questions)?,
        )
    }

    /// The trials that were sent in batches, as they were before anything came of them, each as often as it was sent.
    pub fn batched(&self) -> Result<Vec<Record<D>>> {
        lines(&self.folder.join(BATCH).join(TRIALS))
    }

    /// The trials that are out in a batch: sent more often than a reply or a failure of theirs was taken over.
    pub fn out_in_batches(&self) -> Result<BTreeSet<TrialKey>> {
        let mut out = HashMap::<TrialKey, usize>::new();
        for record in self.batched()? {
            *out.entry(record.key).or_default() += 1;
        }
        for record in lines::<Record<D>>(&self.folder.join(RECORDS))? {
            if !record.failed() {
                out.remove(&record.key);
            } else if record.via == Via::Batch
                && let Some(times) = out.get_mut(&record.key)
            {
                *times = times.saturating_sub(1);
            }
        }
        let out = out.into_iter().filter(|(_, times)| *times > 0);
        Ok(out.map(|(key, _)| key).collect())
    }

    /// The run folder.
    #[must_use]
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Appends one record: once this returns, killing the process cannot lose it.
    pub fn append(&mut self, record: &Record<D>) -> Result<()> {
        let path = || self.folder.join(RECORDS);
        let mut line =
            serde_json::to_vec(record).map_err(|e| Error::file(path(), "write", e.into()))?;
        line.push(b'\n');
        self.records
            .write_all(&line)
            .map_err(|e| Error::file(path(), "write", e))?;
        if self.synced.elapsed() >= SYNC_EVERY {
            self.sync()
        } else {
            Ok(())
        }
    }

    /// Forces all records to the disk.
    pub fn sync(&mut self) -> Result<()> {
        self.synced = Instant::now();
        self.records
            .sync_data()
            .map_err(|e| Error::file(self.folder.join(RECORDS), "write", e))
    }

    /// Writes the manifest.
    pub fn write_manifest(&self, manifest: &RunManifest) -> Result<()> {
        write_manifest(&self.folder, manifest)
    }

    /// Writes a file into the run folder, whole or not at all; one that already says this is left as it is.
    pub fn write(&self, name: &str, content: &[u8]) -> Result<()> {
        write(&self.folder, name, content)
    }
}

/// Writes a file into a folder, whole or not at all; one that already says this is left as it is.
fn write(folder: &Path, name: &str, content: &[u8]) -> Result<()> {
    if fs::read(folder.join(name)).is_ok_and(|there| there == content) {
        return Ok(());
    }
    let path = folder.join(name);
    let own = path.file_name().unwrap_or_default().to_string_lossy();
    let unfinished = path.with_file_name(format!(".{own}{UNFINISHED}"));
    if let Some(parent) = path.parent() {
        fs::create_dir_all(parent).map_err(|e| Error::file(parent, "create", e))?;
    }
    let written = File::create(&unfinished).and_then(|mut file| {
        file.write_all(content)?;
        file.sync_all()
    });
    written.map_err(|e| Error::file(&unfinished, "write", e))?;
    fs::rename(&unfinished, &path).map_err(|e| Error::file(&path, "write", e))
}

fn write_manifest(folder: &Path, manifest: &RunManifest) -> Result<()> {
    let unwritten = |e: serde_json::Error| Error::file(folder.join(MANIFEST), "write", e.into());
    let mut text = serde_json::to_vec_pretty(manifest).map_err(unwritten)?;
    text.push(b'\n');
    write(folder, MANIFEST, &text)
}

/// What a run folder holds: the last record of each trial, in the order of their first; a last line that was cut off while it
/// was written is passed over.
pub fn read_records<D: Detail>(folder: &Path) -> Result<Vec<Record<D>>> {
    let mut latest = HashMap::<TrialKey, usize>::new();
    let mut records: Vec<Record<D>> = Vec::new();
    for record in lines::<Record<D>>(&folder.join(RECORDS))? {
        if let Some(&index) = latest.get(&record.key) {
            records[index] = record;
        } else {
            latest.insert(record.key, records.len());
            records.push(record);
        }
    }
    Ok(records)
}

/// The questions of a run; none where it was made by a version that kept none.
pub fn read_questions(folder: &Path) -> Result<Vec<RunQuestion>> {
    lines(&folder.join(QUESTIONS))
}

/// The small copies of images of a run; none where it kept none.
pub fn read_thumbnails(folder: &Path) -> Result<Vec<Thumbnail>> {
    lines(&folder.join(THUMBNAILS))
}

/// The newest run folder in `base` whose name ends in `-<hash>`.
#[must_use]
pub fn find(base: &Path, hash: &str) -> Option<PathBuf> {
    let ending = format!("-{hash}");
    let folders = fs::read_dir(base).ok()?.flatten().map(|entry| entry.path());
    folders
        .filter(|path| {
            path.file_name()
                .and_then(OsStr::to_str)
                .is_some_and(|name| name.ends_with(&ending))
        })
        .filter(|path| path.join(MANIFEST).is_file())
        .max()
}

/// The schema of the run in a folder; `None` where there is none.
///
/// # Errors
/// Where its manifest cannot be read.
pub fn schema(folder: &Path) -> Result<Option<String>> {
    Ok(any_manifest(folder)?.map(|manifest| manifest.schema))
}

/// The manifest of a run folder; `None` where there is none.
///
/// # Errors
/// Where it cannot be read, or is that of a run with other records than those of `schema`.
pub fn read_manifest(folder: &Path, schema: &str) -> Result<Option<RunManifest>> {
    let Some(manifest) = any_manifest(folder)? else {
        return Ok(None);
    };
    if manifest.schema == schema {
        return Ok(Some(manifest));
    }
    let problem = refusal(&manifest.schema, schema, &manifest.version);
    let path = folder.join(MANIFEST);
    Err(Error::Run { path, problem })
}

/// Why a run of one schema is not taken where another is expected.
fn refusal(found: &str, expected: &str, version: &str) -> String {
    let parts = |schema: &str| -> Option<(String, u32)> {
        let (name, number) = schema.rsplit_once('/')?;
        Some((name.to_owned(), number.parse().ok()?))
    };
    // The number is that of the program's version: it rises for runs of all kinds at once.
    let newest = parts(expected).map_or(0, |(_, number)| number);
    match parts(found) {
        Some((name, number)) if KINDS.contains(&&*name) && number < newest => format!(
            "this run was made by an earlier version of darkqa-eval ({version}, schema {found:?}); run it again with this one"
        ),
        Some((name, number)) if KINDS.contains(&&*name) && number == newest => format!(
            "the run has the schema {found:?}, {expected:?} is expected here; use another folder"
        ),
        _ => format!(
            "the schema {found:?} is not known to this version of darkqa-eval; the run was made by version {version}: read it with that"
        ),
    }
}

/// The kinds of runs, by the names of their schemas.
const KINDS: [&str; 2] = ["darkqa.run", "darkqa.openeqa"];

fn any_manifest(folder: &Path) -> Result<Option<RunManifest>> {
    let path = folder.join(MANIFEST);
    let text = match fs::read(&path) {
        Ok(text) => text,
        Err(e)
            if matches!(
                e.kind(),
                std::io::ErrorKind::NotFound | std::io::ErrorKind::NotADirectory
            ) =>
        {
            return Ok(None);
        }
        Err(e) => return Err(Error::file(path, "read", e)),
    };
    serde_json::from_slice(&text)
        .map(Some)
        .map_err(|e| Error::Run {
            path: path.clone(),
            problem: format!("not the manifest of a run: {e}"),
        })
}

/// Makes sure that a kept run is the one now asked for: the same identity, and every known value of a column what it was.
fn agree(folder: &Path, kept: &RunManifest, now: &RunManifest, moved: Moved) -> Result<()> {
    let wrong = |problem: String| {
        let path = folder.to_owned();
        Err(Error::Run { path, problem })
    };
    if let Some((field, before, after)) = differences(&kept.identity, &now.identity).next() {
        return wrong(format!(
            "this run has another {field}: it was {before}, now it is {after}; use another --out, or the same {field}"
        ));
    }
    if kept.shard != now.shard {
        let [before, after] = [kept, now].map(|run| run.shard.as_deref().unwrap_or("none"));
        return wrong(format!(
            "this run has another --shard: it was {before}, now it is {after}; use another --out, or the same --shard"
        ));
    }
    for difference in kept.column_differences(now) {
        let ColumnDifference {
            column,
            value,
            field,
            first: before,
            second: after,
        } = difference;
        let address = field == ADDRESS;
        if address && moved == Moved::Allowed {
            tracing::warn!("{value} was asked at {before} in this run; it goes on at {after}");
            continue;
        }
        let hint = if address {
            " (the same model at another address: --resume)"
        } else {
            ""
        };
        return wrong(format!(
            "the {column} {value} has another {field} in this run: it was {before}, now it is {after}; use another --out, or the same \
             {field}{hint}"
        ));
    }
    Ok(())
}

/// Makes a new folder, or takes an empty one, and marks it as a run before anything else lies in it.
fn claim(folder: &Path, manifest: &RunManifest) -> Result<()> {
    fs::create_dir_all(folder).map_err(|e| Error::file(folder, "create", e))?;
    let mut inside = fs::read_dir(folder).map_err(|e| Error::file(folder, "read", e))?;
    // What a process killed in the midst of writing has left is nobody's.
    let unfinished = |name: &OsStr| name.to_string_lossy().ends_with(UNFINISHED);
    if inside.any(|entry| entry.is_ok_and(|entry| !unfinished(&entry.file_name()))) {
        let problem = "the folder is not empty and holds no run; use another --out".to_owned();
        return Err(Error::Run {
            path: folder.to_owned(),
            problem,
        });
    }
    write_manifest(folder, manifest)
}

#[cfg(test)]
mod tests;
