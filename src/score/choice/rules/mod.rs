//! Parsing rules: the strict parsing, and the levels of the lenient parsing.

pub(super) mod lenient;
mod steps;
pub(super) mod strict;
