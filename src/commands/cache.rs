//! `cache`: lists or removes the images of an image store.

use std::path::PathBuf;

use clap::Args;

use darkqa_base::error::Result;
use darkqa_base::types::Decides;
use darkqa_base::types::manifests::Status;
use darkqa_engine::image_cache::{clear, listing};
use darkqa_runs::Outcome;

/// The flags of `cache`.
#[derive(Debug, Args)]
pub(crate) struct CacheArgs {
    /// The folder that --images-cache named
    #[arg(value_name = "DIR", add = Decides::Nothing)]
    pub folder: PathBuf,
    /// Remove all its images; a run that uses it meanwhile makes them again
    #[arg(long, add = Decides::Nothing)]
    pub clear: bool,
}

/// Lists or removes the images of a store.
///
/// # Errors
/// If the folder is not an image store or cannot be read, or a file cannot be removed.
pub(crate) fn cache(args: &CacheArgs) -> Result<Outcome> {
    let text = if args.clear { clear(&args.folder)? } else { listing(&args.folder)? };
    Ok(Outcome::text(Status::Complete, text))
}
