//! What a run is: [`RunManifest`].

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

use serde::{Deserialize, Serialize};
use serde_json::Value;

/// How far a run has come.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Status {
    /// Under way, or killed.
    Started,
    /// Every trial has a reply.
    Complete,
    /// Every trial was tried, some failed.
    Incomplete,
    /// Interrupted by the user.
    Cancelled,
    /// Stopped by an error that every further trial would meet.
    Stopped,
}

impl fmt::Display for Status {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.serialize(f)
    }
}

/// How many trials a run has, and what became of them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Counts {
    /// All.
    pub trials: usize,
    /// With a reply.
    pub answered: usize,
    /// Without one, after all retries.
    pub failed: usize,
}

/// The fields in which two identities differ, each with what the one says and what the other says; `unset` where it says nothing.
pub(crate) fn differences<'a>(
    one: &'a BTreeMap<String, Value>,
    other: &'a BTreeMap<String, Value>,
) -> impl Iterator<Item = (&'a str, String, String)> {
    let fields: BTreeSet<&String> = one.keys().chain(other.keys()).collect();
    let said = |identity: &BTreeMap<String, Value>, field: &String| {
        let value = identity.get(field);
        value.map_or("unset".to_owned(), ToString::to_string)
    };
    fields.into_iter().filter_map(move |field| {
        let (first, second) = (said(one, field), said(other, field));
        (first != second).then_some((field.as_str(), first, second))
    })
}

/// A value of a column that two runs hold and that stands for different things: the value, the field in which they differ, and what
/// the one says and what the other says.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ColumnDifference<'a> {
    /// The column, as `model`.
    pub column: &'a str,
    /// The value, as `gpt-4o`.
    pub value: &'a str,
    /// The flag.
    pub field: String,
    /// What the first says.
    pub first: String,
    /// What the second says.
    pub second: String,
}

impl RunManifest {
    /// Takes note of what became of the trials: the run is complete if all of them have a reply.
    pub fn count(&mut self, counts: Counts) {
        self.counts = counts;
        self.status = if counts.answered == counts.trials {
            Status::Complete
        } else {
            Status::Incomplete
        };
    }

    /// The values of columns that both hold and that do not stand for the same.
    #[must_use]
    pub fn column_differences<'a>(&'a self, other: &'a Self) -> Vec<ColumnDifference<'a>> {
        let mut found = Vec::new();
        for (column, values) in &self.columns {
            for (value, own) in values {
                let there = other
                    .columns
                    .get(column)
                    .and_then(|values| values.get(value));
                let Some(there) = there else {
                    continue;
                };
                let [one, two] = [own, there].map(fields);
                found.extend(differences(&one, &two).map(|(field, first, second)| {
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

/// The fields of an object; those without a value are left out.
fn fields(object: &Value) -> BTreeMap<String, Value> {
    let fields = object.as_object().into_iter().flatten();
    let said = fields.filter(|(_, value)| !value.is_null());
    said.map(|(field, value)| (field.clone(), value.clone()))
        .collect()
}

/// The content of `manifest.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RunManifest {
    /// That of its records: [`Detail::SCHEMA`](super::Detail::SCHEMA).
    pub schema: String,
    /// How far it has come.
    pub status: Status,
    /// The version of this program.
    pub version: String,
    /// When it began, in UTC.
    pub created: String,
    /// When it was last written, in UTC.
    pub updated: String,
    /// The platform and the libraries that touched the pixels.
    pub platform: BTreeMap<String, String>,
    /// What all trials share and no column tells apart, by flag: a run is only resumed with the same.
    pub identity: BTreeMap<String, Value>,
    /// What each value of a column of the tables stands for, by column and value: models, enhancers, light readings. A value may be
    /// added to a run; one that it holds stays what it was.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub columns: BTreeMap<String, BTreeMap<String, Value>>,
    /// Which part of an evaluation it is, as `2/4`; `None` for all of it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shard: Option<String>,
    /// What does not: concurrency, timeouts.
    pub settings: BTreeMap<String, Value>,
    /// The flags that decide the images, as they were said; empty in runs of versions that kept none.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub images: BTreeMap<String, Value>,
    /// How many trials.
    pub counts: Counts,
}
