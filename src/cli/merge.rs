//! The flags of `merge`.

use std::path::PathBuf;

use clap::Args;

/// The flags of `merge`.
#[derive(Debug, Args)]
pub struct MergeArgs {
    /// The folders of the shards, or a folder that holds them
    #[arg(value_name = "RUN", required = true)]
    pub runs: Vec<PathBuf>,
    /// The folder of the whole run
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Merge what there is where shards are missing, to look at it
    #[arg(long)]
    pub partial: bool,
    /// Print the summary as JSON instead of a table
    #[arg(long)]
    pub json: bool,
}
