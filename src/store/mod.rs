//! Stage 6, KEEP: `results/<run>/`.
//!
//! `records.jsonl` is the truth: one line a trial, appended and handed to the operating system the moment a reply has
//! arrived, so that a killed run loses nothing. `manifest.json` says what the run is, `questions.jsonl` what it asks, and
//! `thumbnails.jsonl` has small copies of the images it showed; everything else is made again from these.

mod folder;
mod lines;

use std::collections::{BTreeSet, HashMap};
use std::fs::{File, OpenOptions, TryLockError};
use std::io::Write;
use std::marker::PhantomData;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use crate::error::{Error, Result};
use crate::types::manifest::RunManifest;
use crate::types::{
    ChoiceDetail, Detail, QuestionId, Record, RunQuestion, Thumbnail, TrialKey, Via,
};

use folder::{QUESTIONS, RECORDS, THUMBNAILS, agree, claim, write, write_manifest};
use lines::{append, json_lines, lines, mend};

pub(crate) use folder::{
    AddressChange, find, read_manifest, read_questions, read_records, read_thumbnails, schema,
};

/// The folder of batches in a run.
pub(crate) const BATCH: &str = "batch";
/// The trials that were sent in batches.
const TRIALS: &str = "trials.jsonl";

/// How often records are forced to the disk itself: what a power cut, not a killed process, may cost.
const SYNC_EVERY: Duration = Duration::from_secs(2);

/// An open run folder, held by this process alone.
#[derive(Debug)]
pub(crate) struct Store<D = ChoiceDetail> {
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
    pub(crate) fn open(
        folder: &Path,
        manifest: &RunManifest,
        moved: AddressChange,
    ) -> Result<Self> {
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
    pub(crate) fn records(&self) -> Result<Vec<Record<D>>> {
        read_records(&self.folder)
    }

    /// Takes note that these trials are out in a batch.
    pub(crate) fn append_to_batch(&mut self, records: &[Record<D>]) -> Result<()> {
        let path = self.folder.join(BATCH).join(TRIALS);
        append(&path, records)?
            .sync_all()
            .map_err(|e| Error::file(&path, "write", e))
    }

    /// Keeps a small copy of an image.
    pub(crate) fn append_thumbnail(&mut self, thumbnail: &Thumbnail) -> Result<()> {
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
    pub(crate) fn add_questions(&self, mut questions: Vec<RunQuestion>) -> Result<()> {
        let ids = questions.iter().map(|question| question.id.clone());
        let places: HashMap<QuestionId, usize> = ids.zip(0..).collect();
        for known in read_questions(&self.folder)? {
            let Some(&place) = places.get(&known.id) else {
                questions.push(known);
                continue;
            };
            let now = &mut questions[place];
            if !known.is_same(now) {
                let problem = format!(
                    "the question {} is another in this run: other --data or --questions have changed its words, choices, answer or \
                     image; use another --out",
                    known.id
                );
                let path = self.folder.clone();
                return Err(Error::Run { path, problem });
            }
            // Who asks blind models alone has not looked at the image.
            now.image = now.image.or(known.image);
        }
        questions.sort_by_key(|question| question.place);
        self.write_questions(&questions)
    }

    /// Keeps the questions of the run.
    pub(crate) fn write_questions(&self, questions: &[RunQuestion]) -> Result<()> {
        self.write(
            QUESTIONS,
            &json_lines(&self.folder.join(QUESTIONS), questions)?,
        )
    }

    /// The trials that were sent in batches, as they were before anything came of them, each as often as it was sent.
    pub(crate) fn batched(&self) -> Result<Vec<Record<D>>> {
        lines(&self.folder.join(BATCH).join(TRIALS))
    }

    /// The trials that are out in a batch: sent more often than a reply or a failure of theirs was taken over.
    pub(crate) fn out_in_batches(&self) -> Result<BTreeSet<TrialKey>> {
        let mut out = HashMap::<TrialKey, usize>::new();
        for record in self.batched()? {
            *out.entry(record.key).or_default() += 1;
        }
        if out.is_empty() {
            return Ok(BTreeSet::new());
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
    pub(crate) fn folder(&self) -> &Path {
        &self.folder
    }

    /// Appends one record: once this returns, killing the process cannot lose it.
    pub(crate) fn append(&mut self, record: &Record<D>) -> Result<()> {
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
    pub(crate) fn sync(&mut self) -> Result<()> {
        self.synced = Instant::now();
        self.records
            .sync_data()
            .map_err(|e| Error::file(self.folder.join(RECORDS), "write", e))
    }

    /// Writes the manifest.
    pub(crate) fn write_manifest(&self, manifest: &RunManifest) -> Result<()> {
        write_manifest(&self.folder, manifest)
    }

    /// Writes a file into the run folder, whole or not at all; one that already says this is left as it is.
    pub(crate) fn write(&self, name: &str, content: &[u8]) -> Result<()> {
        write(&self.folder, name, content)
    }
}

#[cfg(test)]
mod tests;
