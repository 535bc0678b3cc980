//! The folder of a run, `results/<run>/`.
//!
//! `records.jsonl` is the source of truth: one line for each trial, written to the operating system as soon as the
//! reply arrives, so that a killed run loses nothing. `manifest.json` describes the run, `questions.jsonl` contains its
//! questions, `thumbnails.jsonl` small copies of its images, and `fidelity.jsonl` their similarity to the clean frames.
//! All other files are derived from these, such as `records.parquet` with the records as a table for other programs
//! ([`ColumnFile`]), and `records.index`, by which large runs are read fast ([`IndexedStart`]).

#![cfg_attr(test, allow(clippy::unwrap_used, reason = "a test may panic"))]

mod changed_questions;
pub(crate) mod column_file;
mod folder;
mod image_notes;
mod lines;
mod log_index;
mod pieces;
mod record_log;
mod stored_trial;
#[cfg(test)]
mod tests;

use std::borrow::Cow;
use std::collections::{BTreeSet, HashMap, HashSet};
use std::fs::{File, OpenOptions, TryLockError};
use std::io::Write;
use std::marker::PhantomData;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use changed_questions::{ChangedQuestions, LostQuestions};
use darkqa_base::error::{Error, Result};
use darkqa_base::files::write_with;
use darkqa_base::types::manifests::{RecordedNames, RunManifest};
use darkqa_base::types::{
    ChoiceDetail, Distinct, FrameId, ImageFidelity, InputSummary, QuestionId, Record, RunQuestion, Thumbnail, TrialKey,
    Via,
};
use darkqa_score::answers::record::Detail;
use folder::{FIDELITY, QUESTIONS, RECORDS, THUMBNAILS, check_own, create_run, write, write_manifest};
use lines::{append, each_line, each_readable_line, json_lines, lines, repair, repair_notes, set_aside};
use log_index::trials_after;
use record_log::UnlockedLog;

pub use column_file::{CREATED_BY, Cell, CellKind, Column, ColumnFile, FileMetadata, Presence};
pub use folder::{
    AddressChange, BATCH, BATCH_STATE, MANIFEST, NOTE_FILES, PLAN, RUN_FILES, check_same_run, each_placed_question,
    each_question, find, has_batches, is_locked, is_run, manifest_damage, now, read_columns, read_fidelity,
    read_manifest, read_questions, read_records, read_settings, read_thumbnails, reply_count, restore_manifest, schema,
};
pub use image_notes::{missing_fidelity, missing_thumbnails};
pub use lines::set_file_aside;
pub use log_index::{Answers, INDEX, IndexedStart, program_build, read_log, read_trials};
pub use pieces::LinePlace;
pub use record_log::{LogMark, QuestionFile, RecordLog, each_record, each_trial};
pub use stored_trial::StoredTrial;

/// The trials that were sent in batches.
const TRIALS: &str = "trials.jsonl";

/// Lines of the records that could not be read.
const SET_ASIDE: &str = "set-aside.jsonl";

/// Interval at which records are forced to the disk. A power cut loses at most the records of this time, a killed
/// process none. Chosen.
const SYNC_EVERY: Duration = Duration::from_secs(2);

/// An open run folder, locked by this process if its file system has locks.
#[derive(Debug)]
pub struct Store<D = ChoiceDetail> {
    folder: PathBuf,
    records: File,
    /// Detection of other writers on a file system without locks; `None` if the file is locked.
    unlocked: Option<UnlockedLog>,
    synced: Instant,
    /// The names of models in records and tables.
    names: RecordedNames,
    /// The beginning of the records that has an index.
    indexed: Option<IndexedStart>,
    kind: PhantomData<D>,
}

impl<D: Detail> Store<D> {
    /// Opens a run folder, which is created if it does not exist.
    ///
    /// An incomplete last line is removed, so that the next record begins on a new line. Other lines that are not
    /// records are moved to [`SET_ASIDE`], and their trials are asked again.
    ///
    /// # Errors
    /// If the folder contains other files or another run (the message names the flag that differs), or if another
    /// process has locked it.
    pub fn open(folder: &Path, manifest: &RunManifest, address_change: AddressChange) -> Result<Self> {
        let store = Self::open_checked(folder, manifest, address_change)?;
        let indexed = IndexedStart::check::<D>(folder);
        let from = indexed.as_ref().map(IndexedStart::end).unwrap_or_default();
        set_aside::<Record<D>>(&folder.join(RECORDS), from, &folder.join(SET_ASIDE))?;
        Ok(Self { indexed, ..store })
    }

    /// Opens a run folder as [`open`](Self::open) does, without checking its records, which the caller has read without
    /// an error.
    pub fn open_checked(folder: &Path, manifest: &RunManifest, address_change: AddressChange) -> Result<Self> {
        match read_manifest(folder, D::SCHEMA)? {
            Some(stored) => check_same_run(folder, &stored, manifest, address_change)?,
            None => create_run(folder, manifest)?,
        }
        check_own(folder)?;
        let path = folder.join(RECORDS);
        let records = OpenOptions::new()
            .read(true)
            .append(true)
            .create(true)
            .open(&path)
            .map_err(|e| Error::file(&path, "open", e))?;
        let locked = records.try_lock();
        if let Err(TryLockError::WouldBlock) = locked {
            return Err(Error::Run {
                path: folder.to_owned(),
                problem: "another process is writing to this run; wait for its end".to_owned(),
            });
        }
        repair::<Record<D>>(&path, &records)?;
        let unlocked = match locked {
            Err(TryLockError::Error(e)) => Some(UnlockedLog::begin(folder, &records, &e)?),
            _ => None,
        };
        Ok(Self {
            folder: folder.to_owned(),
            records,
            unlocked,
            synced: Instant::now(),
            names: RecordedNames::from_manifest(manifest),
            indexed: None,
            kind: PhantomData,
        })
    }

    /// The error that stops this process, if a process that started earlier writes to the run.
    pub fn other_writer(&self) -> Option<Error> {
        self.unlocked.as_ref()?.problem(&self.folder)
    }

    /// Replaces damaged notes about images by the readable ones. Returns true if the run has records and lacks notes.
    pub fn repair_notes(&self) -> bool {
        let lacks_thumbnails = repair_notes::<Thumbnail>(&self.folder.join(THUMBNAILS));
        let lacks_fidelity = repair_notes::<ImageFidelity>(&self.folder.join(FIDELITY));
        let has_records = self.records.metadata().is_ok_and(|log| log.len() > 0);
        has_records && (lacks_thumbnails || lacks_fidelity)
    }

    /// The last record of each trial, in the order of each trial's first record.
    pub fn records(&self) -> Result<Vec<Record<D>>> {
        read_records(&self.folder).map(|records| self.with_table_names(records))
    }

    /// The last state of each trial, in the order of [`records`](Self::records).
    pub fn trials(&self) -> Result<Vec<StoredTrial>> {
        let mut trials = trials_after::<D>(&self.folder, self.indexed.as_ref())?;
        let mut models = Distinct::default();
        for trial in &mut trials {
            let name = self.names.table_name(&trial.model);
            if *name != **trial.model {
                trial.model = name.to_owned().into();
                models.share(&mut trial.model);
            }
        }
        Ok(trials)
    }

    /// The beginning of the records that has an index. Its lines do not change while the run is open.
    pub fn indexed(&self) -> Option<&IndexedStart> {
        self.indexed.as_ref()
    }

    /// The records with the names of models in tables.
    fn with_table_names(&self, mut records: Vec<Record<D>>) -> Vec<Record<D>> {
        for record in &mut records {
            let name = self.names.table_name(&record.model);
            if name != record.model {
                record.model = name.to_owned();
            }
        }
        records
    }

    /// A record with the name of its model in the file.
    fn with_record_name<'r>(&self, record: &'r Record<D>) -> Cow<'r, Record<D>> {
        let name = self.names.record_name(&record.model);
        if name == record.model {
            return Cow::Borrowed(record);
        }
        let model = name.to_owned();
        Cow::Owned(Record { model, ..record.clone() })
    }

    /// Appends trials to the list of trials that were sent in batches.
    pub fn append_to_batch(&mut self, records: &[Record<D>]) -> Result<()> {
        let path = self.batch_trials_file();
        let records: Vec<Record<D>> = records.iter().map(|record| self.with_record_name(record).into_owned()).collect();
        append(&path, &records)?.sync_all().map_err(|e| Error::file(&path, "write", e))
    }

    /// Appends a small copy of an image.
    pub fn append_thumbnail(&mut self, thumbnail: &Thumbnail) -> Result<()> {
        append(&self.folder.join(THUMBNAILS), std::slice::from_ref(thumbnail)).map(drop)
    }

    /// Adds small copies of images from other run folders, for wanted frames, if this run lacks them.
    ///
    /// # Errors
    /// If a file cannot be read or written.
    pub fn add_thumbnails_from(&mut self, folders: &[&Path], is_wanted: impl Fn(&FrameId) -> bool) -> Result<()> {
        let present = read_thumbnails(&self.folder);
        for thumbnail in missing_thumbnails(&present, folders, is_wanted) {
            self.append_thumbnail(&thumbnail)?;
        }
        Ok(())
    }

    /// Adds image similarities from other run folders, for wanted frames, if this run lacks them.
    ///
    /// # Errors
    /// If a file cannot be read or written.
    pub fn add_fidelity_from(&mut self, folders: &[&Path], is_wanted: impl Fn(&FrameId) -> bool) -> Result<()> {
        let present = read_fidelity(&self.folder);
        for image in missing_fidelity(&present, folders, is_wanted) {
            self.append_fidelity(&image)?;
        }
        Ok(())
    }

    /// Appends the similarity of an image to its clean frame.
    pub fn append_fidelity(&mut self, fidelity: &ImageFidelity) -> Result<()> {
        append(&self.folder.join(FIDELITY), std::slice::from_ref(fidelity)).map(drop)
    }

    /// Writes the questions of the run, new and stored ones, in the order of the data. `inputs` summarizes how their
    /// image files were decoded. A question that is missing although the run has records about it is restored from the
    /// data, if one of these records is among the `planned` trials of this command.
    ///
    /// # Errors
    /// If a stored question differs in a part that decides its replies or its score (the error names the part), or if a
    /// missing question cannot be restored.
    pub fn add_questions(
        &self,
        mut questions: Vec<RunQuestion>,
        inputs: Option<&InputSummary>,
        planned: impl FnOnce() -> Result<HashSet<TrialKey>>,
    ) -> Result<()> {
        let path = self.folder.join(QUESTIONS);
        let mut stored_questions: Vec<RunQuestion> = Vec::new();
        let damage = each_readable_line(&path, |question| stored_questions.push(question));
        let stored_ids = stored_questions.iter().map(|question| question.id.clone()).collect();
        let lost = LostQuestions::find(&self.folder, &questions, &stored_ids, damage.as_deref())?;
        lost.check(&path, planned)?;
        let mut changed = ChangedQuestions::default();
        let places: HashMap<QuestionId, usize> =
            questions.iter().map(|question| question.id.clone()).zip(0..).collect();
        for mut stored in stored_questions {
            let Some(&place) = places.get(&stored.id) else {
                questions.push(stored);
                continue;
            };
            let question = &mut questions[place];
            // A scene does not affect replies: it may be added later, and is kept.
            if question.scene.is_empty() {
                question.scene.clone_from(&stored.scene);
            }
            stored.scene.clone_from(&question.scene);
            if let Some(part) = stored.difference(question) {
                changed.add(part, &stored, question);
                continue;
            }
            // A run with only blind models does not read the image.
            question.image = question.image.or(stored.image);
            // A group does not affect replies: it may be added later, and is kept.
            question.group = question.group.take().or(stored.group);
        }
        if let Some(problem) = changed.problem(|| self.is_decoded_alike(inputs)) {
            let path = self.folder.clone();
            return Err(Error::Run { path, problem });
        }
        questions.sort_by_key(|question| question.place);
        if let Some(damage) = damage {
            let aside = set_file_aside(&path)?;
            tracing::warn!("{damage}; made again from the data; the damaged file is {}", aside.display());
        } else if !lost.is_empty() {
            tracing::warn!(
                "{}: questions of records were missing ({}); made again from the data",
                path.display(),
                lost.len()
            );
        }
        self.write_questions(&questions)
    }

    /// True if the image files of the stored run were decoded in the same way.
    fn is_decoded_alike(&self, inputs: Option<&InputSummary>) -> bool {
        read_manifest(&self.folder, D::SCHEMA).ok().flatten().is_some_and(|stored| stored.inputs.as_ref() == inputs)
    }

    /// Replaces the stored questions of the run.
    pub fn write_questions(&self, questions: &[RunQuestion]) -> Result<()> {
        self.write(QUESTIONS, &json_lines(&self.folder.join(QUESTIONS), questions)?)
    }

    /// Replaces the stored questions of the run by lines from the file of another run; `write` passes each line to its
    /// argument.
    pub fn write_question_lines(
        &self,
        write: impl FnOnce(&mut dyn FnMut(&[u8]) -> Result<()>) -> Result<()>,
    ) -> Result<()> {
        let path = self.folder.join(QUESTIONS);
        write_with(&path, |out| write(&mut |line| out.write_all(line).map_err(|e| Error::file(&path, "write", e))))
    }

    /// The trials that were sent in batches, without replies. A trial that was sent again occurs several times.
    pub fn batch_trials(&self) -> Result<Vec<Record<D>>> {
        lines(&self.batch_trials_file()).map(|records| self.with_table_names(records))
    }

    /// The keys of the trials that were sent in batches.
    pub fn batch_keys(&self) -> Result<BTreeSet<TrialKey>> {
        let mut keys = BTreeSet::new();
        each_line(&self.batch_trials_file(), |trial: StoredTrial| {
            keys.insert(trial.key);
        })?;
        Ok(keys)
    }

    /// The file of the trials that were sent in batches.
    pub fn batch_trials_file(&self) -> PathBuf {
        self.folder.join(BATCH).join(TRIALS)
    }

    /// The trials without a result of their batch: trials without a reply that were sent more often than they failed.
    pub fn pending_in_batches(&self) -> Result<BTreeSet<TrialKey>> {
        let mut pending = HashMap::<TrialKey, usize>::new();
        let mut limits = HashMap::<TrialKey, u32>::new();
        for record in self.batch_trials()? {
            *pending.entry(record.key).or_default() += 1;
            limits.extend(record.max_tokens.map(|limit| (record.key, limit)));
        }
        if pending.is_empty() {
            return Ok(BTreeSet::new());
        }
        each_line(&self.folder.join(RECORDS), |record: StoredTrial| {
            // A truncated reply does not answer a request that was sent again with a larger limit.
            let limit = limits.get(&record.key);
            let is_truncated = limit.is_some_and(|limit| record.is_truncated_below(*limit, 0));
            if !record.failed() && !is_truncated {
                pending.remove(&record.key);
            } else if record.via == Via::Batch
                && let Some(times) = pending.get_mut(&record.key)
            {
                *times = times.saturating_sub(1);
            }
        })?;
        Ok(pending.into_iter().filter(|(_, times)| *times > 0).map(|(key, _)| key).collect())
    }

    /// The run folder.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Appends one record, which a killed process then no longer loses.
    pub fn append(&mut self, record: &Record<D>) -> Result<()> {
        let line = self.line(record)?;
        self.append_lines(&line)
    }

    /// The line of a record, with its end.
    pub fn line(&self, record: &Record<D>) -> Result<Vec<u8>> {
        let mut line = serde_json::to_vec(&*self.with_record_name(record))
            .map_err(|e| Error::file(self.folder.join(RECORDS), "write", e.into()))?;
        line.push(b'\n');
        Ok(line)
    }

    /// Appends lines of records, with their ends, from the file of another run with the same names of models.
    pub fn append_lines(&mut self, lines: &[u8]) -> Result<()> {
        if let Some(unlocked) = &mut self.unlocked {
            unlocked.before_append(&self.records, lines.len());
        }
        self.records.write_all(lines).map_err(|e| Error::file(self.folder.join(RECORDS), "write", e))?;
        if self.synced.elapsed() >= SYNC_EVERY { self.sync() } else { Ok(()) }
    }

    /// Forces all records to the disk.
    pub fn sync(&mut self) -> Result<()> {
        self.synced = Instant::now();
        self.records.sync_data().map_err(|e| Error::file(self.folder.join(RECORDS), "write", e))
    }

    /// Replaces the manifest.
    pub fn write_manifest(&self, manifest: &RunManifest) -> Result<()> {
        write_manifest(&self.folder, manifest)
    }

    /// Writes a file into the run folder, completely or not at all; a file with the same content is left untouched.
    pub fn write(&self, name: &str, content: &[u8]) -> Result<()> {
        write(&self.folder, name, content)
    }
}
