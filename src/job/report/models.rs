//! Models of one name that were asked in different ways in two runs are different models: [`Names`].

use std::collections::{BTreeMap, BTreeSet, HashMap};

use super::settings::{Setting, Settings, differing, is_digest, parameters};
use crate::job::stored::StoredRun;
use crate::types::{Condition, Detail, Digest, QuestionId, Record, RunQuestion, TrialKey, View};

/// The most settings in the name of a model; with more, the run's name stands there.
const MOST_SETTINGS: usize = 2;

/// The longest value of a setting in the name of a model, in letters.
const LONGEST_VALUE: usize = 24;

/// What was asked: the model, its view and condition, the question, its choices as shown, and how many times it was asked before.
pub(super) type Item<'a> = (
    (View, &'a str),
    (Option<&'a Condition>, &'a QuestionId),
    (&'a [String], u32),
);

/// The item of a record.
pub(super) fn item<D: Detail>(record: &Record<D>) -> Item<'_> {
    (
        (record.view, &record.model),
        (record.condition.as_ref(), &record.question),
        (record.detail.choices(), record.detail.repeat()),
    )
}

/// The names of models that were asked in different ways, by model and run.
#[derive(Debug, Default)]
pub(super) struct Names {
    /// The number of the group and the name, by model and run.
    by_run: HashMap<String, HashMap<usize, (usize, String)>>,
    /// The keys of trials that repeat another one by image, words, model and parameters, with the key of that one.
    repeated: HashMap<TrialKey, TrialKey>,
    /// The settings that differ, by model.
    pub(super) differences: BTreeMap<String, Vec<Setting>>,
}

impl Names {
    /// The names of the models in these runs; conditions are marked by their light. `order` holds the numbers of the runs in the
    /// order of their names, `names`. Only records that are `compared` count.
    pub(super) fn of<D: Detail>(
        runs: &[StoredRun<D>],
        names: &[String],
        order: &[usize],
        compared: impl Fn(&Record<D>) -> bool,
    ) -> Self {
        let mut found = Self::default();
        if runs.len() < 2 {
            return found;
        }
        let mut having = BTreeMap::<&str, BTreeSet<usize>>::new();
        for (index, run) in runs.iter().enumerate() {
            for record in run.records.iter().filter(|record| compared(record)) {
                if !having
                    .get(&*record.model)
                    .is_some_and(|runs| runs.contains(&index))
                {
                    having.entry(&record.model).or_default().insert(index);
                }
            }
        }
        having.retain(|_, runs| runs.len() > 1);
        let (conflicts, repeated) = conflicts(runs, order, compared);
        found.repeated = repeated;
        for (model, having) in having {
            let settings = runs.iter().enumerate();
            let settings: Vec<Option<Settings>> = settings
                .map(|(index, run)| {
                    let settings = parameters(&run.manifest, model);
                    settings.filter(|_| having.contains(&index))
                })
                .collect();
            let mut groups: Vec<Vec<usize>> = Vec::new();
            for run in order.iter().copied().filter(|run| having.contains(run)) {
                let is_same = |other: &usize| {
                    let known = settings[run].as_ref().zip(settings[*other].as_ref());
                    known.is_none_or(|(one, other)| one == other)
                        && !conflicts.contains(&(model, run.min(*other), run.max(*other)))
                };
                match groups.iter_mut().find(|group| group.iter().all(is_same)) {
                    Some(group) => group.push(run),
                    None => groups.push(vec![run]),
                }
            }
            let differences = differing(&settings);
            if groups.len() > 1 {
                let suffixes = suffixes(&groups, &differences, names);
                let named = groups.iter().zip(suffixes).enumerate();
                let named = named.flat_map(|(number, (group, suffix))| {
                    let name = format!("{model} ({suffix})");
                    group.iter().map(move |run| (*run, (number, name.clone())))
                });
                found.by_run.insert(model.to_owned(), named.collect());
            }
            if !differences.is_empty() {
                found.differences.insert(model.to_owned(), differences);
            }
        }
        found
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

/// What tells the groups of runs apart: the settings if they are few and short, else the name of the first run.
fn suffixes(groups: &[Vec<usize>], differences: &[Setting], names: &[String]) -> Vec<String> {
    let is_short = |setting: &Setting| {
        let fits = |value: &String| value.chars().count() <= LONGEST_VALUE && !is_digest(value);
        setting.flag.starts_with("--") && setting.values.iter().all(|(_, value)| fits(value))
    };
    let by_settings = |group: &Vec<usize>| -> Option<String> {
        let of_group = differences.iter().map(|setting| {
            let values = setting.values.iter();
            let mut values = values.filter(|(run, _)| group.contains(run));
            let (_, value) = values.next()?;
            Some(format!("{} {value}", setting.flag))
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

/// The first record of an item: its run, key and image.
#[derive(Clone, Copy)]
struct First {
    run: usize,
    key: TrialKey,
    image: Option<Digest>,
}

/// Pairs of runs, by model.
type Pairs<'a> = BTreeSet<(&'a str, usize, usize)>;

/// The pairs of runs that asked a model the same item in different ways, as their keys tell; and the trials that repeat another
/// one. The keys of two records may differ although the image, the words, the model and its parameters are the same: the program
/// may make the same image in two ways.
fn conflicts<'a, D: Detail>(
    runs: &'a [StoredRun<D>],
    order: &[usize],
    compared: impl Fn(&Record<D>) -> bool,
) -> (Pairs<'a>, HashMap<TrialKey, TrialKey>) {
    let texts: Vec<HashMap<&QuestionId, &RunQuestion>> = runs
        .iter()
        .map(|run| {
            run.questions
                .iter()
                .map(|question| (&question.id, question))
                .collect()
        })
        .collect();
    let mut firsts = HashMap::<Item<'_>, First>::new();
    let (mut conflicts, mut repeated) = (BTreeSet::new(), HashMap::new());
    for &index in order {
        let run = &runs[index];
        for record in run.records.iter().filter(|record| compared(record)) {
            let own = First {
                run: index,
                key: record.key,
                image: record.detail.shown(),
            };
            let first = *firsts.entry(item(record)).or_insert(own);
            if first.key == own.key || first.run == index {
                continue;
            }
            let words = [first.run, index].map(|run| texts[run].get(&record.question));
            let same_words = match words {
                [Some(one), Some(other)] => {
                    (&one.text, &one.choices) == (&other.text, &other.choices)
                }
                _ => false,
            };
            let has = |run: usize| parameters_are_known(&runs[run], &record.model);
            let same_image =
                record.view == View::Image && own.image.is_some() && own.image == first.image;
            if same_words && same_image && has(first.run) && has(index) {
                repeated.insert(own.key, first.key);
            } else {
                conflicts.insert((&*record.model, first.run.min(index), first.run.max(index)));
            }
        }
    }
    (conflicts, repeated)
}

fn parameters_are_known<D>(run: &StoredRun<D>, model: &str) -> bool {
    let models = run.manifest.columns.get("model");
    models.is_some_and(|models| models.contains_key(model))
}
