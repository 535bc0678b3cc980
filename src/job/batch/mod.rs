//! A run through the files of a Batch API, which takes a day and costs half.
//!
//! What is left to ask is written as input files into `RUN/batch/`, each trial beside it as the record that it will become. The user
//! hands the files to the API and brings its output back; until then the run leaves those trials alone. What failed or expired is
//! asked again by the next export, or directly.

pub(super) mod export;
mod file;
pub(crate) mod replies;
mod requests;

use crate::types::Decides;
use std::num::{NonZeroU64, NonZeroUsize};

use clap::Args;

/// What the input files of a Batch API are like; the limits are those of OpenAI and Azure.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Batch")]
pub(crate) struct BatchFileArgs {
    /// The most bytes of a file, in MB
    #[arg(long, value_name = "MB", default_value = "200", add = Decides::Nothing)]
    pub file_size: NonZeroU64,
    /// The most requests of a file
    #[arg(long, value_name = "N", default_value = "50000", add = Decides::Nothing)]
    pub file_requests: NonZeroUsize,
    /// The path that each line asks; default: that of the model's API, /v1/chat/completions
    #[arg(long, value_name = "PATH", value_parser = path, add = Decides::Nothing)]
    pub url: Option<String>,
}

/// Reads the path of a URL.
fn path(text: &str) -> Result<String, String> {
    let path = text.starts_with('/').then(|| text.to_owned());
    path.ok_or_else(|| "a path expected, as /v1/chat/completions".to_owned())
}
