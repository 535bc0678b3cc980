//! Runs as read from their folders: [`StoredRun`], and [`AnyRun`] for either kind of experiment.

use std::collections::{HashMap, HashSet};
use std::hash::Hash;
use std::path::{Path, PathBuf};

use super::renamed;
use crate::error::{Error, Result};
use crate::store;
use crate::types::manifest::RunManifest;
use crate::types::{
    ChoiceDetail, Condition, Detail, ImageFidelity, ListedModel, ModelListing, OpenDetail,
    QuestionId, Record, RunQuestion, Thumbnail, TrialKey,
};

/// The models of a run that a report shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum ShownModels {
    /// Those of the file of models, and those that the last command asked.
    Current,
    /// Also those that the file of models no longer has, or had with other settings.
    All,
}

/// A run as read from its folder.
#[derive(Clone)]
pub(crate) struct StoredRun<D> {
    pub(crate) folder: PathBuf,
    pub(crate) manifest: RunManifest,
    pub(crate) records: Vec<Record<D>>,
    /// The records of models that a report leaves out.
    pub(crate) left_out: Vec<Record<D>>,
    pub(crate) questions: Vec<RunQuestion>,
    pub(crate) thumbnails: Vec<Thumbnail>,
    pub(crate) fidelity: Vec<ImageFidelity>,
}

impl<D: Detail> StoredRun<D> {
    /// Reads a run folder.
    ///
    /// # Errors
    /// If the folder holds no run with records of this kind.
    pub(crate) fn open(folder: &Path) -> Result<Self> {
        let manifest = store::read_manifest(folder, D::SCHEMA)?;
        Self::of(folder, manifest.ok_or_else(|| no_run(folder))?)
    }

    /// Reads everything in a run folder except `manifest`.
    pub(crate) fn of(folder: &Path, manifest: RunManifest) -> Result<Self> {
        Ok(Self::of_lines(folder, manifest, RunLines::read(folder)?))
    }

    /// The run of a folder from its manifest and the lines of its files.
    pub(crate) fn of_lines(folder: &Path, manifest: RunManifest, lines: RunLines<D>) -> Self {
        let RunLines {
            mut records,
            questions,
            thumbnails,
            fidelity,
        } = lines;
        renamed::rename(&mut records, &manifest);
        Self {
            records: in_order(records, &questions, &manifest.models),
            left_out: Vec::new(),
            questions,
            thumbnails,
            fidelity,
            folder: folder.to_owned(),
            manifest,
        }
    }

    /// Takes the records apart that a report does not show.
    pub(crate) fn leave_out(&mut self, shown: ShownModels) {
        if shown == ShownModels::Current {
            self.left_out = renamed::leave_out(&mut self.records, &self.manifest);
        }
    }

    /// Name of the run: that of its folder.
    pub(crate) fn name(&self) -> String {
        name(&self.folder)
    }
}

/// The lines of the files in a run folder, as they are stored.
pub(crate) struct RunLines<D> {
    pub(crate) records: Vec<Record<D>>,
    pub(crate) questions: Vec<RunQuestion>,
    pub(crate) thumbnails: Vec<Thumbnail>,
    pub(crate) fidelity: Vec<ImageFidelity>,
}

impl<D: Detail> RunLines<D> {
    /// Reads the files of a run folder: of each trial the last record.
    ///
    /// # Errors
    /// If a line of a file is broken.
    pub(crate) fn read(folder: &Path) -> Result<Self> {
        Ok(Self {
            records: store::read_records(folder)?,
            questions: store::read_questions(folder)?,
            thumbnails: store::read_thumbnails(folder)?,
            fidelity: store::read_fidelity(folder)?,
        })
    }
}

/// Records in the order of the questions, conditions and models (those that are listed first), whatever order the replies came in.
pub(crate) fn in_order<D: Detail>(
    mut records: Vec<Record<D>>,
    questions: &[RunQuestion],
    listed: &[ListedModel],
) -> Vec<Record<D>> {
    let order = {
        let places = records.iter().map(|record| TrialPlace {
            question: &record.question,
            condition: record.condition.as_ref(),
            model: &record.model,
            repeat: record.detail.repeat(),
            key: record.key,
        });
        order(&places.collect::<Vec<_>>(), questions, listed)
    };
    arrange(&mut records, order);
    records
}

/// What the place of a trial among those of its run follows from.
pub(super) struct TrialPlace<'t> {
    pub(super) question: &'t QuestionId,
    pub(super) condition: Option<&'t Condition>,
    pub(super) model: &'t str,
    pub(super) repeat: u32,
    pub(super) key: TrialKey,
}

/// The indices of trials in the order of [`in_order`].
pub(super) fn order(
    trials: &[TrialPlace<'_>],
    questions: &[RunQuestion],
    listed: &[ListedModel],
) -> Vec<usize> {
    let ids = questions.iter().map(|question| &question.id);
    let questions: HashMap<&QuestionId, usize> = ids.zip(0..).collect();
    let conditions = numbers(trials.iter().map(|trial| trial.condition));
    let listing = ModelListing::new(listed.iter().cloned());
    let models = numbers(trials.iter().map(|trial| {
        let place = listing.place(trial.model);
        (place, trial.model)
    }));
    let place = |(index, trial): (usize, &TrialPlace<'_>)| {
        let question = questions.get(trial.question).copied();
        let model = models[&(listing.place(trial.model), trial.model)];
        let names = (question, conditions[&trial.condition], model);
        (names, trial.repeat, trial.key, index)
    };
    let mut places: Vec<_> = trials.iter().enumerate().map(place).collect();
    places.sort_unstable();
    places.into_iter().map(|(.., index)| index).collect()
}

/// A number for each of these values, in their order.
pub(super) fn numbers<T: Ord + Hash>(values: impl Iterator<Item = T>) -> HashMap<T, usize> {
    let distinct: HashSet<T> = values.collect();
    let mut sorted: Vec<T> = distinct.into_iter().collect();
    sorted.sort_unstable();
    sorted.into_iter().zip(0..).collect()
}

/// Puts values into an order in place: first the value at the first index of `order`. It has each index once.
pub(super) fn arrange<T>(values: &mut [T], mut order: Vec<usize>) {
    for start in 0..order.len() {
        let mut place = start;
        loop {
            let from = std::mem::replace(&mut order[place], place);
            if from == start {
                break;
            }
            values.swap(place, from);
            place = from;
        }
    }
}

/// Name of the run in this folder: that of the folder.
pub(crate) fn name(folder: &Path) -> String {
    let whole = std::path::absolute(folder).unwrap_or_else(|_| folder.to_owned());
    let name = whole.file_name().unwrap_or(whole.as_os_str());
    name.to_string_lossy().into_owned()
}

/// A run of either experiment. Only this module tells experiments apart by the schema of their folders.
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
    pub(crate) fn of(folder: &Path) -> Result<Self> {
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
        Ok(match ExperimentKind::of(folder)? {
            ExperimentKind::Choice => Self::Choice(StoredRun::open(folder)?),
            ExperimentKind::Open => Self::Open(StoredRun::open(folder)?),
        })
    }
}

impl StoredRun<ChoiceDetail> {
    /// The run, if the true answers to its questions are known.
    ///
    /// # Errors
    /// If they are not. That error tells the user `why` they are needed.
    pub(crate) fn with_truths(self, why: &str) -> Result<Self> {
        let mut records = self.records.iter();
        if records.all(|record| record.detail.truth.is_some()) {
            return Ok(self);
        }
        Err(Error::Run {
            path: self.folder,
            problem: format!(
                "nobody knows the true answers to the questions of this run (--ask): {why}"
            ),
        })
    }

    /// Reads a run of questions with choices.
    ///
    /// # Errors
    /// If the folder holds no run, or one of open questions. That error tells the user what to do `instead`.
    pub(crate) fn of_choices(folder: &Path, instead: &str) -> Result<Self> {
        match AnyRun::open(folder)? {
            AnyRun::Choice(run) => Ok(run),
            AnyRun::Open(run) => Err(Error::Run {
                path: run.folder,
                problem: format!("the run asked open questions: {instead}"),
            }),
        }
    }
}

/// The manifest of the run in a folder, of either experiment.
///
/// # Errors
/// If the folder holds no run.
pub(crate) fn manifest(folder: &Path) -> Result<RunManifest> {
    let schema = match ExperimentKind::of(folder)? {
        ExperimentKind::Choice => ChoiceDetail::SCHEMA,
        ExperimentKind::Open => OpenDetail::SCHEMA,
    };
    store::read_manifest(folder, schema)?.ok_or_else(|| no_run(folder))
}

fn no_run(folder: &Path) -> Error {
    Error::Run {
        path: folder.to_owned(),
        problem: "no run in this folder: it has no manifest.json".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::arrange;

    #[test]
    fn values_are_put_into_any_order_in_place() {
        let values: Vec<usize> = (0..40).map(|value| value * value).collect();
        for step in [1, 3, 7, 9, 39] {
            let order: Vec<usize> = (0..40).map(|index| (index * step + 5) % 40).collect();
            let expected: Vec<usize> = order.iter().map(|index| values[*index]).collect();
            let mut arranged = values.clone();
            arrange(&mut arranged, order);
            assert_eq!(arranged, expected, "{step}");
        }
    }
}
