//! The flags of `serve`.

use std::path::PathBuf;

use clap::Args;

/// The flags of `serve`.
#[derive(Debug, Args)]
pub struct ServeArgs {
    /// The frames that the observer knows: rooms:frames=N,seed=N,size=WIDTHxHEIGHT, or a folder of frames with maps; default:
    /// the built-in rooms
    #[arg(long, value_name = "DIR|rooms:…")]
    pub data: Option<PathBuf>,
    /// The port on 127.0.0.1, 0 for any that is free; default: 8089
    #[arg(long, value_name = "N")]
    pub port: Option<u16>,
    /// What decides the guesses; default: 0
    #[arg(long, value_name = "N")]
    pub seed: Option<u64>,
    /// No progress
    #[arg(long)]
    pub quiet: bool,
}
