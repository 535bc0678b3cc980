//! What the records of all kinds of runs have in common: [`Kept`].

use serde::Serialize;
use serde::de::DeserializeOwned;

use super::reply::Usage;
use super::trial::{Outcome, Record, TrialKey, Via};

/// A line of `records.jsonl`: one trial and what came of it.
pub trait Kept: Clone + Serialize + DeserializeOwned {
    /// The schema of a run whose records these are.
    const SCHEMA: &'static str;

    /// What decides the reply, as a digest.
    fn key(&self) -> TrialKey;

    /// Whether no reply came, so that it is asked again.
    fn failed(&self) -> bool;

    /// How it was asked.
    fn via(&self) -> Via;

    /// How long the reply took, in milliseconds.
    fn latency_ms(&self) -> Option<u64>;

    /// The model that was asked, and what the reply was charged, where the server said so.
    fn charged(&self) -> Option<(&str, Usage)>;
}

impl Kept for Record {
    const SCHEMA: &'static str = "darkqa.run/1";

    fn key(&self) -> TrialKey {
        self.key
    }

    fn failed(&self) -> bool {
        self.outcome == Outcome::Failed
    }

    fn via(&self) -> Via {
        self.via
    }

    fn latency_ms(&self) -> Option<u64> {
        self.latency_ms
    }

    fn charged(&self) -> Option<(&str, Usage)> {
        Some((&self.model, self.usage?))
    }
}
