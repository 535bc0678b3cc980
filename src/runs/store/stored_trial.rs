//! [`StoredTrial`]: the fields of a stored trial that a resumed run needs.
//!
//! [`TrialLine`]: the fields of a record that identify its trial.
//!
//! [`RereadRecord`]: a record whose reply is parsed again by the rules of this version.

use std::num::NonZeroU32;

use serde::{Deserialize, Deserializer};

use darkqa_base::types::records::{SmallNumber, Stopped, Tokens};
use darkqa_base::types::{
    Condition, FailureKind, Finish, LostAttempts, QuestionId, Record, Shared, StoredDetail, TrialKey, TrialRef, Usage,
    Via,
};

/// A trial of a run, without question and answer: 72 bytes.
#[derive(Debug, Clone, Deserialize)]
pub struct StoredTrial {
    /// The key of the trial.
    pub key: TrialKey,
    /// The name of the model.
    pub model: Shared<String>,
    /// The way in which the model was asked.
    #[serde(default)]
    pub via: Via,
    failure: Option<StoredFailure>,
    #[serde(default, rename = "finish", deserialize_with = "read_end")]
    end: Stopped,
    /// The token limit of the reply, if it differs from that of the run's first call.
    max_tokens: Option<NonZeroU32>,
    #[serde(default)]
    usage: Tokens,
    #[serde(default)]
    latency_ms: SmallNumber,
    /// The attempts that were charged and gave no reply, in all calls; few trials have any.
    lost: Option<Box<LostAttempts>>,
}

/// A failure, by how the trial is asked again.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(from = "FailureFacts")]
enum StoredFailure {
    /// A gateway gave up on the request.
    GatewayTimeout,
    Other,
}

/// The fields of a failure that tell a timeout of a gateway, which has a status, from one of this program.
#[derive(Debug, Deserialize)]
struct FailureFacts {
    kind: Option<FailureKind>,
    status: Option<u16>,
}

impl From<FailureFacts> for StoredFailure {
    fn from(failure: FailureFacts) -> Self {
        match (failure.kind, failure.status) {
            (Some(FailureKind::Timeout), Some(_)) => Self::GatewayTimeout,
            _ => Self::Other,
        }
    }
}

impl StoredTrial {
    /// The trial of a record, with the name of its model.
    pub(super) fn from_trial<D: StoredDetail>(trial: TrialRef<'_, D>, model: Shared<String>) -> Self {
        let lost = trial.lost();
        Self {
            key: trial.key(),
            model,
            via: trial.via(),
            failure: trial.failure().map(|(kind, status)| FailureFacts { kind: Some(kind), status }.into()),
            end: trial.stopped(),
            max_tokens: trial.max_tokens().and_then(NonZeroU32::new),
            usage: trial.tokens(),
            latency_ms: trial.latency_ms().into(),
            lost: (!lost.is_none()).then(|| Box::new(lost)),
        }
    }

    /// True if no reply came, so that the trial is asked again.
    pub fn failed(&self) -> bool {
        self.failure.is_some()
    }

    /// True if a gateway gave up on the request, so that the server may have charged it.
    pub fn timed_out_at_gateway(&self) -> bool {
        self.failure == Some(StoredFailure::GatewayTimeout) && self.via == Via::Direct
    }

    /// True if the reply was truncated at a token limit below this one; `first` is that of the run's first call.
    pub fn is_truncated_below(&self, limit: u32, first: u32) -> bool {
        self.end == Stopped::Length && !self.failed() && self.limit().unwrap_or(first) < limit
    }

    /// True if a reply came that does not count, because another try may end in another way.
    pub fn may_heal(&self) -> bool {
        self.failed() && self.end != Stopped::Unknown
    }

    fn limit(&self) -> Option<u32> {
        self.max_tokens.map(NonZeroU32::get)
    }

    /// The tokens and the cost that the server charged; `None` if it did not report them.
    pub fn usage(&self) -> Option<Usage> {
        self.usage.usage()
    }

    /// Number of attempts that were charged and gave no reply, in all calls.
    pub fn lost_attempts(&self) -> u32 {
        self.lost.as_ref().map_or(0, |lost| lost.attempts)
    }

    /// The attempts that were charged and gave no reply, and the requests without a token count; `None` without such
    /// attempts and requests.
    pub fn lost(&self) -> Option<&LostAttempts> {
        self.lost.as_deref()
    }

    /// Merges an earlier record of the same trial into this one, and adds its cost. Must be called with the latest of
    /// the earlier records first.
    ///
    /// The earlier record may be the same reply, parsed by other rules, whose attempts are not counted twice; a reply
    /// with another token limit; or a reply that this record failed to replace.
    pub(super) fn add_earlier(&mut self, earlier: &Self) {
        let own = self.lost.as_deref().copied().unwrap_or_default();
        let before = earlier.lost.as_deref().copied().unwrap_or_default();
        let mut lost = own;
        if self.failed() && !earlier.failed() {
            self.clone_from(earlier);
            lost = own.plus(before);
        } else if earlier.failed() {
            lost = own.plus(before);
        } else if earlier.limit() != self.limit() {
            lost = own.plus(before);
            lost.add(earlier.usage());
        }
        self.lost = (!lost.is_none()).then(|| Box::new(lost));
    }

    /// The duration of the last try, in milliseconds.
    pub fn latency_ms(&self) -> Option<u64> {
        self.latency_ms.get()
    }
}

/// Deserializes the reason why a model stopped.
fn read_end<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Stopped, D::Error> {
    let finish = Option::<Finish>::deserialize(deserializer)?;
    Ok(finish.as_ref().into())
}

/// Fields of a record's line that identify the trial.
#[derive(Debug, Deserialize)]
pub struct TrialLine {
    /// The key of the trial.
    pub key: TrialKey,
    /// The question that it asks.
    pub question: QuestionId,
    /// The condition of its image; `None` if it has none.
    pub condition: Option<Condition>,
    /// The name of the model in the records.
    pub model: String,
    /// Number of the repetition, from 0.
    #[serde(default)]
    pub repeat: u32,
}

/// A record whose reply is parsed again when its line is read.
pub(super) struct RereadRecord<D> {
    pub(super) record: Record<D>,
    /// True if the stored answer was another one.
    pub(super) is_changed: bool,
}

#[cfg(test)]
mod tests {
    use super::*;

    fn trial(failure: &str, attempts: u32) -> StoredTrial {
        let lost =
            format!(r#"{{"attempts":{attempts},"usage":{{"prompt_tokens":{attempts}00,"completion_tokens":null}}}}"#);
        let key = "0".repeat(32);
        let line = format!(r#"{{"key":"{key}","model":"m","failure":{failure},"lost":{lost}}}"#);
        serde_json::from_str(&line).unwrap()
    }

    #[test]
    fn only_gateways_state_a_status_with_a_timeout() {
        for (failure, expected) in [
            (r#"{"kind":"timeout","status":504,"message":"m"}"#, true),
            (r#"{"kind":"timeout","status":null,"message":"m"}"#, false),
            (r#"{"kind":"server","status":504,"message":"m"}"#, false),
            ("null", false),
        ] {
            assert_eq!(trial(failure, 1).timed_out_at_gateway(), expected, "{failure}");
        }
    }

    #[test]
    fn attempts_are_added_once() {
        let mut last = trial("null", 1);
        last.add_earlier(&trial("{}", 2));
        last.add_earlier(&trial("null", 1));
        assert_eq!(last.lost_attempts(), 3, "another reading repeats its own");
        assert_eq!(last.lost().unwrap().usage.prompt_tokens, Some(300));
    }

    #[test]
    fn truncated_replies_are_charged() {
        let first = reply("null", "length");
        assert!(first.is_truncated_below(2000, 1024) && !reply("2000", "length").is_truncated_below(2000, 1024));
        assert!(!reply("null", "stop").is_truncated_below(2000, 1024));
        assert!(!first.is_truncated_below(400, 1024) && !first.is_truncated_below(1024, 1024));
        assert!(reply("400", "length").is_truncated_below(1024, 1024));
        let mut last = reply("2000", "stop");
        last.add_earlier(&first);
        assert_eq!((last.lost_attempts(), last.lost().unwrap().usage.prompt_tokens), (1, Some(10)));
        let mut failed = trial("{}", 2);
        failed.add_earlier(&first);
        assert!(!failed.failed() && failed.is_truncated_below(2000, 1024));
        assert_eq!(failed.lost_attempts(), 2);
    }

    fn reply(limit: &str, finish: &str) -> StoredTrial {
        let key = "0".repeat(32);
        let line = format!(
            r#"{{"key":"{key}","model":"m","failure":null,"finish":"{finish}","max_tokens":{limit},"usage":{{"prompt_tokens":10,"completion_tokens":5}}}}"#
        );
        serde_json::from_str(&line).unwrap()
    }

    #[test]
    fn a_trial_takes_72_bytes() {
        assert_eq!(size_of::<StoredTrial>(), 72);
    }
}
