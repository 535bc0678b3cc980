//! The outcome of a trial in words: [`outcome`], the reason why a reply was not read ([`unread_reason`]), and why no
//! reply came ([`failure_reason`]).

use crate::types::{FailureKind, Record, TrialOutcome, UnreadReason};

/// The outcome of a trial of a question with choices, by the strict parsing: `✓ right`, `not read (cut at the token
/// limit)`.
pub(crate) fn outcome(record: &Record) -> String {
    match record.detail.outcome {
        TrialOutcome::Right => "✓ right".to_owned(),
        TrialOutcome::Wrong => "✗ wrong".to_owned(),
        TrialOutcome::Answered => "answered".to_owned(),
        TrialOutcome::Unparsed => match record.detail.strict.and_then(|strict| strict.why) {
            None => "not read".to_owned(),
            Some(UnreadReason::CannotTell) => unread_reason(UnreadReason::CannotTell).to_owned(),
            Some(why) => format!("not read ({})", unread_reason(why)),
        },
        TrialOutcome::Failed => match &record.failure {
            None => "failed".to_owned(),
            Some(failure) => format!("failed ({})", failure_reason(failure.kind, failure.status)),
        },
    }
}

/// The reason in words why the strict parsing found no choice in a reply.
pub(crate) fn unread_reason(why: UnreadReason) -> &'static str {
    match why {
        UnreadReason::Empty => "the reply is empty",
        UnreadReason::Refused => "the model refused",
        UnreadReason::Truncated => "cut at the token limit before an answer",
        UnreadReason::Filtered => "withheld by a content filter",
        UnreadReason::Ambiguous => "names more than one choice",
        UnreadReason::OutOfRange => "names a letter that no choice has",
        UnreadReason::Contradiction => "names the letter of one choice with the text of another",
        UnreadReason::Negated => "names a choice only to deny it",
        UnreadReason::NoChoice => "names no choice in the form that was asked for",
        UnreadReason::CannotTell => "“I cannot tell”",
    }
}

/// The reason in words why no reply came, with the HTTP status if the server sent one.
pub(crate) fn failure_reason(kind: FailureKind, status: Option<u16>) -> String {
    let kind = match kind {
        FailureKind::Connection => "no connection",
        FailureKind::Timeout => "no whole reply in time",
        FailureKind::RateLimit => "refused by a rate limit",
        FailureKind::Server => "the server failed",
        FailureKind::Request => "the request was refused",
        FailureKind::Filtered => "refused by moderation",
        FailureKind::Response => "the response was no reply",
        FailureKind::Image => "the image could not be made",
    };
    match status {
        None => kind.to_owned(),
        Some(status) => format!("{kind}, HTTP {status}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reasons_have_different_words() {
        let reasons: std::collections::BTreeSet<&str> = UnreadReason::ALL.into_iter().map(unread_reason).collect();
        assert_eq!(reasons.len(), UnreadReason::ALL.len());
        let kinds: std::collections::BTreeSet<String> =
            FailureKind::ALL.into_iter().map(|kind| failure_reason(kind, None)).collect();
        assert_eq!(kinds.len(), FailureKind::ALL.len());
        let status = failure_reason(FailureKind::RateLimit, Some(429));
        assert_eq!(status, "refused by a rate limit, HTTP 429");
    }
}
