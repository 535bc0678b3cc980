//! Reports of runs, from their records alone: files, and text for the terminal.

mod alerts;
mod baseline;
pub(crate) mod choice;
mod combine;
mod common;
mod cost;
mod enhancers;
mod figure_runs;
mod join;
pub(crate) mod judges;
mod lights;
mod listing;
mod models;
pub(crate) mod open;
mod own_answers;
mod report_folder;
mod rereading;
mod runs;
mod settings;
mod site;
mod story;
mod whole;
mod whole_report;

pub(crate) use cost::price;
pub(crate) use figure_runs::FigureRuns;
pub(crate) use runs::{ReportArgs, report};
pub(crate) use site::site;
pub(crate) use story::story_curves;
pub(crate) use whole::whole;
