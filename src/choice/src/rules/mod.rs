//! Rules of reading: the strict parsing, and the steps of the lenient one.

mod contradiction;
mod first_line;
pub(super) mod lenient;
mod stated;
pub(super) mod strict;
mod structured;
mod ticks;
mod yes_no;
