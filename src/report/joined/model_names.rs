//! Names of models in a report. A model that runs asked in different ways, or that gave different replies to the same
//! trials, is listed under several names: [`ModelNames`].

use std::collections::{BTreeMap, BTreeSet, HashMap};

use super::settings::{FlagValues, Setting, differing_settings, is_digest, model_settings};
use darkqa_base::types::flags::setting_spelling;
use darkqa_base::types::{Condition, ItemKey, QuestionId, RunQuestion, TrialKey, TrialRef, View};
use darkqa_runs::stored::StoredRun;
use darkqa_score::answers::record::Detail;

/// Maximum number of settings in the name of a model; if more settings differ, the name of the run is used.
const MAX_SETTINGS: usize = 2;

/// Maximum length of a setting's value in the name of a model, in characters.
const MAX_VALUE_CHARS: usize = 24;

/// The properties by which trials of different runs are matched.
#[derive(PartialEq, Eq, Hash)]
struct MatchKey<'a> {
    view: View,
    model: &'a str,
    condition: Option<&'a Condition>,
    item: ItemKey<'a>,
}

impl<'a> MatchKey<'a> {
    fn from_trial<D: Detail>(trial: TrialRef<'a, D>) -> Self {
        Self { view: trial.view(), model: trial.model(), condition: trial.condition(), item: trial.item().key() }
    }
}

/// The names of split models in a report, by model and run.
#[derive(Debug, Default)]
pub(super) struct ModelNames {
    /// Number of the group and name, by model and run.
    by_run: HashMap<String, HashMap<usize, (usize, String)>>,
    /// Keys of trials with the same image, words, model and parameters as an earlier trial, with the key of that trial.
    repeated: HashMap<TrialKey, TrialKey>,
    /// The models with several names.
    pub(super) split: Vec<SplitModel>,
}

/// A model that a report lists under several names, and the reason.
#[derive(Debug)]
pub(super) struct SplitModel {
    /// The name under which the model was asked.
    pub(super) model: String,
    /// The names in the report.
    pub(super) names: Vec<String>,
    /// The runs of each name.
    groups: Vec<Vec<usize>>,
    /// The settings that differ.
    pub(super) differences: Vec<Setting>,
    /// The overlap of each pair of runs with different names.
    overlaps: Vec<Overlap>,
}

impl SplitModel {
    /// The overlap of the two runs that differ most.
    pub(super) fn overlap(&self) -> Overlap {
        self.overlaps.iter().copied().max_by_key(|overlap| overlap.differing()).unwrap_or_default()
    }

    /// True if all runs asked the model in the same way, and only its replies differ.
    pub(super) fn differs_by_replies_alone(&self) -> bool {
        self.differences.is_empty()
            && self.overlaps.iter().all(|overlap| overlap.other_trials + overlap.other_served == 0)
    }
}

impl ModelNames {
    /// Finds the models that must be split. The conditions of `runs` must be marked by [`ImageGroups::mark`]. `names`
    /// are the names of the runs, and `order` their indices in the order of the names. Trials for which `is_compared`
    /// returns false are ignored.
    ///
    /// [`ImageGroups::mark`]: super::image_groups::ImageGroups::mark
    pub(super) fn new<D: Detail>(
        runs: &[StoredRun<D>],
        names: &[String],
        order: &[usize],
        is_compared: impl Fn(TrialRef<'_, D>) -> bool,
    ) -> Self {
        let mut found = Self::default();
        if runs.len() < 2 {
            return found;
        }
        // The runs of each model, in the order of their names.
        let mut runs_by_model = BTreeMap::<&str, Vec<usize>>::new();
        for &index in order {
            for trial in runs[index].trials.iter().filter(|trial| is_compared(*trial)) {
                let runs = runs_by_model.entry(trial.model()).or_default();
                if runs.last() != Some(&index) {
                    runs.push(index);
                }
            }
        }
        runs_by_model.retain(|_, runs| runs.len() > 1);
        let (overlaps, repeated) = overlaps(runs, order, is_compared);
        found.repeated = repeated;
        for (model, runs_of_model) in runs_by_model {
            let settings: Vec<Option<FlagValues>> = runs
                .iter()
                .enumerate()
                .map(|(index, run)| {
                    let settings = model_settings(&run.manifest, model);
                    settings.filter(|_| runs_of_model.contains(&index))
                })
                .collect();
            let overlap = |run: usize, other: usize| {
                let pair = (model, run.min(other), run.max(other));
                overlaps.get(&pair).copied().unwrap_or_default()
            };
            let groups = group_runs(&runs_of_model, |run, other| {
                let known = settings[run].as_ref().zip(settings[other].as_ref());
                known.is_none_or(|(one, other)| one == other) && overlap(run, other).agrees()
            });
            if groups.len() > 1 {
                let differences = differing_settings(&settings);
                found.add(SplitModel {
                    model: model.to_owned(),
                    names: suffixes(&groups, &differences, names)
                        .iter()
                        .map(|suffix| format!("{model} ({suffix})"))
                        .collect(),
                    overlaps: overlaps_between(&groups, overlap),
                    differences,
                    groups,
                });
            }
        }
        found
    }

    fn add(&mut self, split: SplitModel) {
        let mut names = HashMap::new();
        for (number, (group, name)) in split.groups.iter().zip(&split.names).enumerate() {
            for run in group {
                names.insert(*run, (number, name.clone()));
            }
        }
        self.by_run.insert(split.model.clone(), names);
        self.split.push(split);
    }

    /// The number of the group that a run belongs to, and the name of the model in this group; `None` if the model is
    /// not split.
    pub(super) fn group(&self, model: &str, run: usize) -> Option<(usize, &String)> {
        let (group, name) = self.by_run.get(model)?.get(&run)?;
        Some((*group, name))
    }

    /// The name under which a model was asked.
    pub(super) fn original_name<'a>(&'a self, name: &'a str) -> &'a str {
        self.by_run.iter().find(|(_, runs)| runs.values().any(|(_, new)| new == name)).map_or(name, |(model, _)| model)
    }

    /// The key of the first trial that this one repeats, or its own key if it repeats none.
    pub(super) fn first_key(&self, key: TrialKey) -> TrialKey {
        self.repeated.get(&key).copied().unwrap_or(key)
    }
}

/// Groups runs so that all pairs in a group are the same.
fn group_runs(runs: &[usize], is_same: impl Fn(usize, usize) -> bool) -> Vec<Vec<usize>> {
    let mut groups: Vec<Vec<usize>> = Vec::new();
    for &run in runs {
        let group = groups.iter_mut().find(|group| group.iter().all(|other| is_same(run, *other)));
        match group {
            Some(group) => group.push(run),
            None => groups.push(vec![run]),
        }
    }
    groups
}

/// The overlap of each pair of runs in different groups.
fn overlaps_between(groups: &[Vec<usize>], overlap: impl Fn(usize, usize) -> Overlap) -> Vec<Overlap> {
    let mut overlaps = Vec::new();
    for (place, group) in groups.iter().enumerate() {
        for other in groups[place + 1..].iter().flatten() {
            overlaps.extend(group.iter().map(|run| overlap(*run, *other)));
        }
    }
    overlaps
}

/// Distinct name suffixes of groups of runs: the settings that differ if they are few and short, else the name of the
/// first run.
fn suffixes(groups: &[Vec<usize>], differences: &[Setting], names: &[String]) -> Vec<String> {
    groups
        .iter()
        .map(|group| -> Option<String> {
            let settings: Vec<String> = differences
                .iter()
                .map(|setting| {
                    let (_, value) = setting.values.iter().find(|(run, _)| group.contains(run))?;
                    Some(format!("{} {value}", setting_spelling(&setting.flag)))
                })
                .collect::<Option<_>>()?;
            Some(settings.join(", "))
        })
        .collect::<Option<Vec<String>>>()
        .filter(|suffixes| {
            let distinct: BTreeSet<&String> = suffixes.iter().collect();
            distinct.len() == groups.len()
                && differences.len() <= MAX_SETTINGS
                && differences.iter().all(|setting| {
                    setting.flag.starts_with("--")
                        && setting
                            .values
                            .iter()
                            .all(|(_, value)| value.chars().count() <= MAX_VALUE_CHARS && !is_digest(value))
                })
        })
        .unwrap_or_else(|| groups.iter().map(|group| names[group[0]].clone()).collect())
}

/// Agreement of two runs on the items that both asked a model.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Overlap {
    /// Number of trials to which both runs have a reply.
    pub(super) repeated: usize,
    /// Number of these trials whose replies differ.
    pub(super) other_replies: usize,
    /// Number of these trials for which the servers reported different models.
    pub(super) other_served: usize,
    /// Number of items whose trials have different keys.
    pub(super) other_trials: usize,
}

impl Overlap {
    /// True if the runs can share one name of the model.
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

/// The overlap of each pair of runs, by model and by the indices of the runs in ascending order.
type Overlaps<'a> = HashMap<(&'a str, usize, usize), Overlap>;

/// The overlap of each pair of runs, and the trials that repeat an earlier one. The keys of two such trials may differ
/// although image, words, model and parameters are the same, because the same image can be made in two ways.
fn overlaps<'a, D: Detail>(
    runs: &'a [StoredRun<D>],
    order: &[usize],
    is_compared: impl Fn(TrialRef<'_, D>) -> bool,
) -> (Overlaps<'a>, HashMap<TrialKey, TrialKey>) {
    let texts: Vec<HashMap<&QuestionId, &RunQuestion>> =
        runs.iter().map(|run| run.questions.iter().map(|question| (&question.id, question)).collect()).collect();
    let is_repeated = |[one, other]: [(usize, TrialRef<'_, D>); 2]| {
        let words = [one, other].map(|(run, trial)| texts[run].get(trial.question()));
        let same_words = match words {
            [Some(one), Some(other)] => (&one.text, &one.choices) == (&other.text, &other.choices),
            _ => false,
        };
        let [(run, trial), (other_run, other)] = [one, other];
        let image = trial.sent_digest();
        let same_image = trial.view() == View::Image && image.is_some() && image == other.sent_digest();
        same_words && same_image && [run, other_run].iter().all(|run| parameters_are_known(&runs[*run], trial.model()))
    };
    // The first trial of each run, by item.
    let mut first_trials = HashMap::<MatchKey<'_>, Vec<(usize, TrialRef<'_, D>)>>::new();
    let (mut overlaps, mut repeated) = (Overlaps::new(), HashMap::new());
    for &index in order {
        for trial in runs[index].trials.iter().filter(|trial| is_compared(*trial)) {
            let known = first_trials.entry(MatchKey::from_trial(trial)).or_default();
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
