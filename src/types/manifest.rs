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
        f.pad(match self {
            Self::Started => "started",
            Self::Complete => "complete",
            Self::Incomplete => "incomplete",
            Self::Cancelled => "cancelled",
            Self::Stopped => "stopped",
        })
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
pub fn differences<'a>(
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
    /// What decides the replies, by flag: a run is only resumed with the same.
    pub identity: BTreeMap<String, Value>,
    /// What does not: concurrency, timeouts.
    pub settings: BTreeMap<String, Value>,
    /// The flags that decide the images, as they were said; empty in runs of versions that kept none.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub images: BTreeMap<String, Value>,
    /// How many trials.
    pub counts: Counts,
}
