//! The flags for batches submitted by the program: [`BatchRunArgs`], [`CollectArgs`].

use std::num::NonZeroU64;
use std::time::Duration;

use clap::Args;

use crate::types::Decides;
use crate::types::flags::{positive, seconds};

/// Flags for looking after batches.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Batch")]
pub(crate) struct CollectArgs {
    /// Seconds between two checks of the batches; up to 30 times as long while nothing changes
    #[arg(long, value_name = "SECONDS", value_parser = seconds, default_value = "10", add = Decides::Nothing)]
    pub poll: Duration,
    /// Leave the files at the server after their replies are imported; default: delete them, as they hold the images
    #[arg(long, add = Decides::Nothing)]
    pub keep_files: bool,
}

/// Flags for submitting batches.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Batch")]
pub(crate) struct BatchRunArgs {
    /// Flags for looking after batches.
    #[command(flatten)]
    pub collect: CollectArgs,
    /// Submit the batches and return; batch fetch, or the same command, imports the replies
    #[arg(long, add = Decides::Nothing)]
    pub detach: bool,
    /// Send no single request of each model before its batches; such a request finds out what the server refuses
    #[arg(long, add = Decides::Nothing)]
    pub no_scout: bool,
    /// The tokens that the server lets wait for batches of a model; parts have at most 45 % of it; default: what the
    /// server states when it refuses a batch, and parts of 2 million
    #[arg(long, value_name = "N", add = Decides::Nothing)]
    pub enqueued_tokens: Option<NonZeroU64>,
    /// The time within which the server is to end a batch
    #[arg(long, value_name = "TIME", default_value = "24h", add = Decides::Nothing)]
    pub window: String,
    /// Cancel a batch that has not ended after this time; what it has not answered is asked again; default: never
    #[arg(long, value_name = "HOURS", value_parser = positive, add = Decides::Nothing)]
    pub give_up: Option<f64>,
    /// The purpose under which files are uploaded; default: what is known of the endpoint, else batch
    #[arg(long, value_name = "WORD", add = Decides::Nothing)]
    pub purpose: Option<String>,
}

impl BatchRunArgs {
    /// The flags of a command that submits nothing.
    #[must_use]
    pub(super) fn collecting(collect: &CollectArgs) -> Self {
        Self {
            collect: collect.clone(),
            detach: false,
            no_scout: true,
            enqueued_tokens: None,
            window: String::new(),
            give_up: None,
            purpose: None,
        }
    }
}
