//! Warnings about the replies of a phase while it runs: [`ReplyChecks`].
//!
//! Warnings about replies that are cut at the token limit: [`TruncationCheck`].
//!
//! The stored run that a command continues, and the settings of models that may change in it: [`Continuation`].

use std::collections::BTreeMap;
use std::path::PathBuf;

use serde_json::Value;

use darkqa_ask::{ChangedSetting, Parameters};
use darkqa_base::types::manifests::{Columns, JUDGES};
use darkqa_base::types::{Finish, Reply};
use darkqa_runs::renamed::{CHANGED_FOR, REFUSED_FOR, changes, key, strings};
use darkqa_score::choice::llm_match::{Protocol, mark};
use darkqa_score::choice::open_answer;

/// Checks of the replies of a phase, each of which warns once.
#[derive(Debug, Clone)]
pub struct ReplyChecks {
    /// The flag that sets the token limit.
    flag: &'static str,
    truncation: TruncationCheck,
    /// `None` if the replies are answers.
    marks: Option<MarkCheck>,
}

impl ReplyChecks {
    /// Checks without replies, for models whose token limit this flag sets, and for replies that this protocol reads as
    /// marks.
    pub fn new(flag: &'static str, protocol: Option<Protocol>) -> Self {
        Self { flag, truncation: TruncationCheck::new(flag), marks: protocol.map(MarkCheck::new) }
    }

    /// Counts a reply.
    pub fn count(&mut self, reply: &Reply) {
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

/// Counts the replies that were cut at the token limit, and warns if their share shows that the limit is too low.
#[derive(Debug, Clone)]
pub(super) struct TruncationCheck {
    /// The flag that sets the limit.
    flag: &'static str,
    replies: usize,
    cut: usize,
    /// Number of replies that were cut before any text, or in thoughts within the text.
    empty: usize,
    has_warned: bool,
}

impl TruncationCheck {
    /// Number of first replies among which those without any text are counted.
    const FIRST: usize = 10;

    /// Minimum number of replies for a warning about the share that were cut; chosen.
    const MIN_REPLIES: usize = 20;

    /// A check without replies, for models whose token limit this flag sets.
    pub(super) fn new(flag: &'static str) -> Self {
        Self { flag, replies: 0, cut: 0, empty: 0, has_warned: false }
    }

    /// Counts a reply. Warns once: if more than half of the first [`Self::FIRST`] replies have no text, or later if a
    /// quarter of all replies were cut.
    pub(super) fn count(&mut self, reply: &Reply) {
        self.replies += 1;
        if reply.finish == Finish::Length {
            self.cut += 1;
            self.empty += usize::from(open_answer(&reply.text).is_err());
        }
        if self.has_warned {
            return;
        }
        if self.replies == Self::FIRST && self.empty > Self::FIRST / 2 {
            self.has_warned = true;
            tracing::warn!(
                "{} of the first {} replies were cut at the token limit with no answer: a reasoning model needs a larger \
                 {}, or a lower --reasoning-effort",
                self.empty,
                self.replies,
                self.flag
            );
        } else if self.is_share_large() {
            self.has_warned = true;
            tracing::warn!(
                "{} of {} replies so far were cut at the token limit: the same command with a larger {} and --resume DIR asks these \
                 alone again",
                self.cut,
                self.replies,
                self.flag
            );
        }
    }

    /// Ends the warnings, if another one names the same cause.
    pub(super) fn silence(&mut self) {
        self.has_warned = true;
    }

    /// True if there are at least [`Self::MIN_REPLIES`] replies, and a quarter of them were cut.
    fn is_share_large(&self) -> bool {
        self.replies >= Self::MIN_REPLIES && self.cut * 4 >= self.replies
    }
}

/// Flags whose values may change after replies if a server refused them: they decide how a reply is drawn, not what is
/// asked.
const SAMPLING: [&str; 5] = ["--temperature", "--top-p", "--sampling-seed", "--max-tokens", "--wire"];

/// The run in the folder of a command; empty without one, or if its manifest cannot be read, which opening the folder
/// reports.
#[derive(Debug, Default)]
pub struct Continuation {
    /// Columns of its manifest.
    pub columns: Columns,
    /// Settings of its manifest.
    pub settings: BTreeMap<String, Value>,
    /// Its folder; `None` without one.
    pub folder: Option<PathBuf>,
}

impl Continuation {
    /// Settings of a model (or judge) that continue the run's under its trial keys; `None` if they are equal, or belong
    /// to another run.
    ///
    /// They may differ in a larger token limit, in sampling settings that the server refused, and in everything if the
    /// run has no reply of the model (`free_without_replies`).
    pub fn accept(&self, column: &str, name: &str, own: &Parameters, free_without_replies: bool) -> Option<Parameters> {
        let stored = self.columns.get(column)?.get(name)?;
        if let Some(grown) = own.raised_from_column(stored) {
            return Some(grown);
        }
        let changed = own.changes_from_column(stored);
        if changed.is_empty() {
            return None;
        }
        let is_judge = column == JUDGES;
        let noted = changes(self.settings.get(&key(CHANGED_FOR, name, is_judge)));
        let refused = strings(self.settings.get(&key(REFUSED_FOR, name, is_judge)));
        let is_permitted = |change: &ChangedSetting| {
            let is_forced = SAMPLING.contains(&&*change.flag) && refused.contains(&change.flag);
            is_forced || is_grown_limit(change) || noted.iter().any(|known| known.sets_the_same(change))
        };
        let after = self.replies(name);
        let is_free = free_without_replies && after == Some(0);
        if !is_free && !changed.iter().all(is_permitted) {
            return None;
        }
        let mut all = noted;
        for change in changed {
            let last = all.iter().rfind(|known| known.flag == change.flag);
            if !last.is_some_and(|last| last.sets_the_same(&change)) {
                all.push(ChangedSetting { after: after.unwrap_or_default(), ..change });
            }
        }
        Some(own.continuing(stored, all))
    }

    /// Number of replies of a model in the run; `None` if a batch may bring more or they cannot be read.
    fn replies(&self, name: &str) -> Option<usize> {
        let folder = self.folder.as_ref()?;
        if darkqa_store::has_batches(folder) {
            return None;
        }
        darkqa_store::reply_count(folder, name).ok()
    }
}

/// True for a larger token limit, which asks truncated replies again.
fn is_grown_limit(change: &ChangedSetting) -> bool {
    let (first, now) = (change.first.as_u64(), change.now.as_u64());
    change.flag == "--max-tokens" && first.is_some() && now > first
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

    fn after(replies: usize, is_cut: impl Fn(usize) -> bool) -> TruncationCheck {
        let mut check = TruncationCheck::new("--max-tokens");
        for i in 0..replies {
            let finish = if is_cut(i) { Finish::Length } else { Finish::Stop };
            check.count(&Reply { finish, ..Reply::local("It is".into()) });
        }
        check
    }

    #[test]
    fn a_quarter_of_cut_replies_is_said_whenever_it_is_reached() {
        assert!(!after(19, |_| true).has_warned, "too few");
        assert!(after(20, |i| i % 4 == 0).has_warned);
        assert!(!after(400, |i| i % 5 == 0).has_warned);
        assert!(after(400, |i| i >= 290).has_warned, "not the first ten alone");
    }
}
