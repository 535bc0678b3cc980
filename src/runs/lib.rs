//! Runs on disk: reads them from their folders, joins shards, writes tables of records, and rebuilds images.
//!
//! [`stored`] reads a run, [`sharded_run`] joins the shards of one, [`record_table`] writes `records.parquet`.

#![allow(missing_docs, reason = "fields and variants of this workspace's own use, whose names say what they are")]
#![cfg_attr(test, allow(clippy::unwrap_used, reason = "a test may panic"))]

pub mod batch_system;
pub mod forecast;
pub mod mark_index;
pub mod missing_thumbnails;
pub mod outcome;
pub mod predictions;
pub mod record_table;
pub mod renamed;
pub mod resolved_shard;
pub mod run_plan;
pub mod run_texts;
pub mod shard;
pub mod shard_records;
pub mod sharded_run;
pub mod stored;
pub mod training;
mod zipped_run;

pub use outcome::{
    EXPOSURE_VALUE, LLIE_BUDGET, LUX_AT_L0, Outcome, PROMPTS, PrintArgs, StatedArgs, StdoutFormat, Syntax,
};
