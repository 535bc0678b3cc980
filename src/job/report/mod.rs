//! Reports of runs, from their records alone: files, and text for the terminal.

pub(crate) mod choice;
mod combine;
mod cost;
mod join;
pub(crate) mod open;
mod runs;
mod story;

pub(crate) use runs::{ReportArgs, report};
pub(crate) use story::story_curves;
