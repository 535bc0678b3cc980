//! The trials of parts of a run by the places of their records, so that joining them holds no record: [`PlacedTrial`].

use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::path::Path;

use crate::error::{Error, Result};
use crate::job::renamed::rename;
use crate::job::stored::{TrialPlace, arrange, order};
use crate::store::{LinePlace, RecordLog, Store, each_record};
use crate::types::manifest::RunManifest;
use crate::types::recorded_names::RecordedNames;
use crate::types::{
    Condition, Detail, Distinct, ListedModel, QuestionId, Record, RunQuestion, Shared, TrialKey,
};

/// A trial, with the place of its record in the file of a run.
pub(super) struct PlacedTrial {
    pub(super) key: TrialKey,
    question: Shared<QuestionId>,
    condition: Option<Shared<Condition>>,
    /// The name of the model in tables.
    model: Shared<String>,
    repeat: u32,
    failed: bool,
    pub(super) place: LinePlace,
}

impl PlacedTrial {
    /// Whether no reply came.
    pub(super) fn failed(&self) -> bool {
        self.failed
    }
}

/// The trials of a run folder, by the last record of each, in the order of the first.
///
/// # Errors
/// If a line is not a record.
pub(super) fn placed_trials<D: Detail>(
    folder: &Path,
    manifest: &RunManifest,
) -> Result<Vec<PlacedTrial>> {
    let names = RecordedNames::of(manifest);
    let mut latest = HashMap::<TrialKey, usize>::new();
    let mut trials: Vec<PlacedTrial> = Vec::new();
    let (mut questions, mut conditions) = (Distinct::default(), Distinct::default());
    let mut models = Distinct::default();
    each_record(folder, |record: Record<D>, place| {
        let mut trial = PlacedTrial {
            key: record.key,
            failed: record.failed(),
            repeat: record.detail.repeat(),
            model: names.shown(&record.model).to_owned().into(),
            question: record.question.into(),
            condition: record.condition.map(Shared::from),
            place,
        };
        questions.share(&mut trial.question);
        models.share(&mut trial.model);
        if let Some(condition) = &mut trial.condition {
            conditions.share(condition);
        }
        if let Some(&index) = latest.get(&trial.key) {
            trials[index] = trial;
        } else {
            latest.insert(trial.key, trials.len());
            trials.push(trial);
        }
    })?;
    Ok(trials)
}

/// The trials of all parts in the order of the questions, each with the index of its part.
pub(super) fn in_order(
    mut trials: Vec<(usize, PlacedTrial)>,
    questions: &[RunQuestion],
    listed: &[ListedModel],
) -> Vec<(usize, PlacedTrial)> {
    let order = {
        let places = trials.iter().map(|(_, trial)| TrialPlace {
            question: &trial.question,
            condition: trial.condition.as_deref(),
            model: &trial.model,
            repeat: trial.repeat,
            key: trial.key,
        });
        order(&places.collect::<Vec<_>>(), questions, listed)
    };
    arrange(&mut trials, order);
    trials
}

/// The records of several run folders, to read single ones.
pub(super) struct PartLogs<'a> {
    folders: Vec<&'a Path>,
    open: HashMap<usize, RecordLog>,
}

impl<'a> PartLogs<'a> {
    /// The records in these folders, which are numbered from 0. No file is opened yet.
    pub(super) fn of(folders: &[&'a Path]) -> Self {
        Self {
            folders: folders.to_vec(),
            open: HashMap::new(),
        }
    }

    fn log(&mut self, part: usize) -> Result<&mut RecordLog> {
        Ok(match self.open.entry(part) {
            Entry::Occupied(open) => open.into_mut(),
            Entry::Vacant(first) => first.insert(RecordLog::open(self.folders[part])?),
        })
    }

    /// The line of a trial of a folder.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub(super) fn line(&mut self, part: usize, place: LinePlace) -> Result<Vec<u8>> {
        self.log(part)?.line(place)
    }

    /// A record of a folder from its line.
    ///
    /// # Errors
    /// If the line is not a record.
    pub(super) fn record<D: Detail>(&mut self, part: usize, line: &[u8]) -> Result<Record<D>> {
        self.log(part)?.record(line)
    }
}

/// Appends the records of these trials to a run that lacks them, one after another. Where a run has the same names of models in its
/// records as the part that a record is from, its line is copied.
///
/// # Errors
/// If a record cannot be read or written.
pub(super) fn append<D: Detail>(
    store: &mut Store<D>,
    manifest: &RunManifest,
    parts: &[(&Path, &RunManifest)],
    trials: &[(usize, PlacedTrial)],
) -> Result<()> {
    let names = RecordedNames::of(manifest);
    let present = placed_trials::<D>(store.folder(), manifest)?;
    let present: HashMap<TrialKey, LinePlace> = present
        .into_iter()
        .map(|trial| (trial.key, trial.place))
        .collect();
    let own = RecordLog::open(store.folder())?;
    let mut logs = PartLogs::of(&parts.iter().map(|(folder, _)| *folder).collect::<Vec<_>>());
    for (part, trial) in trials {
        let of_part = parts[*part].1;
        let log = logs.log(*part)?;
        let line = log.line(trial.place)?;
        let shown = |log: &RecordLog, line: &[u8], manifest: &RunManifest| {
            let mut record = log.record::<D>(line)?;
            rename(std::slice::from_mut(&mut record), manifest);
            Ok::<_, Error>(record)
        };
        if let Some(place) = present.get(&trial.key) {
            let present = own.line(*place)?;
            let is_same =
                || Ok::<_, Error>(shown(&own, &present, manifest)? == shown(log, &line, of_part)?);
            if present == line || is_same()? {
                continue;
            }
        }
        if RecordedNames::of(of_part) == names {
            store.append_line(&line)?;
        } else {
            store.append(&shown(log, &line, of_part)?)?;
        }
    }
    Ok(())
}
