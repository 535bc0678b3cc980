//! Reports of runs, from their records alone: files, and text for the terminal.

pub(crate) mod choice;
mod combine;
mod cost;
mod join;
pub(crate) mod open;
mod runs;

pub(crate) use runs::{ReportArgs, report};
