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
    /// Every trial was tried, some failed.
    Incomplete,
    /// Interrupted by the user.
    Cancelled,
    /// Stopped because the next question could have gone beyond `--max-cost`.
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

/// Numbers of a run's trials: all, with a reply, and failed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Counts {
    /// The number of all trials.
    pub trials: usize,
    /// The number of trials with a reply.
    pub answered: usize,
    /// The number of trials without a reply after all retries.
    pub failed: usize,
}

impl Counts {
    /// Counts the trials; `failed` has one entry for each stored trial, true if it failed.
    #[must_use]
    pub fn new(trials: usize, failed: impl IntoIterator<Item = bool>) -> Self {
        let (mut all, mut failures) = (0, 0);
        for has_failed in failed {
            all += 1;
            failures += usize::from(has_failed);
        }
        Self {
            trials,
            answered: all - failures,
            failed: failures,
        }
    }
}

/// The fields in which two identities differ, with both values as text; a missing value is `unset`.
pub fn differences<'a>(
    one: &'a BTreeMap<String, Value>,
    other: &'a BTreeMap<String, Value>,
) -> impl Iterator<Item = (&'a str, String, String)> {
    let fields: BTreeSet<&String> = one.keys().chain(other.keys()).collect();
    fields.into_iter().filter_map(move |field| {
        let [first, second] = [one, other].map(|identity| {
            identity
                .get(field)
                .map_or("unset".to_owned(), ToString::to_string)
        });
        (first != second).then_some((field.as_str(), first, second))
    })
}

/// The column with the settings of each judge of open answers.
pub const JUDGES: &str = "judge";

/// The judge's form of a model flag: `--judge-temperature` for `--temperature`.
pub fn judge_flag(flag: &str) -> String {
    flag.replacen("--", "--judge-", 1)
}

/// A column value with different meanings in two runs: the field that differs, and its content in each run.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ColumnDifference<'a> {
    /// The column, as `model`.
    pub column: &'a str,
    /// The value, as `gpt-4o`.
    pub value: &'a str,
    /// The flag that differs, as `--base-url`.
    pub field: String,
    /// The flag's value in the first run, or `unset`.
    pub first: String,
    /// The flag's value in the second run, or `unset`.
    pub second: String,
}

impl RunManifest {
    /// Sets the counts, and the status that follows from them: complete if all trials have a reply.
    pub fn set_counts(&mut self, counts: Counts) {
        self.counts = counts;
        self.status = if counts.answered == counts.trials {
            Status::Complete
        } else {
            Status::Incomplete
        };
    }

    /// True if a model is built into this program and not asked through an endpoint.
    #[must_use]
    pub fn is_built_in(&self, model: &str) -> bool {
        let content = self
            .columns
            .get("model")
            .and_then(|models| models.get(model));
        content.is_some_and(|content| content.get("local").is_some())
    }

    /// The column values that both runs have with different meanings.
    #[must_use]
    pub fn column_differences<'a>(&'a self, other: &'a Self) -> Vec<ColumnDifference<'a>> {
        let mut found = Vec::new();
        for (column, values) in &self.columns {
            for (value, first) in values {
                let second = other
                    .columns
                    .get(column)
                    .and_then(|values| values.get(value));
                let Some(second) = second else {
                    continue;
                };
                let [first, second] = [first, second].map(fields);
                found.extend(differences(&first, &second).map(|(field, first, second)| {
                    ColumnDifference {
                        column,
                        value,
                        field: field.to_owned(),
                        first,
                        second,
                    }
                }));
            }
        }
        found
    }
}

/// The fields of an object that are not null.
fn fields(object: &Value) -> BTreeMap<String, Value> {
    object
        .as_object()
        .into_iter()
        .flatten()
        .filter(|(_, value)| !value.is_null())
        .map(|(field, value)| (field.clone(), value.clone()))
        .collect()
}

/// The range of a shard's sources (frames or walks) among all sources of the run, in the order of their first questions.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct PartPlace {
    /// Index of the first source, from 0.
    pub first: usize,
    /// Number of sources of the shard.
    pub count: usize,
    /// Number of sources of the whole run.
    pub of: usize,
}

/// The trials of one shard of a run.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct RunPart {
    /// The range of the shard's sources.
    #[serde(flatten)]
    pub place: PartPlace,
    /// Number of trials about each source.
    pub trials: Vec<usize>,
}

/// The version of the lenient parsing in runs whose manifest does not state one.
pub const FIRST_REPLY_READING: &str = "lenient/1";

/// The settings that all trials of a run share and that are not a column of its tables, by flag.
pub type Identity = BTreeMap<String, Value>;

/// The definition of each value in a column of the tables, by column and value.
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
    /// The settings that all trials share and that are not a column, by flag. A run can only be resumed with the same identity.
    pub identity: Identity,
    /// The meaning of each value in a column of the tables, by column and value: models, enhancers, noise profiles. A run may
    /// get further values; the meaning of an existing value never changes.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub columns: Columns,
    /// The models in the order of the models file; empty without a file.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub models: Vec<ListedModel>,
    /// How each enhancer was used, by its name; empty in runs of earlier versions.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub enhancers: BTreeMap<String, EnhancerNote>,
    /// Changes made to the images when their files were read; `None` if there were none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub inputs: Option<InputSummary>,
    /// The shard of an evaluation, as `2/4`; `None` for the whole evaluation.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shard: Option<String>,
    /// The trials of the shard; `None` for the whole evaluation.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub part: Option<RunPart>,
    /// The settings without an effect on replies: concurrency, timeouts.
    pub settings: BTreeMap<String, Value>,
    /// The flags that decide the images, as the user wrote them; empty in runs of earlier versions.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub images: BTreeMap<String, Value>,
    /// The version of the lenient parsing in the records, as `lenient/4`; `None` in runs of open questions, and in runs of earlier versions
    /// of this program, which used [`FIRST_REPLY_READING`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reply_reading: Option<String>,
    /// The number of trials, answered and failed.
    pub counts: Counts,
}
