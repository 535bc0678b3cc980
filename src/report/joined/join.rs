//! Joins several runs of either kind: [`join`].

use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};
use std::path::PathBuf;

use super::cost::cost_text;
use super::image_groups::ImageGroups;
use super::model_names::ModelNames;
use darkqa_base::error::Result;
use darkqa_base::types::manifests::RunManifest;
use darkqa_base::types::{
    Condition, FrameId, ImageFidelity, ModelListing, QuestionId, RunQuestion, Thumbnail, TrialKey, TrialRef, Trials,
};
use darkqa_runs::stored::{RunLayout, RunTexts, StoredRun};
use darkqa_score::answers::record::Detail;

/// Joined runs, with all their trials, questions and thumbnails.
pub(super) struct Joined<D: Detail> {
    /// The runs in the order in which they were given.
    pub(super) runs: Vec<JoinedRun>,
    pub(super) trials: Trials<D>,
    /// The texts of the replies, by the file number in [`TextPlace::log`](darkqa_base::types::TextPlace).
    pub(super) texts: Vec<RunTexts<D>>,
    pub(super) questions: Vec<RunQuestion>,
    pub(super) thumbnails: Vec<Thumbnail>,
    pub(super) fidelity: Vec<ImageFidelity>,
    /// The groups of runs whose images are equal.
    pub(super) image_groups: ImageGroups,
    /// The names of the models in the report.
    pub(super) model_names: ModelNames,
    /// The order, groups and marks of the models; empty by default.
    pub(super) listing: ModelListing,
}

/// One of the joined runs.
pub(super) struct JoinedRun {
    pub(super) folder: PathBuf,
    pub(super) layout: RunLayout,
    pub(super) name: String,
    pub(super) manifest: RunManifest,
    pub(super) cost: Option<String>,
    /// The questions of the run; empty if only one run is reported, whose questions are in [`Joined::questions`].
    pub(super) questions: Vec<RunQuestion>,
    /// Indices of the run's trials in [`Joined::trials`]. A trial that several runs share has the same index in each.
    pub(super) trials: TrialPlaces,
    /// Number of replies.
    pub(super) replies: usize,
    /// Number of replies that no earlier run has, in the order of run names.
    pub(super) added: usize,
    /// The names that servers reported for each model, by the name under which it was asked.
    pub(super) served: BTreeMap<String, BTreeSet<String>>,
    /// The models whose trials are left out.
    pub(super) left_out: BTreeSet<String>,
}

/// Indices of the trials of a run among those of all runs.
pub(super) enum TrialPlaces {
    /// All trials, with their number.
    All(usize),
    Some(Vec<u32>),
}

impl TrialPlaces {
    pub(super) fn iter(&self) -> impl Iterator<Item = usize> {
        let (all, some) = match self {
            Self::All(count) => (0..*count, &[][..]),
            Self::Some(places) => (0..0, &**places),
        };
        all.chain(some.iter().map(|place| *place as usize))
    }

    pub(super) fn len(&self) -> usize {
        match self {
            Self::All(count) => *count,
            Self::Some(places) => places.len(),
        }
    }
}

/// Joins runs. Conditions whose images differ between runs are split ([`ImageGroups`]), and so are models that were
/// asked in different ways or gave different replies to the same trials ([`ModelNames`]). A trial to which two runs
/// have the same reply counts once. Models are compared only by the trials for which `is_compared` returns true.
///
/// Only the order of [`Joined::runs`] depends on the order of `runs`.
pub(super) fn join<D: Detail>(
    mut runs: Vec<StoredRun<D>>,
    is_compared: impl Fn(TrialRef<'_, D>) -> bool,
) -> Result<Joined<D>> {
    let names = distinct_names(&runs);
    let mut order: Vec<usize> = (0..runs.len()).collect();
    order.sort_by(|one, other| (&names[*one], &runs[*one].folder).cmp(&(&names[*other], &runs[*other].folder)));
    let image_groups = ImageGroups::new(&runs, &names, &order);
    if image_groups.is_split() {
        for (index, run) in runs.iter_mut().enumerate() {
            run.trials.change_conditions(|condition| image_groups.mark(condition, index));
            for thumbnail in &mut run.thumbnails {
                image_groups.mark(&mut thumbnail.condition, index);
            }
        }
    }
    let model_names = ModelNames::new(&runs, &names, &order, &is_compared);
    let mut joined = Joined {
        runs: Vec::new(),
        trials: Trials::default(),
        texts: Vec::new(),
        questions: Vec::new(),
        thumbnails: Vec::new(),
        fidelity: Vec::new(),
        image_groups,
        model_names,
        listing: ModelListing::default(),
    };
    let mut known = AlreadyJoined { trials: (runs.len() > 1).then(HashMap::new), ..AlreadyJoined::default() };
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

/// Trials, questions and thumbnails of the runs joined so far, so that none is added twice.
#[derive(Default)]
struct AlreadyJoined {
    /// Indices of the trials with a reply, by key and number of the model's group; `None` if there is only one run.
    trials: Option<HashMap<(TrialKey, usize), u32>>,
    questions: HashMap<QuestionId, usize>,
    thumbnails: BTreeSet<(FrameId, Condition)>,
}

impl<D: Detail> Joined<D> {
    /// Adds the questions of a run that no earlier run has, and fills in missing groups and scenes of the others.
    fn add_questions(&mut self, own: &[RunQuestion], known: &mut AlreadyJoined) {
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

    /// Adds the trials of a run that no earlier run has. Returns the indices of all its trials, the number of its
    /// replies, and the number of new replies.
    fn add_trials(
        &mut self,
        mut own: Trials<D>,
        index: usize,
        known: &mut AlreadyJoined,
    ) -> (TrialPlaces, usize, usize) {
        let replies = own.iter().filter(|trial| !trial.failed()).count();
        if known.trials.is_none() {
            let places = TrialPlaces::All(own.len());
            own.drop_keys();
            self.trials = own;
            return (places, replies, replies);
        }
        let key = |trial: TrialRef<'_, D>| {
            let group = self.model_names.group(trial.model(), index);
            let group = group.map_or(0, |(group, _)| group + 1);
            (self.model_names.first_key(trial.key()), group)
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
                    known.trials.as_mut().map(|trials| trials.insert(key, place));
                }
            }
            places.push(place);
        }
        own.rename(|model| self.model_names.group(model, index).map(|(_, name)| name.clone()));
        if self.trials.is_empty() && self.texts.is_empty() {
            // The trials of the first run are moved, not copied.
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

    /// Adds the trials, questions and thumbnails of a run that no earlier run has.
    fn add(&mut self, run: StoredRun<D>, index: usize, name: String, known: &mut AlreadyJoined) -> Result<JoinedRun> {
        let cost = cost_text(run.trials.iter().chain(run.left_out.iter()), &run.manifest)?;
        let left_out = run.left_out.asked().into_iter().flatten().map(|(model, _)| model.to_owned()).collect();
        let served = served_names(&run.trials);
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
            // Moved, not copied: the list of a large run takes much memory.
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

/// The names that servers reported for each model.
fn served_names<D: Detail>(trials: &Trials<D>) -> BTreeMap<String, BTreeSet<String>> {
    let pairs: HashSet<(&str, &str)> =
        trials.iter().filter_map(|trial| Some((trial.model(), trial.served_model()?))).collect();
    let mut served = BTreeMap::<String, BTreeSet<String>>::new();
    for (model, name) in pairs {
        served.entry(model.to_owned()).or_default().insert(name.to_owned());
    }
    served
}

/// The folder names of runs, or their paths if two folders have the same name.
fn distinct_names<D: Detail>(runs: &[StoredRun<D>]) -> Vec<String> {
    let short: Vec<String> = runs.iter().map(StoredRun::name).collect();
    let distinct: BTreeSet<&String> = short.iter().collect();
    if distinct.len() == runs.len() {
        return short;
    }
    runs.iter().map(|run| run.folder.display().to_string()).collect()
}
