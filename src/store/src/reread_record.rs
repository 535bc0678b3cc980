//! A record as the rules of this version read its reply: [`RereadRecord`].

use darkqa_ground::types::Record;

/// A record whose reply is read again as its line is parsed.
pub(super) struct RereadRecord<D>(pub(super) Record<D>);
