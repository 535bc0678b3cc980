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
pub mod listing;
mod model_names;
pub mod open;
mod settings;
pub mod site;
pub mod stamp;
pub mod written;

pub use command::{ReportArgs, report, story_curves};
pub use cost::price;
pub use figure_runs::FigureRuns;
pub use site::site;
pub use written::whole_report;
