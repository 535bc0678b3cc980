//! [`RereadRecord`]: a record whose reply is parsed again by the rules of this version.

use darkqa_base::types::Record;

/// A record whose reply is parsed again when its line is read.
pub(super) struct RereadRecord<D>(pub(super) Record<D>);
