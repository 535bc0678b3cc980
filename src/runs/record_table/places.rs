//! The places of a run's records in its file, in the order of its plan: [`places`].

use std::collections::{HashMap, HashSet};
use std::hash::Hash;
use std::path::Path;

use crate::error::Result;
use crate::store::{LinePlace, each_trial};
use crate::types::manifests::{RecordedNames, RunManifest};
use crate::types::{Condition, ModelListing, QuestionId, RunQuestion, TrialKey};

/// A record by its place and what its order follows from: 48 bytes, so that the records themselves need not be held.
#[derive(Debug, Clone, Copy)]
struct Place {
    /// The number of the question among those of the run, from 1; 0 if it is not among them.
    question: u32,
    /// The number of the condition.
    condition: u32,
    /// The number of the model.
    model: u32,
    repeat: u32,
    key: TrialKey,
    line: LinePlace,
}

/// Where the last record of each trial stands, in the order of [`sort`](crate::runs::stored::sort).
///
/// # Errors
/// If a line is not a record.
pub(super) fn places(
    folder: &Path,
    manifest: &RunManifest,
    questions: &[RunQuestion],
) -> Result<Vec<LinePlace>> {
    let names = RecordedNames::from_manifest(manifest);
    let ids = questions.iter().map(|question| &question.id);
    let ids: HashMap<&QuestionId, u32> = ids.zip(1..).collect();
    let mut conditions = Seen::<Option<Condition>>::default();
    let mut models = Seen::<String>::default();
    let mut all = Vec::new();
    each_trial(folder, |trial, line| {
        all.push(Place {
            question: ids.get(&trial.question).copied().unwrap_or(0),
            condition: conditions.number(trial.condition),
            model: models.number(trial.model),
            repeat: trial.repeat,
            key: trial.key,
            line,
        });
    })?;
    // Of each trial the last record.
    all.sort_unstable_by_key(|place| (place.key, std::cmp::Reverse(place.line.start)));
    all.dedup_by_key(|place| place.key);
    let conditions = conditions.ranks(Clone::clone);
    let listing = ModelListing::new(manifest.models.iter().cloned());
    let models = models.ranks(|model| {
        let model = names.shown(model);
        (listing.place(model), model.to_owned())
    });
    all.sort_unstable_by_key(|place| {
        let condition = conditions[place.condition as usize];
        let model = models[place.model as usize];
        (place.question, condition, model, place.repeat, place.key)
    });
    Ok(all.into_iter().map(|place| place.line).collect())
}

/// The different values so far, numbered as they come.
struct Seen<T>(HashMap<T, u32>);

impl<T> Default for Seen<T> {
    fn default() -> Self {
        Self(HashMap::new())
    }
}

impl<T: Eq + Hash> Seen<T> {
    fn number(&mut self, value: T) -> u32 {
        let next = self.0.len() as u32;
        *self.0.entry(value).or_insert(next)
    }

    /// The rank of each number by what its value is sorted by; values that are sorted alike have the same rank.
    fn ranks<K: Ord + Hash + Clone>(self, key: impl Fn(&T) -> K) -> Vec<usize> {
        let mut values: Vec<(T, u32)> = self.0.into_iter().collect();
        values.sort_unstable_by_key(|(_, number)| *number);
        let keys: Vec<K> = values.iter().map(|(value, _)| key(value)).collect();
        let ranks = numbers(keys.iter().cloned());
        keys.iter().map(|key| ranks[key]).collect()
    }
}

/// A number for each of these values, in their order.
fn numbers<T: Ord + Hash>(values: impl Iterator<Item = T>) -> HashMap<T, usize> {
    let distinct: HashSet<T> = values.collect();
    let mut sorted: Vec<T> = distinct.into_iter().collect();
    sorted.sort_unstable();
    sorted.into_iter().zip(0..).collect()
}
