//! Joining several runs of either kind: [`join`].

use std::collections::{BTreeSet, HashMap, HashSet};
use std::ops::Range;
use std::path::PathBuf;

use super::cost::cost;
use crate::error::Result;
use crate::job::stored::StoredRun;
use crate::types::manifest::RunManifest;
use crate::types::{
    Detail, ImageFidelity, QuestionId, Record, RunQuestion, Thumbnail, TrialKey, View,
};

/// The runs, with all records, questions and thumbnails.
pub(super) struct Joined<D> {
    pub(super) runs: Vec<JoinedRun>,
    pub(super) records: Vec<Record<D>>,
    pub(super) questions: Vec<RunQuestion>,
    pub(super) thumbnails: Vec<Thumbnail>,
    pub(super) fidelity: Vec<ImageFidelity>,
}

/// One of the joined runs.
pub(super) struct JoinedRun {
    pub(super) folder: PathBuf,
    pub(super) name: String,
    pub(super) manifest: RunManifest,
    pub(super) cost: Option<String>,
    /// Range of its records among those of all runs.
    pub(super) records: Range<usize>,
}

/// Joins runs. If a model answered the same item in two runs as different trials (another seed, prompt or parameter), it is listed
/// once per run, with the run's name. A trial that two runs share counts once. Only records that are `compared` decide whether a
/// model is listed per run.
pub(super) fn join<D: Detail>(
    runs: Vec<StoredRun<D>>,
    compared: impl Fn(&Record<D>) -> bool,
) -> Result<Joined<D>> {
    let twice = answered_twice(&runs, compared);
    let names = names(&runs);
    let mut joined = Joined {
        runs: Vec::new(),
        records: Vec::new(),
        questions: Vec::new(),
        thumbnails: Vec::new(),
        fidelity: Vec::new(),
    };
    let mut known = HashSet::<TrialKey>::new();
    let mut listed = BTreeSet::<QuestionId>::new();
    let mut pictured = BTreeSet::new();
    for (run, name) in runs.into_iter().zip(names) {
        let first = joined.records.len();
        let cost = cost(&run.records)?;
        for mut record in run.records {
            if known.contains(&record.key) {
                continue;
            }
            if !record.failed() {
                known.insert(record.key);
            }
            if twice.contains(&(record.view, record.model.clone())) {
                record.model = format!("{} ({name})", record.model);
            }
            joined.records.push(record);
        }
        joined.runs.push(JoinedRun {
            folder: run.folder,
            name,
            manifest: run.manifest,
            cost,
            records: first..joined.records.len(),
        });
        let questions = run.questions.into_iter();
        let new = questions.filter(|question| listed.insert(question.id.clone()));
        joined.questions.extend(new);
        let thumbnails = run.thumbnails.into_iter();
        joined.thumbnails.extend(thumbnails.filter(|thumbnail| {
            pictured.insert((thumbnail.frame.clone(), thumbnail.condition.clone()))
        }));
        joined.fidelity.extend(run.fidelity);
    }
    Ok(joined)
}

/// Names of runs: those of their folders, or their paths if two folders have the same name.
fn names<D: Detail>(runs: &[StoredRun<D>]) -> Vec<String> {
    let short: Vec<String> = runs.iter().map(StoredRun::name).collect();
    let distinct: BTreeSet<&String> = short.iter().collect();
    if distinct.len() == runs.len() {
        return short;
    }
    let paths = runs.iter().map(|run| run.folder.display().to_string());
    paths.collect()
}

/// The models that answered the same item in two runs as different trials.
fn answered_twice<D: Detail>(
    runs: &[StoredRun<D>],
    compared: impl Fn(&Record<D>) -> bool,
) -> BTreeSet<(View, String)> {
    let mut keys = HashMap::new();
    let mut twice = BTreeSet::new();
    if runs.len() < 2 {
        return twice;
    }
    for (index, run) in runs.iter().enumerate() {
        for record in run.records.iter().filter(|record| compared(record)) {
            let item = (
                (record.view, &record.model),
                (&record.condition, &record.question),
                (record.detail.choices(), record.detail.repeat()),
            );
            let (key, first) = *keys.entry(item).or_insert((record.key, index));
            if key != record.key && first != index {
                twice.insert((record.view, record.model.clone()));
            }
        }
    }
    twice
}
