//! Runs on disk: reads them from their folders, joins shards, writes tables of records, and rebuilds images.
//!
//! [`stored`] reads a run, [`sharded_run`] joins the shards of one, [`record_table`] writes `records.parquet`.

pub(crate) mod batch_system;
pub(crate) mod forecast;
pub(crate) mod mark_index;
pub(crate) mod missing_thumbnails;
pub(crate) mod outcome;
pub(crate) mod predictions;
pub(crate) mod record_table;
pub(crate) mod renamed;
pub(crate) mod resolved_shard;
pub(crate) mod run_plan;
pub(crate) mod run_texts;
pub(crate) mod shard;
pub(crate) mod shard_records;
pub(crate) mod sharded_run;
pub(crate) mod stored;
pub(crate) mod training;
mod zipped_run;

pub(crate) use outcome::{
    EXPOSURE_VALUE, LLIE_BUDGET, LUX_AT_L0, Outcome, PROMPTS, PrintArgs, StatedArgs, StdoutFormat, Syntax,
};
