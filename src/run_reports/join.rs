//! Joining several runs of either kind: [`join`].

use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};
use std::path::PathBuf;

use super::cost::cost;
use super::lights::Lights;
use super::models::Names;
use crate::error::Result;
use crate::runs::stored::{RunLayout, RunTexts, StoredRun};
use crate::types::manifests::RunManifest;
use crate::types::{
    Condition, FrameId, ImageFidelity, ModelListing, QuestionId, RunQuestion, Thumbnail, TrialKey,
    TrialRef, Trials,
};
use darkqa_score::answers::record::Detail;

/// The runs, with all trials, questions and thumbnails.
pub(super) struct Joined<D: Detail> {
    /// The runs in the order in which they were named.
    pub(super) runs: Vec<JoinedRun>,
    pub(super) trials: Trials<D>,
    /// The texts of the replies, by the number of the file in the place of a text.
    pub(super) texts: Vec<RunTexts<D>>,
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
    pub(super) layout: RunLayout,
    pub(super) name: String,
    pub(super) manifest: RunManifest,
    pub(super) cost: Option<String>,
    /// The questions of the run, of which [`Joined::questions`] holds each once; none of a single run.
    pub(super) questions: Vec<RunQuestion>,
    /// Places of its trials among those of all runs. A trial that several runs have is stored once, and listed by each.
    pub(super) trials: TrialPlaces,
    /// Number of its replies.
    pub(super) replies: usize,
    /// Number of its replies that no run before it by name has.
    pub(super) added: usize,
    /// The names that servers gave for each model, by the name under which it was asked.
    pub(super) served: BTreeMap<String, BTreeSet<String>>,
    /// The models whose trials are not shown.
    pub(super) left_out: BTreeSet<String>,
}

/// The places of the trials of a run among those of all runs.
pub(super) enum TrialPlaces {
    /// All of so many.
    All(usize),
    /// Some of them.
    Some(Vec<u32>),
}

impl TrialPlaces {
    /// The places.
    pub(super) fn iter(&self) -> impl Iterator<Item = usize> {
        let (all, some) = match self {
            Self::All(count) => (0..*count, &[][..]),
            Self::Some(places) => (0..0, &**places),
        };
        all.chain(some.iter().map(|place| *place as usize))
    }

    /// Number of places.
    pub(super) fn len(&self) -> usize {
        match self {
            Self::All(count) => *count,
            Self::Some(places) => places.len(),
        }
    }
}

/// Joins runs. Conditions whose images differ between runs are kept apart ([`Lights`]), and so are models that were asked in
/// different ways or gave other replies to the same trials ([`Names`]). A trial to which two runs have the same reply counts once.
/// Only trials that are `compared` decide about models.
///
/// The result does not depend on the order of the runs, but for the order of [`Joined::runs`].
pub(super) fn join<D: Detail>(
    mut runs: Vec<StoredRun<D>>,
    compared: impl Fn(TrialRef<'_, D>) -> bool,
) -> Result<Joined<D>> {
    let names = names(&runs);
    let mut order: Vec<usize> = (0..runs.len()).collect();
    order.sort_by(|one, other| {
        (&names[*one], &runs[*one].folder).cmp(&(&names[*other], &runs[*other].folder))
    });
    let lights = Lights::new(&runs, &names, &order);
    for (index, run) in runs.iter_mut().enumerate().filter(|_| !lights.is_one()) {
        run.trials
            .change_conditions(|condition| lights.mark(condition, index));
        for thumbnail in &mut run.thumbnails {
            lights.mark(&mut thumbnail.condition, index);
        }
    }
    let models = Names::new(&runs, &names, &order, &compared);
    let mut joined = Joined {
        runs: Vec::new(),
        trials: Trials::default(),
        texts: Vec::new(),
        questions: Vec::new(),
        thumbnails: Vec::new(),
        fidelity: Vec::new(),
        lights,
        models,
        listing: ModelListing::default(),
    };
    let mut known = Known {
        trials: (runs.len() > 1).then(HashMap::new),
        ..Known::default()
    };
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

/// Trials of the runs that are already joined, so that nothing is added twice.
#[derive(Default)]
struct Known {
    /// Places of the trials with a reply, by key and by the group of the model's name; `None` of a single run, which has each trial once.
    trials: Option<HashMap<(TrialKey, usize), u32>>,
    questions: HashMap<QuestionId, usize>,
    thumbnails: BTreeSet<(FrameId, Condition)>,
}

impl<D: Detail> Joined<D> {
    /// Adds the questions of a run that no run before it has.
    fn add_questions(&mut self, own: &[RunQuestion], known: &mut Known) {
        for question in own {
            let next = self.questions.len();
            let place = *known.questions.entry(question.id.clone()).or_insert(next);
            if place == next {
                self.questions.push(question.clone());
                continue;
            }
            let known = &mut self.questions[place];
            if known.group.is_none() {
                known.group.clone_from(&question.group);
            }
            if known.scene.is_empty() {
                known.scene.clone_from(&question.scene);
            }
        }
    }

    /// The trials of a run.
    pub(super) fn trials_of(&self, run: &JoinedRun) -> impl Iterator<Item = TrialRef<'_, D>> {
        run.trials.iter().map(|place| self.trials.at(place))
    }

    /// Adds the trials of a run that no run before it has. Returns the places of all of its trials, and the numbers of its replies and
    /// of those that are new.
    fn add_trials(
        &mut self,
        mut own: Trials<D>,
        index: usize,
        known: &mut Known,
    ) -> (TrialPlaces, usize, usize) {
        let replies = own.iter().filter(|trial| !trial.failed()).count();
        if known.trials.is_none() {
            let places = TrialPlaces::All(own.len());
            own.drop_keys();
            self.trials = own;
            return (places, replies, replies);
        }
        let key = |trial: TrialRef<'_, D>| {
            let group = self.models.group(trial.model(), index);
            let group = group.map_or(0, |(group, _)| group + 1);
            (self.models.key(trial.key()), group)
        };
        let mut places = Vec::with_capacity(own.len());
        let mut is_new = Vec::with_capacity(own.len());
        let (mut next, mut added) = (self.trials.len() as u32, 0);
        for trial in own.iter() {
            let key = key(trial);
            let found = known.trials.as_ref();
            let found = found.and_then(|trials| trials.get(&key).copied());
            let place = found.unwrap_or(next);
            is_new.push(place == next);
            if place == next {
                next += 1;
                if !trial.failed() {
                    added += 1;
                    known
                        .trials
                        .as_mut()
                        .map(|trials| trials.insert(key, place));
                }
            }
            places.push(place);
        }
        own.rename(|model| {
            self.models
                .group(model, index)
                .map(|(_, name)| name.clone())
        });
        if self.trials.is_empty() && self.texts.is_empty() {
            // The trials of the first run stay where they are.
            let mut is_new = is_new.into_iter();
            own.retain(|_| is_new.next() == Some(true));
            self.trials = own;
        } else {
            let logs = self.texts.len();
            for (trial, _) in own.iter().zip(is_new).filter(|(_, is_new)| *is_new) {
                self.trials.copy(trial, logs);
            }
        }
        (TrialPlaces::Some(places), replies, added)
    }

    /// Adds what a run has and no run before it.
    fn add(
        &mut self,
        run: StoredRun<D>,
        index: usize,
        name: String,
        known: &mut Known,
    ) -> Result<JoinedRun> {
        let charged = run.trials.iter().chain(run.left_out.iter());
        let cost = cost(charged, &run.manifest)?;
        let left_out = run
            .left_out
            .asked()
            .into_iter()
            .flatten()
            .map(|(model, _)| model.to_owned())
            .collect();
        let served = served(&run.trials);
        let (trials, replies, added) = self.add_trials(run.trials, index, known);
        self.texts.extend(run.texts.by_file());
        let questions = if known.trials.is_some() {
            self.add_questions(&run.questions, known);
            run.questions
        } else {
            self.questions = run.questions;
            Vec::new()
        };
        let thumbnails = run.thumbnails.into_iter();
        self.thumbnails.extend(thumbnails.filter(|thumbnail| {
            let place = (thumbnail.frame.clone(), thumbnail.condition.clone());
            known.thumbnails.insert(place)
        }));
        if self.fidelity.is_empty() {
            self.fidelity = run.fidelity;
        } else {
            self.fidelity.extend(run.fidelity);
        }
        Ok(JoinedRun {
            folder: run.folder,
            layout: run.layout,
            name,
            manifest: run.manifest,
            cost,
            questions,
            trials,
            replies,
            added,
            served,
            left_out,
        })
    }
}

/// The names that servers gave for each model.
fn served<D: Detail>(trials: &Trials<D>) -> BTreeMap<String, BTreeSet<String>> {
    let pairs: HashSet<(&str, &str)> = trials
        .iter()
        .filter_map(|trial| Some((trial.model(), trial.served_model()?)))
        .collect();
    let mut served = BTreeMap::<String, BTreeSet<String>>::new();
    for (model, name) in pairs {
        served
            .entry(model.to_owned())
            .or_default()
            .insert(name.to_owned());
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
    runs.iter()
        .map(|run| run.folder.display().to_string())
        .collect()
}
