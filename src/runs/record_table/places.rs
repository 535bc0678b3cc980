//! Places of a run's records in its log file, in the order of the table: [`ordered_places`].

use std::collections::{BTreeSet, HashMap};
use std::hash::Hash;
use std::path::Path;

use crate::error::Result;
use crate::store::{LinePlace, each_trial};
use crate::types::manifests::{RecordedNames, RunManifest};
use crate::types::{Condition, ModelListing, QuestionId, RunQuestion, TrialKey};

/// The place of a record with its sort keys, in 48 bytes, so that the records themselves need not be kept in memory.
#[derive(Debug, Clone, Copy)]
struct Place {
    /// Number of the question in the run, from 1; 0 if the run does not have it.
    question: u32,
    /// Number of the condition in order of appearance.
    condition: u32,
    /// Number of the model in order of appearance.
    model: u32,
    repeat: u32,
    key: TrialKey,
    line: LinePlace,
}

/// The place of the last record of each trial, in the order of [`sort_trials`](crate::runs::stored::sort_trials).
///
/// # Errors
/// If a line is not a record.
pub(super) fn ordered_places(
    folder: &Path,
    manifest: &RunManifest,
    questions: &[RunQuestion],
) -> Result<Vec<LinePlace>> {
    let names = RecordedNames::from_manifest(manifest);
    let ids: HashMap<&QuestionId, u32> = questions.iter().map(|question| &question.id).zip(1..).collect();
    let mut conditions = Numbering::<Option<Condition>>::default();
    let mut models = Numbering::<String>::default();
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
    // Keep the last record of each trial.
    all.sort_unstable_by_key(|place| (place.key, std::cmp::Reverse(place.line.start)));
    all.dedup_by_key(|place| place.key);
    let conditions = conditions.ranks(Clone::clone);
    let listing = ModelListing::new(manifest.models.iter().cloned());
    let models = models.ranks(|model| {
        let model = names.table_name(model);
        (listing.place(model), model.to_owned())
    });
    all.sort_unstable_by_key(|place| {
        let condition = conditions[place.condition as usize];
        let model = models[place.model as usize];
        (place.question, condition, model, place.repeat, place.key)
    });
    Ok(all.into_iter().map(|place| place.line).collect())
}

/// Numbers for distinct values, in order of appearance.
struct Numbering<T>(HashMap<T, u32>);

impl<T> Default for Numbering<T> {
    fn default() -> Self {
        Self(HashMap::new())
    }
}

impl<T: Eq + Hash> Numbering<T> {
    fn number(&mut self, value: T) -> u32 {
        let next = self.0.len() as u32;
        *self.0.entry(value).or_insert(next)
    }

    /// The rank of each number when values are sorted by `key`. Values with equal keys have the same rank.
    fn ranks<K: Ord + Hash>(self, key: impl Fn(&T) -> K) -> Vec<usize> {
        let mut values: Vec<(T, u32)> = self.0.into_iter().collect();
        values.sort_unstable_by_key(|(_, number)| *number);
        let keys: Vec<K> = values.iter().map(|(value, _)| key(value)).collect();
        let sorted: BTreeSet<&K> = keys.iter().collect();
        let ranks: HashMap<&K, usize> = sorted.into_iter().zip(0..).collect();
        keys.iter().map(|key| ranks[key]).collect()
    }
}
