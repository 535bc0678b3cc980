//! Reports on runs, made from their records alone: files, and text for the terminal.

mod alerts;
mod baseline;
mod combine;
mod command;
mod cost;
mod enhancers;
mod figure_runs;
mod image_groups;
mod join;
pub(crate) mod listing;
mod model_names;
pub(crate) mod open;
mod settings;
pub(crate) mod site;
pub(crate) mod stamp;
pub(crate) mod written;

pub(crate) use command::{ReportArgs, report, story_curves};
pub(crate) use cost::price;
pub(crate) use figure_runs::FigureRuns;
pub(crate) use site::site;
pub(crate) use written::whole_report;
