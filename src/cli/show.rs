//! The flags of `show`.

use std::num::NonZeroUsize;
use std::path::PathBuf;

use clap::Args;

/// The flags of `show`.
#[derive(Debug, Args)]
pub struct ShowArgs {
    /// The folder of a run
    #[arg(value_name = "RUN")]
    pub run: PathBuf,
    /// The id of a question
    #[arg(value_name = "ITEM")]
    pub item: String,
    /// Only these conditions, as L3-noise+zerodce; repeatable; default: all that it was asked in
    #[arg(long, value_name = "CONDITION")]
    pub condition: Vec<String>,
    /// Where the images go; default: shown in the folder of the run
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Where everything lies by now.
    #[command(flatten)]
    pub again: AgainArgs,
}

/// How the images of a run are made again.
#[derive(Debug, Args)]
pub struct AgainArgs {
    /// The data, where they lie elsewhere by now
    #[arg(long, value_name = "DIR|FILE|rooms:…")]
    pub data: Option<PathBuf>,
    /// The enhancement models, where they lie elsewhere by now; repeatable
    #[arg(long, value_name = "FILE")]
    pub llie: Vec<PathBuf>,
    /// Threads, 1024 at most; default: all cores
    #[arg(long, value_name = "N")]
    pub threads: Option<NonZeroUsize>,
    /// The ONNX Runtime library to load; default: ORT_DYLIB_PATH, else found, else installed once by pip
    #[arg(long, value_name = "FILE")]
    pub ort_lib: Option<PathBuf>,
    /// Never install ONNX Runtime
    #[arg(long)]
    pub offline: bool,
}
