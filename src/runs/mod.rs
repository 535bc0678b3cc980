//! Runs on disk: reads them from their folders, joins shards, writes tables of records, and rebuilds images.
//!
//! [`stored`] reads a run, [`sharded_run`] joins the shards of one, [`record_table`] writes `records.parquet`.

mod batch_system;
pub(crate) mod changed_settings;
pub(crate) mod divisions;
pub(crate) mod first_source;
pub(crate) mod forecast;
pub(crate) mod mark_index;
pub(crate) mod missing_thumbnails;
pub(crate) mod other_shards;
pub(crate) mod outcome;
pub(crate) mod over_budget;
pub(crate) mod power_forecast;
pub(crate) mod predictions;
pub(crate) mod record_table;
pub(crate) mod renamed;
pub(crate) mod report_length;
pub(crate) mod resolved_shard;
pub(crate) mod run_files;
pub(crate) mod run_plan;
pub(crate) mod run_texts;
pub(crate) mod shard;
pub(crate) mod shard_args;
pub(crate) mod shard_budget;
pub(crate) mod shard_records;
pub(crate) mod shard_sources;
pub(crate) mod sharded_run;
pub(crate) mod slurm_array;
mod slurm_job;
pub(crate) mod stored;
pub(crate) mod training;

pub(crate) use outcome::{Outcome, ShowArgs, StdoutFormat, Syntax};
