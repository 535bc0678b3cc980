//! The flags of `batch`.

use std::num::{NonZeroU64, NonZeroUsize};
use std::path::PathBuf;

use clap::{Args, Subcommand};

use super::EvaluateArgs;

/// What can be done with batches.
#[derive(Debug, Subcommand)]
pub enum BatchCommand {
    /// Write what an evaluation has left to ask as files of a Batch API; takes the flags of the evaluation
    Export(Box<BatchExportArgs>),
    /// Take the replies of a Batch API over into a run
    Import(BatchImportArgs),
}

/// The flags of `batch export`.
#[derive(Debug, Args)]
pub struct BatchExportArgs {
    /// The evaluation.
    #[command(flatten)]
    pub evaluate: EvaluateArgs,
    /// Its files.
    #[command(flatten)]
    pub files: BatchFileArgs,
}

/// What the files are like.
#[derive(Debug, Default, Args)]
#[command(next_help_heading = "Batch")]
pub struct BatchFileArgs {
    /// The most bytes of a file, in MB; default: 200
    #[arg(long, value_name = "MB")]
    pub file_size: Option<NonZeroU64>,
    /// The most requests of a file; default: 50000
    #[arg(long, value_name = "N")]
    pub file_requests: Option<NonZeroUsize>,
    /// The path that each line asks; default: /v1/chat/completions
    #[arg(long, value_name = "PATH")]
    pub url: Option<String>,
}

/// The flags of `batch import`.
#[derive(Debug, Args)]
pub struct BatchImportArgs {
    /// The folder of the run that the batch was exported from
    #[arg(value_name = "RUN")]
    pub run: PathBuf,
    /// The output files and error files of the Batch API, in any order
    #[arg(value_name = "FILE", required = true)]
    pub files: Vec<PathBuf>,
    /// Print the summary as JSON instead of a table
    #[arg(long)]
    pub json: bool,
}
