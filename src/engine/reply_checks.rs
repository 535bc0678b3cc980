//! Warnings about the replies of a phase while it runs: [`ReplyChecks`].

use super::truncation::TruncationCheck;
use crate::types::{Finish, Reply};
use darkqa_score::choice::llm_match::{Protocol, mark};

/// Checks of the replies of a phase, each of which warns once.
#[derive(Debug, Clone)]
pub(crate) struct ReplyChecks {
    /// The flag that sets the token limit.
    flag: &'static str,
    truncation: TruncationCheck,
    /// `None` if the replies are answers.
    marks: Option<MarkCheck>,
}

impl ReplyChecks {
    /// Checks without replies, for models whose token limit this flag sets, and for replies that this protocol reads as
    /// marks.
    pub(crate) fn new(flag: &'static str, protocol: Option<Protocol>) -> Self {
        Self { flag, truncation: TruncationCheck::new(flag), marks: protocol.map(MarkCheck::new) }
    }

    /// Counts a reply.
    pub(crate) fn count(&mut self, reply: &Reply) {
        if let Some(problem) = self.marks.as_mut().and_then(|marks| marks.count(reply)) {
            tracing::warn!("{}", problem.words(self.flag));
            if problem.cause == Cause::Limit {
                self.truncation.silence();
            }
        }
        self.truncation.count(reply);
    }
}

/// Counts the replies of a judge without a mark.
#[derive(Debug, Clone)]
struct MarkCheck {
    protocol: Protocol,
    replies: usize,
    unread: usize,
    /// Number of unread replies that the tolerant protocol reads.
    tolerant: usize,
    /// Number of unread replies that were cut at the token limit.
    cut: usize,
    has_warned: bool,
}

/// Replies of a judge without a mark.
#[derive(Debug, PartialEq, Eq)]
struct UnreadMarks {
    unread: usize,
    replies: usize,
    cause: Cause,
}

/// The likeliest cause of most unread replies.
#[derive(Debug, PartialEq, Eq)]
enum Cause {
    /// The token limit.
    Limit,
    /// The protocol, which reads fewer forms than the tolerant one.
    Protocol,
    /// Not known.
    Unknown,
}

impl MarkCheck {
    /// Minimum number of unread replies for a warning; chosen.
    const MIN_UNREAD: usize = 5;

    fn new(protocol: Protocol) -> Self {
        Self { protocol, replies: 0, unread: 0, tolerant: 0, cut: 0, has_warned: false }
    }

    /// Counts a reply. Returns the problem once, if at least [`Self::MIN_UNREAD`] replies and more than half of all
    /// have no mark.
    fn count(&mut self, reply: &Reply) -> Option<UnreadMarks> {
        self.replies += 1;
        if mark(&reply.text, self.protocol).is_none() {
            self.unread += 1;
            self.cut += usize::from(reply.finish == Finish::Length);
            self.tolerant += usize::from(mark(&reply.text, Protocol::Tolerant).is_some());
        }
        if self.has_warned || self.unread < Self::MIN_UNREAD || self.unread * 2 <= self.replies {
            return None;
        }
        self.has_warned = true;
        let cause = if self.tolerant * 2 > self.unread {
            Cause::Protocol
        } else if self.cut * 2 > self.unread {
            Cause::Limit
        } else {
            Cause::Unknown
        };
        Some(UnreadMarks { unread: self.unread, replies: self.replies, cause })
    }
}

impl UnreadMarks {
    /// The warning, with the flag of the token limit.
    fn words(&self, flag: &str) -> String {
        let Self { unread, replies, .. } = self;
        let remedy = match self.cause {
            Cause::Limit => format!(
                "most of them were cut at the token limit: a judge that thinks or explains first needs a larger {flag}"
            ),
            Cause::Protocol => {
                "the same command with --protocol tolerant reads most of them; only answers that the upstream protocol \
                                shortened are judged again"
                    .to_owned()
            }
            Cause::Unknown => {
                "interrupt the run, and see the replies with the command show; another --judge may follow its prompt"
                    .to_owned()
            }
        };
        format!("{unread} of the first {replies} replies of the judge have no mark that is read: {remedy}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn problem(texts: &[&str], finish: &Finish, protocol: Protocol) -> Option<UnreadMarks> {
        let mut check = MarkCheck::new(protocol);
        texts
            .iter()
            .filter_map(|text| check.count(&Reply { finish: finish.clone(), ..Reply::local((*text).to_owned()) }))
            .last()
    }

    #[test]
    fn unread_marks_are_reported_with_their_cause() {
        for (text, finish, protocol, cause) in [
            ("{\"mark\": 4}", Finish::Stop, Protocol::Upstream, Some(Cause::Protocol)),
            ("{\"mark\": 4}", Finish::Stop, Protocol::Tolerant, None),
            ("4", Finish::Stop, Protocol::Upstream, None),
            ("", Finish::Length, Protocol::Tolerant, Some(Cause::Limit)),
            ("<think>Maybe 4", Finish::Length, Protocol::Upstream, Some(Cause::Limit)),
            ("It fits.", Finish::Stop, Protocol::Tolerant, Some(Cause::Unknown)),
        ] {
            let found = problem(&[text; 12], &finish, protocol);
            assert_eq!(found.as_ref().map(|found| found.unread), cause.as_ref().map(|_| 5));
            assert_eq!(found.map(|found| found.cause), cause, "{text}");
        }
    }

    #[test]
    fn a_few_unread_marks_are_not_reported() {
        let mut texts = vec!["4"; 6];
        texts.extend(["fits"; 6]);
        assert_eq!(problem(&texts, &Finish::Stop, Protocol::Upstream), None);
        assert_eq!(problem(&["fits"; 4], &Finish::Stop, Protocol::Upstream), None);
    }
}
