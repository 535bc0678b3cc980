//! The warning about replies that are cut at the token limit: [`TruncationCheck`].

use crate::types::{Finish, Reply};

/// Counts replies that the token limit cut before an answer. The first replies show whether the limit is too low.
#[derive(Debug, Default)]
pub(crate) struct TruncationCheck {
    replies: usize,
    cut: usize,
}

impl TruncationCheck {
    /// Number of replies that are checked.
    const CHECKED: usize = 10;

    /// Counts a reply, and warns if most of the first ones were cut.
    pub(crate) fn count(&mut self, reply: &Reply) {
        if self.replies >= Self::CHECKED {
            return;
        }
        self.replies += 1;
        self.cut += usize::from(reply.finish == Finish::Length && reply.text.trim().is_empty());
        if self.replies == Self::CHECKED && self.cut > Self::CHECKED / 2 {
            tracing::warn!(
                "{} of the first {} replies were cut at the token limit before any text: a reasoning model needs a larger \
                 --max-tokens, or a lower --reasoning-effort",
                self.cut,
                self.replies
            );
        }
    }
}
