//! Runs as read from their folders: [`StoredRun`], and [`AnyRun`] for either kind of experiment.
//!
//! Files of a run folder other than its records: [`RunFiles`].

use std::collections::HashMap;
use std::fs;
use std::path::{Path, PathBuf};

use crate::renamed;
use crate::run_texts::InMemoryTexts;
use darkqa_base::error::{Error, Result};
use darkqa_base::types::manifests::{Counts, RunManifest, Status};
use darkqa_base::types::{
    ChoiceDetail, FailureKind, Finish, ImageFidelity, ListedModel, ModelListing, OpenDetail, QuestionId, Record, Reply,
    RunQuestion, StoredDetail as _, Thumbnail, TrialRef, Trials, shell_word,
};
use darkqa_data::ready_made::is_zip_file;
use darkqa_score::answers::record::{Detail, answered};
use darkqa_store::{Answers, IndexedStart};

pub use crate::run_texts::RunTexts;

/// The models of a run that a report shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ShownModels {
    /// Models in the models file, and models asked by the last command.
    Current,
    /// Also models that the models file no longer has, or had with other settings.
    All,
}

/// Location of the files of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RunLayout {
    /// The folder of the run.
    Whole,
    /// The folders of the shards, inside the folder of the run.
    Shards,
    /// A ZIP file, which is not changed.
    Zip,
}

/// A run with the data that reports need.
#[derive(Clone)]
pub struct StoredRun<D: Detail> {
    pub folder: PathBuf,
    pub layout: RunLayout,
    pub manifest: RunManifest,
    pub trials: Trials<D>,
    /// The trials of models that a report leaves out.
    pub left_out: Trials<D>,
    pub texts: RunTexts<D>,
    /// The questions; without their evidence if read from a folder. [`RunTexts::questions`] reads the evidence.
    pub questions: Vec<RunQuestion>,
    pub thumbnails: Vec<Thumbnail>,
    pub fidelity: Vec<ImageFidelity>,
}

impl<D: Detail> StoredRun<D> {
    /// Reads a run folder. For a run that has not ended, the counts in the manifest are replaced by those of the
    /// records.
    ///
    /// # Errors
    /// If the folder has no run with records of this kind.
    pub fn open(folder: &Path) -> Result<Self> {
        let manifest = darkqa_store::read_manifest(folder, D::SCHEMA)?;
        let manifest = manifest.ok_or_else(|| no_run(folder))?;
        let indexed = IndexedStart::check::<D>(folder);
        let trials = darkqa_store::read_log(folder, indexed, Answers::Stored, refused_as_filtered)?;
        let mut run = Self::from_trials(folder, manifest, trials)?;
        if run.manifest.status == Status::Started {
            let failed = run.trials.iter().map(TrialRef::failed);
            run.manifest.counts = Counts::new(run.manifest.counts.trials, failed);
        }
        Ok(run)
    }

    /// Reads a run folder except its manifest, and parses its replies again by the rules of this version. `indexed` is
    /// the beginning of its records that has an index.
    ///
    /// # Errors
    /// If a line of a file is broken.
    pub fn reread(folder: &Path, manifest: RunManifest, indexed: Option<IndexedStart>) -> Result<Self> {
        let trials = darkqa_store::read_log(folder, indexed, Answers::Reread, refused_as_filtered)?;
        Self::from_trials(folder, manifest, trials)
    }

    /// The run in a folder, given its manifest and trials. The records themselves stay on disk.
    fn from_trials(folder: &Path, manifest: RunManifest, trials: Trials<D>) -> Result<Self> {
        let texts = RunTexts::open(folder)?;
        let files = RunFiles::read_without_evidence(folder)?;
        Self::new(folder, manifest, trials, texts, files)
    }

    /// The run of a folder, given its manifest, its records, which stay in memory, and its other files.
    pub fn from_records(
        folder: &Path,
        manifest: RunManifest,
        records: Vec<Record<D>>,
        files: RunFiles,
    ) -> Result<Self> {
        let trials = records.iter().cloned().collect();
        let texts = RunTexts::InMemory(InMemoryTexts::new(records, files.questions.clone()).into());
        Self::new(folder, manifest, trials, texts, files)
    }

    fn new(
        folder: &Path,
        manifest: RunManifest,
        mut trials: Trials<D>,
        texts: RunTexts<D>,
        files: RunFiles,
    ) -> Result<Self> {
        renamed::rename_trials(&mut trials, &manifest);
        trials.keep_one_per_key(|first, later| Ok(first.or_later(later)))?;
        let ids = files.questions.iter().map(|question| &question.id);
        sort_trials(&mut trials, ids, &manifest.models);
        Ok(Self {
            folder: folder.to_owned(),
            layout: RunLayout::Whole,
            manifest,
            trials,
            left_out: Trials::default(),
            texts,
            questions: files.questions,
            thumbnails: files.thumbnails,
            fidelity: files.fidelity,
        })
    }

    /// Moves the trials that a report does not show to [`left_out`](Self::left_out).
    pub fn leave_out(&mut self, shown: ShownModels) {
        if shown == ShownModels::Current {
            let names = renamed::left_out_models(&self.manifest);
            if !names.is_empty() {
                let is_left_out = |trial: TrialRef<'_, D>| names.iter().any(|name| name == trial.model());
                self.left_out = self.trials.extract(is_left_out);
            }
        }
    }

    /// The record of a trial, with the current names of its model and condition.
    ///
    /// # Errors
    /// If the file of records cannot be read any more, or was changed.
    pub fn record(&self, trial: TrialRef<'_, D>) -> Result<Record<D>> {
        Ok(Record {
            model: trial.model().to_owned(),
            condition: trial.condition().cloned(),
            ..refused_as_filtered(self.texts.record(trial.text())?)?
        })
    }

    /// The records of all trials of a question.
    ///
    /// # Errors
    /// As for [`record`](Self::record).
    pub fn records_of(&self, question: &str) -> Result<Vec<Record<D>>> {
        self.trials.iter().filter(|trial| trial.question().0 == question).map(|trial| self.record(trial)).collect()
    }

    /// Name of the run, which is the name of its folder.
    pub fn name(&self) -> String {
        run_name(&self.folder)
    }
}

/// A record whose content the server refused, as earlier versions stored it, as a failure: it counts as the reply that
/// this version stores, withheld by a filter. Other records are unchanged.
///
/// # Errors
/// If the choices of the record are not valid.
fn refused_as_filtered<D: Detail>(record: Record<D>) -> Result<Record<D>> {
    match record.failure {
        Some(failure) if failure.kind == FailureKind::Filtered => {
            let reply = Reply {
                refusal: Some(failure.message),
                finish: Finish::Filter,
                attempts: record.attempts,
                lost: record.lost,
                ..Reply::local(String::new())
            };
            let blank = Record { failure: None, ..record };
            let record = answered(blank, reply)?;
            Ok(Record { latency_ms: None, ..record })
        }
        failure => Ok(Record { failure, ..record }),
    }
}

/// Sorts trials by question, condition and model. Listed models come first, in their order.
pub fn sort_trials<'q, D: Detail>(
    trials: &mut Trials<D>,
    questions: impl Iterator<Item = &'q QuestionId>,
    listed: &[ListedModel],
) {
    let places: HashMap<&QuestionId, usize> = questions.zip(0..).collect();
    let listing = ModelListing::new(listed.iter().cloned());
    trials.sort(|question| places.get(question).copied(), |model| listing.place(model));
}

/// Name of the run in a folder or ZIP file: the name of the folder, or of the file without its ending.
pub fn run_name(folder: &Path) -> String {
    let whole = std::path::absolute(folder).unwrap_or_else(|_| folder.to_owned());
    let name = if is_zip_file(&whole) { whole.file_stem() } else { whole.file_name() };
    let name = name.unwrap_or(whole.as_os_str());
    name.to_string_lossy().into_owned()
}

/// A run of either experiment. Only this module distinguishes the experiments, by the schema of their folders.
#[expect(clippy::large_enum_variant, reason = "of the few that are held, none is moved often")]
pub enum AnyRun {
    Choice(StoredRun<ChoiceDetail>),
    Open(StoredRun<OpenDetail>),
}

/// The kind of questions in a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ExperimentKind {
    Choice,
    Open,
}

impl ExperimentKind {
    /// Reads the kind of questions of the run in a folder.
    ///
    /// # Errors
    /// If the folder has no run, or one of another version.
    pub fn read(folder: &Path) -> Result<Self> {
        let schema = darkqa_store::schema(folder)?.ok_or_else(|| no_run(folder))?;
        if schema == OpenDetail::SCHEMA {
            return Ok(Self::Open);
        }
        // Returns the error about any other schema.
        darkqa_store::read_manifest(folder, ChoiceDetail::SCHEMA)?;
        Ok(Self::Choice)
    }
}

impl AnyRun {
    /// Reads a run folder.
    ///
    /// # Errors
    /// If the folder has no run.
    pub fn open(folder: &Path) -> Result<Self> {
        Ok(match ExperimentKind::read(folder)? {
            ExperimentKind::Choice => Self::Choice(StoredRun::open(folder)?),
            ExperimentKind::Open => Self::Open(StoredRun::open(folder)?),
        })
    }
}

impl StoredRun<ChoiceDetail> {
    /// Reads a run of questions with choices.
    ///
    /// # Errors
    /// If the folder has no run, or one of open questions. The message ends with `instead`.
    pub fn open_choices(folder: &Path, instead: &str) -> Result<Self> {
        match ExperimentKind::read(folder)? {
            ExperimentKind::Choice => Self::open(folder),
            ExperimentKind::Open => Err(open_questions_error(folder, instead)),
        }
    }

    /// Checks that the true answers to the questions are known.
    ///
    /// # Errors
    /// If they are not. The message ends with `why`, the reason why they are needed.
    pub fn with_truths(self, why: &str) -> Result<Self> {
        if self.trials.items().into_iter().flatten().all(|item| item.truth.is_some()) {
            return Ok(self);
        }
        Err(Error::Run {
            path: self.folder,
            problem: format!("nobody knows the true answers to the questions of this run (--ask): {why}"),
        })
    }
}

/// Reads the manifest of the run in a folder, of either experiment.
///
/// # Errors
/// If the folder has no run.
pub fn read_run_manifest(folder: &Path) -> Result<RunManifest> {
    let schema = match ExperimentKind::read(folder)? {
        ExperimentKind::Choice => ChoiceDetail::SCHEMA,
        ExperimentKind::Open => OpenDetail::SCHEMA,
    };
    darkqa_store::read_manifest(folder, schema)?.ok_or_else(|| no_run(folder))
}

/// The error for a run of open questions where one with choices is needed. The message ends with `instead`.
pub fn open_questions_error(folder: &Path, instead: &str) -> Error {
    Error::Run { path: folder.to_owned(), problem: format!("the run asked open questions: {instead}") }
}

/// Maximum number of runs in a message.
const MAX_LISTED: usize = 8;

/// The paths of the first run folders in a folder, for a message. If there are more, the last text is their number.
fn list_runs(folder: &Path) -> Vec<String> {
    let mut runs: Vec<String> = fs::read_dir(folder)
        .into_iter()
        .flatten()
        .flatten()
        .map(|entry| entry.path())
        .filter(|path| darkqa_store::is_run(path))
        .map(|path| path.display().to_string())
        .collect();
    runs.sort();
    let more = runs.len().saturating_sub(MAX_LISTED);
    runs.truncate(MAX_LISTED);
    if more > 0 {
        runs.push(format!("and {more} more"));
    }
    runs
}

/// The command that unpacks a ZIP file beside it.
pub fn unpack_command(zip: &Path) -> String {
    let [zip, target] = [zip, &zip.with_extension("")].map(|path| path.display().to_string());
    format!("python3 -m zipfile -e {} {}", shell_word(&zip), shell_word(&target))
}

fn no_run(folder: &Path) -> Error {
    if is_zip_file(folder) {
        let problem = format!(
            "a ZIP file, which only report, show, figures and site read; for others unpack it and name the folder of the run in it: {}",
            unpack_command(folder)
        );
        return Error::Run { path: folder.to_owned(), problem };
    }
    let hint = match &*list_runs(folder) {
        [] => String::new(),
        runs => format!("; there are runs in it: {}", runs.join(" ")),
    };
    Error::Run { path: folder.to_owned(), problem: format!("no run in this folder: it has no manifest.json{hint}") }
}

/// A setting of a manifest, if it is a text.
pub fn text_setting<'a>(manifest: &'a RunManifest, name: &str) -> Option<&'a str> {
    manifest.settings.get(name)?.as_str()
}

/// Contents of the files of a run folder other than its records.
pub struct RunFiles {
    pub questions: Vec<RunQuestion>,
    pub thumbnails: Vec<Thumbnail>,
    pub fidelity: Vec<ImageFidelity>,
}

impl RunFiles {
    /// Reads the files of a run folder, without the evidence of questions.
    ///
    /// # Errors
    /// If a line of a file is broken.
    pub fn read_without_evidence(folder: &Path) -> Result<Self> {
        let mut questions = Vec::new();
        darkqa_store::each_question(folder, |question| {
            questions.push(question.without_evidence());
        })?;
        Ok(Self {
            questions,
            thumbnails: darkqa_store::read_thumbnails(folder),
            fidelity: darkqa_store::read_fidelity(folder),
        })
    }

    /// Reads the files of a run folder.
    ///
    /// # Errors
    /// If a line of a file is broken.
    pub fn read(folder: &Path) -> Result<Self> {
        Ok(Self {
            questions: darkqa_store::read_questions(folder)?,
            thumbnails: darkqa_store::read_thumbnails(folder),
            fidelity: darkqa_store::read_fidelity(folder),
        })
    }
}
