//! What a run that goes on needs of a trial that it has: [`StoredTrial`].

use serde::Deserialize;
use serde::de::IgnoredAny;

use crate::types::small_number::{SmallNumber, Tokens};
use crate::types::{LostAttempts, Shared, TrialKey, Usage, Via};

/// A trial of a run, without what was asked and what was answered: 56 bytes.
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
    /// The attempts that were charged and gave no reply, in all calls; few trials have any.
    lost: Option<Box<LostAttempts>>,
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

    /// Number of attempts that were charged and gave no reply, in all calls.
    pub(crate) fn lost_attempts(&self) -> u32 {
        self.lost.as_ref().map_or(0, |lost| lost.attempts)
    }

    /// These attempts, and the requests of which the server stated no tokens; `None` if there are none.
    pub(crate) fn lost(&self) -> Option<&LostAttempts> {
        self.lost.as_deref()
    }

    /// Adds the attempts of an earlier record of the same trial. A reply is followed only by other readings of itself, which repeat its
    /// attempts.
    pub(super) fn follow(&mut self, earlier: &Self) {
        if let Some(before) = earlier.lost.as_deref().filter(|_| earlier.failed()) {
            let own = self.lost.as_deref().copied().unwrap_or_default();
            self.lost = Some(Box::new(before.plus(own)));
        }
    }

    /// The duration of the last try, in milliseconds.
    pub(crate) fn latency_ms(&self) -> Option<u64> {
        self.latency_ms.get()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn trial(failure: &str, attempts: u32) -> StoredTrial {
        let lost = format!(
            r#"{{"attempts":{attempts},"usage":{{"prompt_tokens":{attempts}00,"completion_tokens":null}}}}"#
        );
        let key = "0".repeat(32);
        let line = format!(r#"{{"key":"{key}","model":"m","failure":{failure},"lost":{lost}}}"#);
        serde_json::from_str(&line).unwrap()
    }

    #[test]
    fn attempts_of_all_calls_are_added_once() {
        let mut last = trial("null", 1);
        last.follow(&trial("{}", 2));
        last.follow(&trial("null", 1));
        assert_eq!(last.lost_attempts(), 3, "another reading repeats its own");
        assert_eq!(last.lost().unwrap().usage.prompt_tokens, Some(300));
    }

    #[test]
    fn a_trial_takes_56_bytes() {
        assert_eq!(size_of::<StoredTrial>(), 56);
    }
}
