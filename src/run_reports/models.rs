//! Models of one name that were asked in different ways in two runs, or gave other replies to the same trials, stand apart: [`Names`].

use std::collections::{BTreeMap, BTreeSet, HashMap};

use super::settings::{Setting, Settings, differing, is_digest, parameters};
use crate::runs::stored::StoredRun;
use crate::types::flags::spelled_setting;
use crate::types::{Condition, QuestionId, RunQuestion, TrialKey, TrialRef, View};
use darkqa_score::answers::record::Detail;

/// The most settings in the name of a model; with more, the run's name stands there.
const MOST_SETTINGS: usize = 2;

/// The longest value of a setting in the name of a model, in letters.
const LONGEST_VALUE: usize = 24;

/// The item of a trial: the model, its view and condition, the question, its choices as shown, and how many times it was asked before.
pub(super) type Item<'a> = (
    (View, &'a str),
    (Option<&'a Condition>, &'a QuestionId),
    (&'a [String], u32),
);

/// The item of a trial.
pub(super) fn item<D: Detail>(trial: TrialRef<'_, D>) -> Item<'_> {
    (
        (trial.view(), trial.model()),
        (trial.condition(), trial.question()),
        (trial.choices(), trial.repeat()),
    )
}

/// The names of models that stand apart, by model and run.
#[derive(Debug, Default)]
pub(super) struct Names {
    /// The number of the group and the name, by model and run.
    by_run: HashMap<String, HashMap<usize, (usize, String)>>,
    /// The keys of trials that repeat another one by image, words, model and parameters, with the key of that one.
    repeated: HashMap<TrialKey, TrialKey>,
    /// The models that stand apart.
    pub(super) apart: Vec<ModelApart>,
}

/// A model that stands in a report under several names, and why.
#[derive(Debug)]
pub(super) struct ModelApart {
    /// The name under which it was asked.
    pub(super) model: String,
    /// The names under which it stands.
    pub(super) names: Vec<String>,
    /// The runs behind each name.
    groups: Vec<Vec<usize>>,
    /// The settings that differ.
    pub(super) differences: Vec<Setting>,
    /// How each two runs under different names asked it the same items.
    overlaps: Vec<Overlap>,
}

impl ModelApart {
    /// The overlap of the two runs that differ most.
    pub(super) fn overlap(&self) -> Overlap {
        let most = self
            .overlaps
            .iter()
            .copied()
            .max_by_key(|overlap| overlap.differing());
        most.unwrap_or_default()
    }

    /// Whether all runs asked it in the same way, and only its replies differ.
    pub(super) fn differs_by_replies_alone(&self) -> bool {
        let mut overlaps = self.overlaps.iter();
        self.differences.is_empty()
            && overlaps.all(|overlap| overlap.other_trials + overlap.other_served == 0)
    }
}

impl Names {
    /// The names of the models in these runs; conditions are marked by their light. `order` holds the numbers of the runs in the
    /// order of their names, `names`. Only trials that are `compared` count.
    pub(super) fn new<D: Detail>(
        runs: &[StoredRun<D>],
        names: &[String],
        order: &[usize],
        compared: impl Fn(TrialRef<'_, D>) -> bool,
    ) -> Self {
        let mut found = Self::default();
        if runs.len() < 2 {
            return found;
        }
        // The runs of each model, in the order of their names.
        let mut having = BTreeMap::<&str, Vec<usize>>::new();
        for &index in order {
            for trial in runs[index].trials.iter().filter(|trial| compared(*trial)) {
                let runs = having.entry(trial.model()).or_default();
                if runs.last() != Some(&index) {
                    runs.push(index);
                }
            }
        }
        having.retain(|_, runs| runs.len() > 1);
        let (overlaps, repeated) = overlaps(runs, order, compared);
        found.repeated = repeated;
        for (model, having) in having {
            let settings: Vec<Option<Settings>> = runs
                .iter()
                .enumerate()
                .map(|(index, run)| {
                    let settings = parameters(&run.manifest, model);
                    settings.filter(|_| having.contains(&index))
                })
                .collect();
            let overlap = |run: usize, other: usize| {
                let pair = (model, run.min(other), run.max(other));
                overlaps.get(&pair).copied().unwrap_or_default()
            };
            let groups = grouped(&having, |run, other| {
                let known = settings[run].as_ref().zip(settings[other].as_ref());
                known.is_none_or(|(one, other)| one == other) && overlap(run, other).agrees()
            });
            if groups.len() > 1 {
                let differences = differing(&settings);
                let suffixes = suffixes(&groups, &differences, names);
                let apart = suffixes.iter().map(|suffix| format!("{model} ({suffix})"));
                found.add(ModelApart {
                    model: model.to_owned(),
                    names: apart.collect(),
                    overlaps: between(&groups, overlap),
                    differences,
                    groups,
                });
            }
        }
        found
    }

    fn add(&mut self, apart: ModelApart) {
        let named = apart.groups.iter().zip(&apart.names).enumerate().flat_map(
            |(number, (group, name))| group.iter().map(move |run| (*run, (number, name.clone()))),
        );
        self.by_run.insert(apart.model.clone(), named.collect());
        self.apart.push(apart);
    }

    /// The group of a run among those that asked a model in different ways, and the name of the model there; `None` if all
    /// asked it in the same way.
    pub(super) fn group(&self, model: &str, run: usize) -> Option<(usize, &String)> {
        let (group, name) = self.by_run.get(model)?.get(&run)?;
        Some((*group, name))
    }

    /// The name under which a model was asked.
    pub(super) fn asked<'a>(&'a self, name: &'a str) -> &'a str {
        let renamed = self
            .by_run
            .iter()
            .find(|(_, runs)| runs.values().any(|(_, new)| new == name));
        renamed.map_or(name, |(model, _)| model)
    }

    /// The key under which a trial is counted.
    pub(super) fn key(&self, key: TrialKey) -> TrialKey {
        self.repeated.get(&key).copied().unwrap_or(key)
    }
}

/// Runs in groups in which each two are the same.
fn grouped(runs: &[usize], is_same: impl Fn(usize, usize) -> bool) -> Vec<Vec<usize>> {
    let mut groups: Vec<Vec<usize>> = Vec::new();
    for &run in runs {
        let mut known = groups.iter_mut();
        match known.find(|group| group.iter().all(|other| is_same(run, *other))) {
            Some(group) => group.push(run),
            None => groups.push(vec![run]),
        }
    }
    groups
}

/// The overlaps of each two runs of different groups.
fn between(groups: &[Vec<usize>], overlap: impl Fn(usize, usize) -> Overlap) -> Vec<Overlap> {
    let mut overlaps = Vec::new();
    for (place, group) in groups.iter().enumerate() {
        for other in groups[place + 1..].iter().flatten() {
            overlaps.extend(group.iter().map(|run| overlap(*run, *other)));
        }
    }
    overlaps
}

/// Suffixes that tell the groups of runs apart: the settings if they are few and short, else the name of the first run.
fn suffixes(groups: &[Vec<usize>], differences: &[Setting], names: &[String]) -> Vec<String> {
    let is_short = |setting: &Setting| {
        let fits = |value: &String| value.chars().count() <= LONGEST_VALUE && !is_digest(value);
        setting.flag.starts_with("--") && setting.values.iter().all(|(_, value)| fits(value))
    };
    let by_settings = |group: &Vec<usize>| -> Option<String> {
        let of_group = differences.iter().map(|setting| {
            let mut values = setting.values.iter().filter(|(run, _)| group.contains(run));
            let (_, value) = values.next()?;
            Some(format!("{} {value}", spelled_setting(&setting.flag)))
        });
        Some(of_group.collect::<Option<Vec<_>>>()?.join(", "))
    };
    let named: Option<Vec<String>> = groups.iter().map(by_settings).collect();
    let distinct = named.filter(|named| {
        let distinct: BTreeSet<&String> = named.iter().collect();
        distinct.len() == groups.len()
            && differences.len() <= MOST_SETTINGS
            && differences.iter().all(is_short)
    });
    distinct.unwrap_or_else(|| groups.iter().map(|group| names[group[0]].clone()).collect())
}

/// How two runs asked a model the same items.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Overlap {
    /// Number of trials to which both runs have a reply.
    pub(super) repeated: usize,
    /// Number of those with other replies.
    pub(super) other_replies: usize,
    /// Number of those for which the server named another model.
    pub(super) other_served: usize,
    /// Number of items that are other trials, as their keys tell.
    pub(super) other_trials: usize,
}

impl Overlap {
    /// Whether the runs can stand as one.
    fn agrees(self) -> bool {
        self.differing() == 0
    }

    fn differing(self) -> usize {
        self.other_replies + self.other_served + self.other_trials
    }

    /// Adds a trial that both runs asked.
    fn add<D: Detail>(&mut self, one: TrialRef<'_, D>, other: TrialRef<'_, D>) {
        if one.failed() || other.failed() {
            return;
        }
        let served = one.served_model().zip(other.served_model());
        self.repeated += 1;
        self.other_replies += usize::from(!one.has_reply_of(other));
        self.other_served += usize::from(served.is_some_and(|(one, other)| one != other));
    }
}

/// The overlap of each two runs, by model.
type Overlaps<'a> = HashMap<(&'a str, usize, usize), Overlap>;

/// The overlaps of each two runs; and the trials that repeat another one. The keys of two trials may differ although the image, the
/// words, the model and its parameters are the same: the program may make the same image in two ways.
fn overlaps<'a, D: Detail>(
    runs: &'a [StoredRun<D>],
    order: &[usize],
    compared: impl Fn(TrialRef<'_, D>) -> bool,
) -> (Overlaps<'a>, HashMap<TrialKey, TrialKey>) {
    let texts: Vec<HashMap<&QuestionId, &RunQuestion>> = runs
        .iter()
        .map(|run| {
            run.questions
                .iter()
                .map(|question| (&question.id, question))
                .collect()
        })
        .collect();
    let is_repeated = |[one, other]: [(usize, TrialRef<'_, D>); 2]| {
        let words = [one, other].map(|(run, trial)| texts[run].get(trial.question()));
        let same_words = match words {
            [Some(one), Some(other)] => (&one.text, &one.choices) == (&other.text, &other.choices),
            _ => false,
        };
        let [(run, trial), (other_run, other)] = [one, other];
        let image = trial.sent();
        let same_image = trial.view() == View::Image && image.is_some() && image == other.sent();
        let has = |run: usize| parameters_are_known(&runs[run], trial.model());
        same_words && same_image && has(run) && has(other_run)
    };
    // For each item its first trial in each run.
    let mut firsts = HashMap::<Item<'_>, Vec<(usize, TrialRef<'_, D>)>>::new();
    let (mut overlaps, mut repeated) = (Overlaps::new(), HashMap::new());
    for &index in order {
        for trial in runs[index].trials.iter().filter(|trial| compared(*trial)) {
            let known = firsts.entry(item(trial)).or_default();
            if known.last().is_some_and(|(run, _)| *run == index) {
                continue;
            }
            for &(run, other) in &*known {
                let pair = (trial.model(), run.min(index), run.max(index));
                let overlap: &mut Overlap = overlaps.entry(pair).or_default();
                if trial.key() != other.key() {
                    if !is_repeated([(index, trial), (run, other)]) {
                        overlap.other_trials += 1;
                        continue;
                    }
                    repeated.entry(trial.key()).or_insert(other.key());
                }
                overlap.add(trial, other);
            }
            known.push((index, trial));
        }
    }
    (overlaps, repeated)
}

fn parameters_are_known<D: Detail>(run: &StoredRun<D>, model: &str) -> bool {
    let models = run.manifest.columns.get("model");
    models.is_some_and(|models| models.contains_key(model))
}
