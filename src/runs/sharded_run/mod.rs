//! The shards of a run, joined into one run: [`ShardedRun`]. `report merge` writes this run, and `report` reports on it
//! without writing it.
//!
//! The distinct questions of shards, with the places of their lines: [`ShardQuestions`].
//!
//! Removes duplicate trials of shards: [`remove_duplicates`].
//!
//! The manifest of a run joined from its shards: [`joined_manifest`].

mod coverage;
mod open;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::shard::{ShardBudget, remove_tasks_setting};
use super::shard_records::ShardLogs;
use crate::shard_records::read_shard;
use crate::stored::sort_trials;
use coverage::{Coverage, StoredShard, no_shard_error};
use darkqa_base::error::{Error, Result};
use darkqa_base::types::flags::setting_spelling;
use darkqa_base::types::manifests::{Counts, RunManifest, Status, differences};
use darkqa_base::types::{FrameId, InputSummary, KeptTrial, QuestionId, Record, RunQuestion, TrialRef, Trials};
use darkqa_score::answers::record::Detail;
use darkqa_store::{LinePlace, QuestionFile, Store, each_placed_question};

pub use coverage::MissingShards;
pub use open::{common_kind, open_any_run, open_choice_run, run_folders_in};

/// The shards of one run, which may come from several divisions of it.
pub struct ShardedRun<D: Detail> {
    shards: Vec<StoredShard>,
    pub questions: ShardQuestions,
    /// Distinct trials, in the order of questions, conditions and models. The file number of a text is the index of its
    /// shard.
    pub trials: Trials<D>,
    /// The manifest of the whole run.
    pub manifest: RunManifest,
}

impl<D: Detail> ShardedRun<D> {
    /// Reads and joins the shards in these folders.
    ///
    /// # Errors
    /// If a folder has no shard, the shards belong to different runs, the same trial has different images in two
    /// shards, or sources are in no shard and `missing` is [`MissingShards::Refuse`].
    pub fn read(folders: &[PathBuf], missing: MissingShards) -> Result<Self> {
        let mut shards: Vec<StoredShard> =
            folders.iter().map(|folder| StoredShard::open(folder)).collect::<Result<_>>()?;
        shards.sort_by_key(|shard| (shard.shard.count(), shard.shard));
        check_same_run(&shards)?;
        let coverage =
            Coverage::from_shards(shards.iter().map(|shard| (shard.shard, &*shard.folder, &shard.manifest)))?;
        let plan = coverage::plan(&shards, &coverage)?;
        let is_missing = coverage::check(&shards, &coverage, plan.as_ref(), missing)?;
        coverage::warn_unfinished(&shards, plan.as_ref());
        let mut manifest = joined_manifest(&shards, &coverage)?;
        let folders: Vec<&Path> = shards.iter().map(|shard| &*shard.folder).collect();
        let questions = ShardQuestions::read(&folders)?;
        let mut trials = Trials::default();
        for (number, shard) in shards.iter().enumerate() {
            read_shard(&mut trials, &shard.folder, &shard.manifest, number)?;
        }
        let paid_twice = remove_duplicates(&mut trials, &folders)?;
        if paid_twice > 0 {
            tracing::warn!(
                "{paid_twice} replies differ in two parts: they were paid for twice; those of the first part are taken"
            );
        }
        sort_trials(&mut trials, questions.ids(), &manifest.models);
        let failed = trials.iter().filter(|trial| trial.failed()).count();
        manifest.set_counts(Counts {
            trials: coverage.trials().max(trials.len()),
            answered: trials.len() - failed,
            failed,
        });
        if is_missing {
            manifest.status = Status::Incomplete;
        }
        Ok(Self { shards, questions, trials, manifest })
    }

    /// The folder of each shard.
    pub fn folders(&self) -> Vec<&Path> {
        self.shards.iter().map(|shard| &*shard.folder).collect()
    }

    /// The manifest of the whole run; frees everything else.
    pub fn into_manifest(self) -> RunManifest {
        self.manifest
    }

    /// The folder and the manifest of each shard.
    pub fn manifests(&self) -> Vec<(&Path, &RunManifest)> {
        self.shards.iter().map(|shard| (&*shard.folder, &shard.manifest)).collect()
    }
}

/// The distinct questions of several shards, in the order of the data.
pub struct ShardQuestions(Vec<ShardQuestion>);

/// A question of a shard.
struct ShardQuestion {
    /// The question without its evidence.
    question: RunQuestion,
    /// Index of the shard's folder.
    folder: usize,
    line: LinePlace,
}

impl ShardQuestions {
    /// Reads the questions of these folders.
    ///
    /// # Errors
    /// If a line is not a question.
    pub fn read(folders: &[&Path]) -> Result<Self> {
        let mut questions = Vec::new();
        for (index, folder) in folders.iter().enumerate() {
            each_placed_question(folder, |question, line| {
                questions.push(ShardQuestion { question: question.without_evidence(), folder: index, line });
            })?;
        }
        questions.sort_by_key(|question| question.question.place);
        // A control of the observer asks a question of one shard with an image of another.
        questions.dedup_by(|later, question| later.question.id == question.question.id);
        Ok(Self(questions))
    }

    /// Names of the questions, in order.
    pub fn ids(&self) -> impl Iterator<Item = &QuestionId> {
        self.0.iter().map(|question| &question.question.id)
    }

    /// Frames of the questions, in order.
    pub fn frames(&self) -> impl Iterator<Item = &FrameId> {
        self.0.iter().map(|question| &question.question.frame)
    }

    /// The questions without their evidence, in order.
    pub fn into_questions(self) -> Vec<RunQuestion> {
        self.0.into_iter().map(|question| question.question).collect()
    }

    /// Copies the lines of the questions into a run.
    ///
    /// # Errors
    /// If a line cannot be read or written.
    pub fn write<D: Detail>(&self, store: &Store<D>, folders: &[&Path]) -> Result<()> {
        let files: Vec<Option<QuestionFile>> =
            folders.iter().map(|folder| QuestionFile::open(folder)).collect::<Result<_>>()?;
        store.write_question_lines(|out| {
            for question in &self.0 {
                if let Some(file) = &files[question.folder] {
                    out(&file.line(question.line)?)?;
                }
            }
            Ok(())
        })
    }
}

/// Keeps each trial once: the one with a reply, or the one from the first shard if both have a reply. `folders` are the
/// folders of the shards, by the file numbers in the places of the trials. Returns the number of trials with different
/// replies in two shards, which were paid for twice.
///
/// # Errors
/// If the same trial has different images in two shards, or a record cannot be read.
fn remove_duplicates<D: Detail>(trials: &mut Trials<D>, folders: &[&Path]) -> Result<usize> {
    let mut logs = ShardLogs::new(folders);
    let mut paid_twice = 0;
    trials.keep_one_per_key(|first, later| {
        if first.text().log() == later.text().log() {
            return Ok(first.or_later(later));
        }
        let lines = [logs.line(first.text())?, logs.line(later.text())?];
        // A shard that continued the work of another one has copies of its lines.
        if lines[0] == lines[1] {
            return Ok(KeptTrial::First);
        }
        check_images::<D>(&mut logs, folders, [first, later], &lines)?;
        if first.failed() && !later.failed() {
            return Ok(KeptTrial::Later);
        }
        paid_twice += usize::from(!first.failed() && !later.failed());
        Ok(KeptTrial::First)
    })?;
    Ok(paid_twice)
}

/// Checks that a trial has the same image in two shards.
fn check_images<D: Detail>(
    logs: &mut ShardLogs<'_>,
    folders: &[&Path],
    trials: [TrialRef<'_, D>; 2],
    lines: &[Vec<u8>; 2],
) -> Result<()> {
    let places = trials.map(TrialRef::text);
    let records: [Record<D>; 2] = [logs.record(places[0], &lines[0])?, logs.record(places[1], &lines[1])?];
    let images = records.each_ref().map(|record| record.detail.sent_digest());
    if images[0] == images[1] || images.iter().any(Option::is_none) {
        return Ok(());
    }
    let problem = format!(
        "the trial {} was shown another image than in {}: the images of one of the two have changed; merge one of them alone",
        trials[1].key(),
        folders[places[0].log()].display()
    );
    let path = folders[places[1].log()].to_owned();
    Err(Error::Run { path, problem })
}

/// Checks that all shards belong to the same run.
///
/// # Errors
/// If a shard belongs to another run; names the first difference.
fn check_same_run(parts: &[StoredShard]) -> Result<()> {
    let Some(first) = parts.first() else {
        return Ok(());
    };
    for part in parts {
        let Some((field, own, other)) = difference(&part.manifest, &first.manifest) else {
            continue;
        };
        let problem = format!(
            "shard {} is of another run than {}: its {field} is {own}, that of the other run is {other}",
            part.shard,
            first.folder.display()
        );
        let path = part.folder.clone();
        return Err(Error::Run { path, problem });
    }
    Ok(())
}

/// First difference by which two manifests belong to different runs: the field, and its value in each.
fn difference(one: &RunManifest, other: &RunManifest) -> Option<(String, String, String)> {
    if let Some((field, first, second)) = differences(&one.identity, &other.identity).next() {
        return Some((setting_spelling(field), first, second));
    }
    if !one.has_same_image_bytes(other) {
        let [first, second] = [one, other].map(|run| serde_json::json!(run.png).to_string());
        return Some(("form of PNG files".to_owned(), first, second));
    }
    let column = one.column_differences(other).into_iter().next()?;
    let setting = setting_spelling(&column.field);
    let field = format!("{setting} of the {} {}", column.column, column.value);
    Some((field, column.first, column.second))
}

/// Joins the manifests of the shards into the manifest of the run. The caller sets the counts of trials.
///
/// # Errors
/// If there is no shard.
fn joined_manifest(parts: &[StoredShard], coverage: &Coverage) -> Result<RunManifest> {
    let mut manifest = parts.first().ok_or_else(no_shard_error)?.manifest.clone();
    manifest.shard = None;
    manifest.part = None;
    ShardBudget::remove_note(&mut manifest);
    remove_tasks_setting(&mut manifest);
    for part in parts {
        for (column, values) in &part.manifest.columns {
            let all = manifest.columns.entry(column.clone()).or_default();
            all.extend(values.clone());
        }
    }
    manifest.enhancers = BTreeMap::new();
    for (name, note) in parts.iter().flat_map(|part| &part.manifest.enhancers) {
        let earlier = manifest.enhancers.remove(name);
        let note = note.clone().with_earlier(earlier);
        manifest.enhancers.insert(name.clone(), note);
    }
    let mut inputs: Option<InputSummary> = None;
    for (part, is_counted) in parts.iter().zip(coverage.counted_once()) {
        if is_counted && let Some(part_inputs) = &part.manifest.inputs {
            inputs.get_or_insert_default().merge(part_inputs);
        }
    }
    manifest.inputs = inputs;
    for part in parts.iter().map(|part| &part.manifest) {
        // The records of the shards are not parsed again, so the oldest version counts; `None` is the first version.
        if part.reply_reading < manifest.reply_reading {
            manifest.reply_reading.clone_from(&part.reply_reading);
        }
        if part.created < manifest.created {
            manifest.created.clone_from(&part.created);
        }
        if part.updated > manifest.updated {
            manifest.updated.clone_from(&part.updated);
        }
    }
    Ok(manifest)
}
