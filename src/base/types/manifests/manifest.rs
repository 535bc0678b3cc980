//! [`RunManifest`]: the content of a run's `manifest.json`.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::enhancer_note::EnhancerNote;
use super::input_note::InputSummary;
use super::model_listing::ListedModel;

/// The progress of a run, and how it ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Status {
    /// Running, or killed while it ran.
    Started,
    /// Every trial has a reply.
    Complete,
    /// Every trial was tried, but some failed.
    Incomplete,
    /// Interrupted by the user.
    Cancelled,
    /// Stopped because the next question could have exceeded `--max-cost`.
    OverBudget,
    /// Stopped by an error that would fail every further trial.
    Stopped,
}

impl fmt::Display for Status {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::OverBudget => f.write_str("over budget"),
            other => other.serialize(f),
        }
    }
}

/// Trial counts of a run: all trials, answered and failed ones.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Counts {
    /// The number of all trials, tried or not.
    pub trials: usize,
    /// The number of trials with a reply.
    pub answered: usize,
    /// The number of trials without a reply after all retries.
    pub failed: usize,
}

impl Counts {
    /// Counts the outcomes of the stored trials. `trials` is the number of planned trials; `failed` has an entry for
    /// each stored trial, true if the trial failed.
    #[must_use]
    pub fn new(trials: usize, failed: impl IntoIterator<Item = bool>) -> Self {
        let (mut stored, mut failures) = (0, 0);
        for has_failed in failed {
            stored += 1;
            failures += usize::from(has_failed);
        }
        Self { trials, answered: stored - failures, failed: failures }
    }
}

/// The fields that differ between two maps of settings, with both values as text; a missing value is `unset`.
pub fn differences<'a>(
    one: &'a BTreeMap<String, Value>,
    other: &'a BTreeMap<String, Value>,
) -> impl Iterator<Item = (&'a str, String, String)> {
    let fields: BTreeSet<&String> = one.keys().chain(other.keys()).collect();
    fields.into_iter().filter_map(move |field| {
        let [first, second] =
            [one, other].map(|settings| settings.get(field).map_or("unset".to_owned(), ToString::to_string));
        (first != second).then_some((field.as_str(), first, second))
    })
}

/// The name of the column that defines the judges of open-ended answers.
pub const JUDGES: &str = "judge";

/// The judge's variant of a model flag, such as `--judge-temperature` for `--temperature`.
pub fn judge_flag(flag: &str) -> String {
    flag.replacen("--", "--judge-", 1)
}

/// A difference between the definitions of one column value in two runs, such as two addresses of the same model.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ColumnDifference<'a> {
    /// The column, such as `model`.
    pub column: &'a str,
    /// The value, such as `gpt-4o`.
    pub value: &'a str,
    /// The field of the definition that differs; usually a flag, such as `--base-url`.
    pub field: String,
    /// The field's content in the first run, or `unset`.
    pub first: String,
    /// The field's content in the second run, or `unset`.
    pub second: String,
}

impl RunManifest {
    /// Sets the counts and the resulting status: complete if all trials have a reply, else incomplete.
    pub fn set_counts(&mut self, counts: Counts) {
        self.counts = counts;
        self.status = if counts.answered == counts.trials { Status::Complete } else { Status::Incomplete };
    }

    /// True if a model is built into this program; false if it runs at an endpoint or is unknown to the run.
    #[must_use]
    pub fn is_built_in(&self, model: &str) -> bool {
        self.columns
            .get("model")
            .and_then(|models| models.get(model))
            .is_some_and(|definition| definition.get("local").is_some())
    }

    /// The differences between the definitions of the column values that both runs have.
    #[must_use]
    pub fn column_differences<'a>(&'a self, other: &'a Self) -> Vec<ColumnDifference<'a>> {
        let mut found = Vec::new();
        for (column, values) in &self.columns {
            for (value, first) in values {
                let second = other.columns.get(column).and_then(|values| values.get(value));
                let Some(second) = second else {
                    continue;
                };
                let [first, second] = [first, second].map(fields);
                found.extend(differences(&first, &second).map(|(field, first, second)| ColumnDifference {
                    column,
                    value,
                    field: field.to_owned(),
                    first,
                    second,
                }));
            }
        }
        found
    }
}

/// The fields of a JSON object, without null values.
fn fields(object: &Value) -> BTreeMap<String, Value> {
    object
        .as_object()
        .into_iter()
        .flatten()
        .filter(|(_, value)| !value.is_null())
        .map(|(field, value)| (field.clone(), value.clone()))
        .collect()
}

/// The range of sources (frames or walks) that a shard evaluates. The sources of the run are numbered in the order of
/// their first questions.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct PartPlace {
    /// Index of the shard's first source, from 0.
    pub first: usize,
    /// Number of sources in the shard.
    pub count: usize,
    /// Number of sources in the whole run.
    pub of: usize,
}

/// The sources of a shard, and their numbers of trials.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct RunPart {
    /// The range of the shard's sources.
    #[serde(flatten)]
    pub place: PartPlace,
    /// Number of trials for each source of the shard.
    pub trials: Vec<usize>,
}

/// The version of the lenient reply parser in runs whose manifest does not record one: they predate that field.
pub const FIRST_REPLY_READING: &str = "lenient/1";

/// The settings that apply to all trials of a run, by flag. Settings that vary within a run are in [`Columns`].
pub type Identity = BTreeMap<String, Value>;

/// The definitions of the values in the result tables, by column (such as `model`) and value (such as `gpt-4o`).
pub type Columns = BTreeMap<String, BTreeMap<String, Value>>;

/// The content of `manifest.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RunManifest {
    /// The schema of the run's records: [`StoredDetail::SCHEMA`](crate::types::StoredDetail::SCHEMA).
    pub schema: String,
    /// The progress of the run.
    pub status: Status,
    /// The version of this program.
    pub version: String,
    /// The time when the run was created, in UTC.
    pub created: String,
    /// The time when the manifest was last written, in UTC.
    pub updated: String,
    /// The platform, and the versions of the libraries that process pixels.
    pub platform: BTreeMap<String, String>,
    /// The settings that apply to all trials, by flag. A run can only be resumed with the same identity.
    pub identity: Identity,
    /// The definitions of models, enhancers and noise profiles, by column and value. A resumed run may add values, but
    /// not redefine one.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub columns: Columns,
    /// The models in the order of the models file; empty without a file.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub models: Vec<ListedModel>,
    /// The use of each enhancer, by its name; empty in runs of earlier versions.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub enhancers: BTreeMap<String, EnhancerNote>,
    /// The changes made to the images when their files were read; `None` without changes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub inputs: Option<InputSummary>,
    /// The shard of an evaluation, such as `2/4`; `None` for the whole evaluation.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shard: Option<String>,
    /// The sources and trial counts of the shard; `None` for the whole evaluation.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub part: Option<RunPart>,
    /// The settings that do not affect replies, such as concurrency and timeouts.
    pub settings: BTreeMap<String, Value>,
    /// The flags that determine the images, as the user wrote them; empty in runs of earlier versions.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub images: BTreeMap<String, Value>,
    /// The version of the lenient reply parser that produced the records, such as `lenient/5`.
    ///
    /// `None` in runs of open-ended questions, and in runs of earlier versions of this program, which used
    /// [`FIRST_REPLY_READING`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reply_reading: Option<String>,
    /// The trial counts.
    pub counts: Counts,
}
