//! What a run that goes on needs of a trial that it has: [`StoredTrial`].

use serde::Deserialize;
use serde::de::IgnoredAny;

use crate::types::{Shared, TrialKey, Usage, Via};

/// A trial of a run, without what was asked and what was answered. Of a million such trials some 100 MB are held.
#[derive(Debug, Clone, Deserialize)]
pub(crate) struct StoredTrial {
    pub(crate) key: TrialKey,
    /// The name of the model.
    pub(crate) model: Shared<String>,
    #[serde(default)]
    pub(crate) via: Via,
    failure: Option<IgnoredAny>,
    /// The tokens that the server charged; `None` if it did not say.
    pub(crate) usage: Option<Usage>,
    /// The duration of the last try, in milliseconds.
    pub(crate) latency_ms: Option<u64>,
}

impl StoredTrial {
    /// Whether no reply came, so that the trial is asked again.
    pub(crate) fn failed(&self) -> bool {
        self.failure.is_some()
    }
}
