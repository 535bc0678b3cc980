//! What a run that goes on needs of a trial that it has: [`StoredTrial`].

use serde::Deserialize;
use serde::de::IgnoredAny;

use crate::types::small_number::{SmallNumber, Tokens};
use crate::types::{Shared, TrialKey, Usage, Via};

/// A trial of a run, without what was asked and what was answered: 48 bytes.
#[derive(Debug, Clone, Deserialize)]
pub(crate) struct StoredTrial {
    pub(crate) key: TrialKey,
    /// The name of the model.
    pub(crate) model: Shared<String>,
    #[serde(default)]
    pub(crate) via: Via,
    failure: Option<IgnoredAny>,
    #[serde(default)]
    usage: Tokens,
    #[serde(default)]
    latency_ms: SmallNumber,
}

impl StoredTrial {
    /// Whether no reply came, so that the trial is asked again.
    pub(crate) fn failed(&self) -> bool {
        self.failure.is_some()
    }

    /// The tokens that the server charged; `None` if it did not say.
    pub(crate) fn usage(&self) -> Option<Usage> {
        self.usage.usage()
    }

    /// The duration of the last try, in milliseconds.
    pub(crate) fn latency_ms(&self) -> Option<u64> {
        self.latency_ms.get()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_trial_takes_48_bytes() {
        assert_eq!(size_of::<StoredTrial>(), 48);
    }
}
