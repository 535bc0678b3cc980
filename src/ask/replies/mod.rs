//! JSON of replies: bounded, with its escapes repaired.

pub(super) mod bounded_json;
pub(super) mod escapes;
