//! Robust parsing of the JSON in replies: bounded memory, repaired escapes.

pub(super) mod bounded_json;
pub(super) mod escapes;
