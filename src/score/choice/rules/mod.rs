//! Parsing rules: the strict parsing, and the levels of the lenient parsing.

mod contradiction;
mod first_line;
pub(super) mod lenient;
mod stated;
pub(super) mod strict;
mod structured;
mod ticks;
mod yes_no;
