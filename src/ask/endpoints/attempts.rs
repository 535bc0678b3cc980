//! The requests of one question: [`Attempts`].

use crate::ask::failures::{AskError, Unfinished};
use crate::types::LostAttempts;
use crate::types::text::counted;

/// The requests of one question so far, and their charges.
#[derive(Debug, Default)]
pub(super) struct Attempts {
    /// Number of requests that were sent.
    pub(super) sent: u32,
    /// Requests that were charged and gave no reply.
    pub(super) lost: LostAttempts,
    /// Number of requests that were probably charged, although the server stated no tokens.
    unfinished: u32,
    /// Number of replies of the endpoint at the first quick timeout; `None` before it.
    replies_at_timeout: Option<u64>,
}

impl Attempts {
    /// The attempts of a question of which this many requests count as charged from the start.
    pub(super) fn with_charged(charged: u32) -> Self {
        Self { unfinished: charged, ..Self::default() }
    }

    /// Adds a failed request; `replies` is the number of replies of the endpoint so far. A second quick timeout after a
    /// reply to another request becomes a [`Unfinished::RepeatedTimeout`].
    pub(super) fn add(&mut self, failed: AskError, replies: u64) -> AskError {
        let is_repeated = self.replies_at_timeout.is_some_and(|before| replies > before);
        let failed = match failed.unfinished {
            Unfinished::QuickTimeout if is_repeated => failed.with_unfinished(Unfinished::RepeatedTimeout),
            Unfinished::QuickTimeout => {
                self.replies_at_timeout.get_or_insert(replies);
                failed
            }
            _ => failed,
        };
        self.lost = self.lost.plus(*failed.lost);
        let is_counted = failed.lost.attempts > 0;
        self.unfinished += u32::from(failed.unfinished.is_probably_charged() && !is_counted);
        failed
    }

    /// Number of requests that were charged and gave no reply, as far as is known.
    pub(super) fn charged(&self) -> u32 {
        self.lost.attempts + self.unfinished
    }

    /// The error of the question, after its last request.
    pub(super) fn end(&self, failed: AskError) -> AskError {
        failed.with_attempts(self.sent, self.lost)
    }

    /// The error of a question with more charged requests than `--retries paid` allows; `remedy` is the one for a
    /// gateway timeout.
    pub(super) fn give_up(&self, mut failed: AskError, remedy: &str) -> AskError {
        let tokens = self.lost.usage.total().unwrap_or_default();
        let reason = if failed.unfinished.is_timeout() {
            format!(
                "given up: a gateway ends the request before the reply is complete, and the server may charge it each time; {remedy}"
            )
        } else if failed.unfinished == Unfinished::BrokeOff && self.lost.attempts == 0 {
            "given up: each request that breaks off may be charged; more --retries paid asks again".to_owned()
        } else {
            format!(
                "{} charged without a reply, {tokens} tokens; remedies: a larger --max-tokens, --thinking off, or more --retries paid",
                counted(self.lost.attempts as usize, "attempt")
            )
        };
        failed.failure.message = format!("{} ({reason})", failed.failure.message);
        self.end(failed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::types::FailureKind;

    fn timeout() -> AskError {
        AskError::new(FailureKind::Server, "504".to_owned()).with_unfinished(Unfinished::QuickTimeout)
    }

    #[test]
    fn quick_timeouts_count_if_others_are_answered() {
        let mut down = Attempts::default();
        for _ in 0..5 {
            let failed = down.add(timeout(), 3);
            assert_eq!(failed.unfinished, Unfinished::QuickTimeout);
        }
        assert_eq!(down.charged(), 0);
        let mut slow = Attempts::default();
        slow.add(timeout(), 3);
        let failed = slow.add(timeout(), 4);
        assert!(failed.unfinished.is_timeout());
        assert_eq!((slow.charged(), failed.failure.kind), (1, FailureKind::Timeout));
    }
}
