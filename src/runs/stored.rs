//! Runs as read from their folders: [`StoredRun`], and [`AnyRun`] for either kind of experiment.

use std::collections::HashMap;
use std::fs;
use std::path::{Path, PathBuf};

use crate::error::{Error, Result};
use crate::runs::renamed;
use crate::runs::run_files::RunFiles;
use crate::runs::run_texts::HeldTexts;
pub(crate) use crate::runs::run_texts::RunTexts;
use crate::store;
use crate::types::manifests::{Counts, RunManifest, Status};
use crate::types::{
    ChoiceDetail, ImageFidelity, ListedModel, ModelListing, OpenDetail, QuestionId, Record,
    RunQuestion, StoredDetail as _, TextPlace, Thumbnail, TrialRef, Trials,
};
use darkqa_score::answers::record::Detail;

/// The models of a run that a report shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum ShownModels {
    /// Models in the file of models, and those that the last command asked.
    Current,
    /// Also those that the file of models no longer has, or had with other settings.
    All,
}

/// Where the files of a run are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum RunLayout {
    /// In its folder.
    Whole,
    /// In the folders of its parts, which are in its folder.
    Parts,
}

/// A run as reports need it.
#[derive(Clone)]
pub(crate) struct StoredRun<D: Detail> {
    pub(crate) folder: PathBuf,
    pub(crate) layout: RunLayout,
    pub(crate) manifest: RunManifest,
    pub(crate) trials: Trials<D>,
    /// The trials of models that a report leaves out.
    pub(crate) left_out: Trials<D>,
    pub(crate) texts: RunTexts<D>,
    /// The questions; those of a folder without their evidence, which [`RunTexts::questions`] reads.
    pub(crate) questions: Vec<RunQuestion>,
    pub(crate) thumbnails: Vec<Thumbnail>,
    pub(crate) fidelity: Vec<ImageFidelity>,
}

impl<D: Detail> StoredRun<D> {
    /// Reads a run folder. The manifest of a run that has not ended has the counts of its start: they are those of the records instead.
    ///
    /// # Errors
    /// If the folder holds no run with records of this kind.
    pub(crate) fn open(folder: &Path) -> Result<Self> {
        let manifest = store::read_manifest(folder, D::SCHEMA)?;
        let manifest = manifest.ok_or_else(|| no_run(folder))?;
        let mut trials = Trials::default();
        store::each_record(folder, |record, place| {
            trials.add(record, TextPlace::new(place.start));
        })?;
        let mut run = Self::from_trials(folder, manifest, trials)?;
        if run.manifest.status == Status::Started {
            let failed = run.trials.iter().map(TrialRef::failed);
            run.manifest.counts = Counts::new(run.manifest.counts.trials, failed);
        }
        Ok(run)
    }

    /// Reads everything in a run folder except `manifest`, and its replies again by the rules of this version.
    ///
    /// # Errors
    /// If a line of a file is broken.
    pub(crate) fn reread(folder: &Path, manifest: RunManifest) -> Result<Self> {
        let mut trials = Trials::default();
        store::each_reread_record(folder, |record, place| {
            trials.add(record, TextPlace::new(place.start));
        })?;
        Self::from_trials(folder, manifest, trials)
    }

    /// The run of a folder from its manifest and trials. Of its records no more than reports need is held.
    fn from_trials(folder: &Path, manifest: RunManifest, trials: Trials<D>) -> Result<Self> {
        let texts = RunTexts::open(folder)?;
        let files = RunFiles::read_light(folder)?;
        Self::from_parts(folder, manifest, (trials, texts), files)
    }

    /// The run of a folder from its manifest, records that are held in memory, and the lines of its other files.
    pub(crate) fn from_records(
        folder: &Path,
        manifest: RunManifest,
        (records, files): (Vec<Record<D>>, RunFiles),
    ) -> Result<Self> {
        let trials = records.iter().cloned().collect();
        let texts = RunTexts::Held(HeldTexts::new(records, files.questions.clone()).into());
        Self::from_parts(folder, manifest, (trials, texts), files)
    }

    fn from_parts(
        folder: &Path,
        manifest: RunManifest,
        (mut trials, texts): (Trials<D>, RunTexts<D>),
        files: RunFiles,
    ) -> Result<Self> {
        renamed::rename_trials(&mut trials, &manifest);
        trials.each_key_once(|first, later| Ok(first.or_later(later)))?;
        let ids = files.questions.iter().map(|question| &question.id);
        sort(&mut trials, ids, &manifest.models);
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

    /// Takes the trials apart that a report does not show.
    pub(crate) fn leave_out(&mut self, shown: ShownModels) {
        if shown == ShownModels::Current {
            let names = renamed::left_out_models(&self.manifest);
            if !names.is_empty() {
                let is_left_out =
                    |trial: TrialRef<'_, D>| names.iter().any(|name| name == trial.model());
                self.left_out = self.trials.extract(is_left_out);
            }
        }
    }

    /// The whole record of a trial, with the names that its model and condition have here.
    ///
    /// # Errors
    /// If the file of the run cannot be read any more, or was changed.
    pub(crate) fn record(&self, trial: TrialRef<'_, D>) -> Result<Record<D>> {
        Ok(Record {
            model: trial.model().to_owned(),
            condition: trial.condition().cloned(),
            ..self.texts.record(trial.text())?
        })
    }

    /// The whole records of the trials of a question.
    ///
    /// # Errors
    /// As for [`record`](Self::record).
    pub(crate) fn records_of(&self, question: &str) -> Result<Vec<Record<D>>> {
        self.trials
            .iter()
            .filter(|trial| trial.question().0 == question)
            .map(|trial| self.record(trial))
            .collect()
    }

    /// Name of the run: that of its folder.
    pub(crate) fn name(&self) -> String {
        name(&self.folder)
    }
}

/// Puts trials in the order of the questions, conditions and models (those that are listed first), whatever order the replies came in.
pub(crate) fn sort<'q, D: Detail>(
    trials: &mut Trials<D>,
    questions: impl Iterator<Item = &'q QuestionId>,
    listed: &[ListedModel],
) {
    let places: HashMap<&QuestionId, usize> = questions.zip(0..).collect();
    let listing = ModelListing::new(listed.iter().cloned());
    trials.sort(
        |question| places.get(question).copied(),
        |model| listing.place(model),
    );
}

/// Name of the run in this folder: that of the folder.
pub(crate) fn name(folder: &Path) -> String {
    let whole = std::path::absolute(folder).unwrap_or_else(|_| folder.to_owned());
    let name = whole.file_name().unwrap_or(whole.as_os_str());
    name.to_string_lossy().into_owned()
}

/// A run of either experiment. Only this module tells experiments apart by the schema of their folders.
#[expect(
    clippy::large_enum_variant,
    reason = "of the few that are held, none is moved often"
)]
pub(crate) enum AnyRun {
    Choice(StoredRun<ChoiceDetail>),
    Open(StoredRun<OpenDetail>),
}

/// The kind of questions in a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum ExperimentKind {
    Choice,
    Open,
}

impl ExperimentKind {
    /// The kind of questions in the run of a folder.
    ///
    /// # Errors
    /// If the folder holds no run, or one of another version.
    pub(crate) fn read(folder: &Path) -> Result<Self> {
        let schema = store::schema(folder)?.ok_or_else(|| no_run(folder))?;
        if schema == OpenDetail::SCHEMA {
            return Ok(Self::Open);
        }
        // Returns the error about any other schema.
        store::read_manifest(folder, ChoiceDetail::SCHEMA)?;
        Ok(Self::Choice)
    }
}

impl AnyRun {
    /// Reads a run folder.
    ///
    /// # Errors
    /// If the folder holds no run.
    pub(crate) fn open(folder: &Path) -> Result<Self> {
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
    /// If the folder holds no run, or one of open questions. That error tells the user what to do `instead`.
    pub(crate) fn open_choices(folder: &Path, instead: &str) -> Result<Self> {
        match ExperimentKind::read(folder)? {
            ExperimentKind::Choice => Self::open(folder),
            ExperimentKind::Open => Err(open_questions(folder, instead)),
        }
    }

    /// The run, if the true answers to its questions are known.
    ///
    /// # Errors
    /// If they are not. That error tells the user `why` they are needed.
    pub(crate) fn with_truths(self, why: &str) -> Result<Self> {
        let mut items = self.trials.items().into_iter().flatten();
        if items.all(|item| item.truth.is_some()) {
            return Ok(self);
        }
        Err(Error::Run {
            path: self.folder,
            problem: format!(
                "nobody knows the true answers to the questions of this run (--ask): {why}"
            ),
        })
    }
}

/// The manifest of the run in a folder, of either experiment.
///
/// # Errors
/// If the folder holds no run.
pub(crate) fn manifest(folder: &Path) -> Result<RunManifest> {
    let schema = match ExperimentKind::read(folder)? {
        ExperimentKind::Choice => ChoiceDetail::SCHEMA,
        ExperimentKind::Open => OpenDetail::SCHEMA,
    };
    store::read_manifest(folder, schema)?.ok_or_else(|| no_run(folder))
}

/// The error about a run of open questions, which tells the user what to do `instead`.
pub(crate) fn open_questions(folder: &Path, instead: &str) -> Error {
    Error::Run {
        path: folder.to_owned(),
        problem: format!("the run asked open questions: {instead}"),
    }
}

/// Most runs that a message lists.
const MOST_LISTED: usize = 8;

/// The folders with a manifest in a folder, for a message; the last text states how many more there are.
fn runs_below(folder: &Path) -> Vec<String> {
    let mut runs: Vec<String> = fs::read_dir(folder)
        .into_iter()
        .flatten()
        .flatten()
        .map(|entry| entry.path())
        .filter(|path| store::holds_run(path))
        .map(|path| path.display().to_string())
        .collect();
    runs.sort();
    let more = runs.len().saturating_sub(MOST_LISTED);
    runs.truncate(MOST_LISTED);
    if more > 0 {
        runs.push(format!("and {more} more"));
    }
    runs
}

fn no_run(folder: &Path) -> Error {
    let below = runs_below(folder);
    let hint = match &*below {
        [] => String::new(),
        below => format!("; there are runs in it: {}", below.join(" ")),
    };
    Error::Run {
        path: folder.to_owned(),
        problem: format!("no run in this folder: it has no manifest.json{hint}"),
    }
}
