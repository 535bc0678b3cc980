//! Reports on runs, made from their records alone: files, and text for the terminal.

mod alerts;
mod baseline;
pub(crate) mod choice;
mod combine;
mod command;
mod common;
mod cost;
mod enhancers;
mod figure_runs;
mod image_groups;
mod join;
mod judges;
mod lenient_change;
mod listing;
mod model_names;
pub(crate) mod open;
mod own_answers;
mod report_folder;
mod settings;
mod site;
mod story;
mod whole;
mod whole_report;

pub(crate) use command::{ReportArgs, report};
pub(crate) use cost::price;
pub(crate) use figure_runs::FigureRuns;
pub(crate) use site::site;
pub(crate) use story::story_curves;
pub(crate) use whole::whole_report;
