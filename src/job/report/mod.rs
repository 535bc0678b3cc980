//! What runs hold, from their records alone, as files and in words.

pub(crate) mod choice;
mod combine;
mod cost;
mod join;
pub(crate) mod open;
mod runs;

pub(crate) use runs::{ReportArgs, report};
