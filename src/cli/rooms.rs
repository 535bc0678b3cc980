//! The flags of `rooms`.

use std::num::NonZeroUsize;
use std::path::PathBuf;

use clap::Args;

/// The flags of `rooms`.
#[derive(Debug, Args)]
pub struct RoomsArgs {
    /// Where the frames go, in the common interface
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// So many frames, two of each room; default: 48
    #[arg(long, value_name = "N")]
    pub frames: Option<usize>,
    /// What decides the rooms; default: 7
    #[arg(long, value_name = "N")]
    pub seed: Option<u64>,
    /// Width and height in pixels; default: 640x480
    #[arg(long, value_name = "WIDTHxHEIGHT")]
    pub size: Option<String>,
    /// Write into a folder that holds frames already
    #[arg(long)]
    pub force: bool,
    /// Threads, 1024 at most; default: all cores
    #[arg(long, value_name = "N")]
    pub threads: Option<NonZeroUsize>,
    /// No progress
    #[arg(long)]
    pub quiet: bool,
    /// A TOML file of flags by their long names
    #[arg(long, value_name = "FILE")]
    pub config: Option<PathBuf>,
}
