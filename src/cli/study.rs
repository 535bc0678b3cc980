//! The flags of `study`.

use std::num::NonZeroUsize;
use std::path::PathBuf;

use clap::{Args, Subcommand};

/// What can be done with people's answers.
#[derive(Debug, Subcommand)]
pub enum StudyCommand {
    /// Write a page on which people answer the questions of a run about the very images that its models were sent
    Pack(StudyPackArgs),
    /// Take people's answers over as a run of a model of their own, to be compared by report
    Read(StudyReadArgs),
}

/// The flags of `study pack`.
#[derive(Debug, Args)]
pub struct StudyPackArgs {
    /// The folder of a run
    #[arg(value_name = "RUN")]
    pub run: PathBuf,
    /// Where the page and its images go
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Ask about so many questions, drawn by their names; default: all
    #[arg(long, value_name = "N")]
    pub items: Option<NonZeroUsize>,
    /// Only these conditions, as L3-noise+zerodce; repeatable; default: all of the run
    #[arg(long, value_name = "CONDITION")]
    pub condition: Vec<String>,
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
    /// No progress
    #[arg(long)]
    pub quiet: bool,
}

/// The flags of `study read`.
#[derive(Debug, Args)]
pub struct StudyReadArgs {
    /// The folder of the run whose questions were answered
    #[arg(value_name = "RUN")]
    pub run: PathBuf,
    /// Files of answers, as the page saves them: lines of {"question", "condition", "person", "answer"}
    #[arg(value_name = "FILE", required = true)]
    pub files: Vec<PathBuf>,
    /// The folder of the people's run
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// What the people are called among the models; default: human
    #[arg(long, value_name = "NAME")]
    pub name: Option<String>,
    /// Print the summary as JSON instead of a table
    #[arg(long)]
    pub json: bool,
}
