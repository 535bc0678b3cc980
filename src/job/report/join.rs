//! Joining several runs of either kind: [`join`].

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::path::PathBuf;

use super::cost::cost;
use super::lights::Lights;
use super::models::Names;
use crate::error::Result;
use crate::job::stored::StoredRun;
use crate::types::manifest::RunManifest;
use crate::types::{
    Condition, Detail, FrameId, ImageFidelity, ModelListing, QuestionId, Record, RunQuestion,
    Thumbnail, TrialKey,
};

/// The runs, with all records, questions and thumbnails.
pub(super) struct Joined<D> {
    /// The runs in the order in which they were named.
    pub(super) runs: Vec<JoinedRun>,
    pub(super) records: Vec<Record<D>>,
    pub(super) questions: Vec<RunQuestion>,
    pub(super) thumbnails: Vec<Thumbnail>,
    pub(super) fidelity: Vec<ImageFidelity>,
    /// The images that differ between runs.
    pub(super) lights: Lights,
    /// The models that stand apart.
    pub(super) models: Names,
    /// The order, groups and marks of the models; by default none.
    pub(super) listing: ModelListing,
}

/// One of the joined runs.
pub(super) struct JoinedRun {
    pub(super) folder: PathBuf,
    pub(super) name: String,
    pub(super) manifest: RunManifest,
    pub(super) cost: Option<String>,
    /// The questions of the run, of which [`Joined::questions`] holds each once.
    pub(super) questions: Vec<RunQuestion>,
    /// Places of its records among those of all runs. A record that several runs have is stored once, and listed by each.
    pub(super) records: Vec<usize>,
    /// Number of its replies.
    pub(super) replies: usize,
    /// Number of its replies that no run before it by name has.
    pub(super) added: usize,
    /// The names that servers gave for each model, by the name under which it was asked.
    pub(super) served: BTreeMap<String, BTreeSet<String>>,
    /// The models whose records are not shown.
    pub(super) left_out: BTreeSet<String>,
}

/// Joins runs. Conditions whose images differ between runs are kept apart ([`Lights`]), and so are models that were asked in
/// different ways or gave other replies to the same trials ([`Names`]). A trial to which two runs have the same reply counts once.
/// Only records that are `compared` decide about models.
///
/// The result does not depend on the order of the runs, but for the order of [`Joined::runs`].
pub(super) fn join<D: Detail>(
    mut runs: Vec<StoredRun<D>>,
    compared: impl Fn(&Record<D>) -> bool,
) -> Result<Joined<D>> {
    let names = names(&runs);
    let mut order: Vec<usize> = (0..runs.len()).collect();
    order.sort_by(|one, other| {
        (&names[*one], &runs[*one].folder).cmp(&(&names[*other], &runs[*other].folder))
    });
    let lights = Lights::of(&runs, &names, &order);
    for (index, run) in runs.iter_mut().enumerate().filter(|_| !lights.is_one()) {
        let records = run.records.iter_mut();
        for condition in records.filter_map(|record| record.condition.as_mut()) {
            lights.mark(condition, index);
        }
        for thumbnail in &mut run.thumbnails {
            lights.mark(&mut thumbnail.condition, index);
        }
    }
    let models = Names::of(&runs, &names, &order, &compared);
    let mut joined = Joined {
        runs: Vec::new(),
        records: Vec::new(),
        questions: Vec::new(),
        thumbnails: Vec::new(),
        fidelity: Vec::new(),
        lights,
        models,
        listing: ModelListing::default(),
    };
    let mut known = Known::default();
    let mut runs: Vec<Option<StoredRun<D>>> = runs.into_iter().map(Some).collect();
    let mut by_name = Vec::new();
    for index in order {
        if let Some(run) = runs[index].take() {
            let run = joined.add(run, index, names[index].clone(), &mut known)?;
            by_name.push((index, run));
        }
    }
    by_name.sort_by_key(|(index, _)| *index);
    joined.runs = by_name.into_iter().map(|(_, run)| run).collect();
    Ok(joined)
}

/// What the runs that are already joined have, so that nothing is added twice.
#[derive(Default)]
struct Known {
    /// Places of the records with a reply, by key and by the group of the model's name.
    trials: HashMap<(TrialKey, usize), usize>,
    questions: HashMap<QuestionId, usize>,
    thumbnails: BTreeSet<(FrameId, Condition)>,
}

impl<D: Detail> Joined<D> {
    /// Adds what a run has and no run before it.
    fn add(
        &mut self,
        run: StoredRun<D>,
        index: usize,
        name: String,
        known: &mut Known,
    ) -> Result<JoinedRun> {
        let charged = run.records.iter().chain(&run.left_out);
        let cost = cost(charged, &run.manifest)?;
        let left_out: BTreeSet<String> = run
            .left_out
            .into_iter()
            .map(|record| record.model)
            .collect();
        let mut records = Vec::with_capacity(run.records.len());
        let (mut replies, mut added) = (0, 0);
        let served = served(&run.records);
        let mut next = self.records.len();
        let new = run.records.into_iter().filter_map(|mut record| {
            replies += usize::from(!record.failed());
            let group = self.models.group(&record.model, index);
            let trial = (
                self.models.key(record.key),
                group.map_or(0, |(group, _)| group + 1),
            );
            if let Some(place) = known.trials.get(&trial) {
                records.push(*place);
                return None;
            }
            if !record.failed() {
                known.trials.insert(trial, next);
                added += 1;
            }
            if let Some((_, name)) = group {
                record.model.clone_from(name);
            }
            records.push(next);
            next += 1;
            Some(record)
        });
        // The records of the first run stay where they are.
        let mut new: Vec<Record<D>> = new.collect();
        if self.records.is_empty() {
            self.records = new;
        } else {
            self.records.append(&mut new);
        }
        for question in &run.questions {
            let next = self.questions.len();
            let place = *known.questions.entry(question.id.clone()).or_insert(next);
            if place == next {
                self.questions.push(question.clone());
            } else if self.questions[place].group.is_none() {
                self.questions[place].group.clone_from(&question.group);
            }
        }
        let thumbnails = run.thumbnails.into_iter();
        self.thumbnails.extend(thumbnails.filter(|thumbnail| {
            let place = (thumbnail.frame.clone(), thumbnail.condition.clone());
            known.thumbnails.insert(place)
        }));
        self.fidelity.extend(run.fidelity);
        Ok(JoinedRun {
            folder: run.folder,
            name,
            manifest: run.manifest,
            cost,
            questions: run.questions,
            records,
            replies,
            added,
            served,
            left_out,
        })
    }
}

/// The names that servers gave for each model.
fn served<D>(records: &[Record<D>]) -> BTreeMap<String, BTreeSet<String>> {
    let pairs = records
        .iter()
        .filter_map(|record| Some((&record.model, record.served_model.as_ref()?)));
    let pairs: BTreeSet<(&String, &String)> = pairs.collect();
    let mut served = BTreeMap::<String, BTreeSet<String>>::new();
    for (model, name) in pairs {
        served
            .entry(model.clone())
            .or_default()
            .insert(name.clone());
    }
    served
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
