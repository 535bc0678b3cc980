//! Runs through a Batch API, which may take a day and usually costs half.
//!
//! The remaining requests are written as input files into `RUN/batch/`, together with records of their trials without
//! outcomes. Until the replies are imported, the run does not ask those trials. Either the user uploads the files to
//! the API and imports its output, or the program does both ([`run`]): each file is then a [`journal`], a [`driver`]
//! advances the parts, and a [`journal`] records their progress.

mod collect;
mod driver;
pub mod file;
mod folder;
pub mod journal;
mod recover;
pub mod replies;
pub mod run;
mod servers;
mod submit;

use std::num::{NonZeroU64, NonZeroUsize};

use clap::Args;

use darkqa_base::types::Decides;

pub use folder::{FolderBatches, FolderTask};
pub use servers::{BatchRunArgs, CollectArgs};

/// Flags of the input files of a Batch API. The default limits are those of the vendor, else those of OpenAI and Azure.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Batch")]
pub struct BatchFileArgs {
    /// The largest size of a file, in MB; default: what is known of the endpoint, else 200
    #[arg(long, value_name = "MB", add = Decides::Nothing)]
    pub file_size: Option<NonZeroU64>,
    /// The largest number of requests in a file; default: what is known of the endpoint, else 50000
    #[arg(long, value_name = "N", add = Decides::Nothing)]
    pub file_requests: Option<NonZeroUsize>,
    /// The URL path of each request; default: what is known of the endpoint, else that of the model's API,
    /// /v1/chat/completions
    #[arg(long, value_name = "PATH", value_parser = path, add = Decides::Nothing)]
    pub url: Option<String>,
}

/// Parses the path of a URL.
fn path(text: &str) -> Result<String, String> {
    text.starts_with('/').then(|| text.to_owned()).ok_or_else(|| "a path expected, as /v1/chat/completions".to_owned())
}
