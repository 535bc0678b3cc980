//! Robust parsing of the JSON in replies: bounded memory, and a repair of what servers write wrong.

pub(super) mod bounded_json;
mod repair;
