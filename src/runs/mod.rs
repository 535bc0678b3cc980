//! Runs on disk: read from their folders, joined from parts, tabled, and with their images made again.
//!
//! [`stored`] is a run as read, [`run_parts`] joins those of shards, [`record_table`] writes `records.parquet`.

pub(crate) mod batch_system;
pub(crate) mod first_source;
pub(crate) mod mark_index;
pub(crate) mod other_parts;
pub(crate) mod outcome;
pub(crate) mod over_budget;
pub(crate) mod part;
pub(crate) mod part_args;
pub(crate) mod part_cost;
pub(crate) mod placed_trials;
pub(crate) mod predictions;
pub(crate) mod rebuild;
pub(crate) mod record_table;
pub(crate) mod renamed;
pub(crate) mod run_files;
pub(crate) mod run_parts;
pub(crate) mod run_plan;
pub(crate) mod run_texts;
pub(crate) mod shard;
pub(crate) mod stored;
pub(crate) mod training;

pub(crate) use outcome::{Outcome, ShowArgs, StdoutFormat, Syntax};
