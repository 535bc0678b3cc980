//! Warnings about replies that are cut at the token limit: [`TruncationCheck`].

use crate::types::{Finish, Reply};
use darkqa_score::choice::open_answer;

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

#[cfg(test)]
mod tests {
    use super::*;

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
