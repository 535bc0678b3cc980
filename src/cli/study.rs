//! The flags of `study`.

use std::num::NonZeroUsize;
use std::path::PathBuf;

use clap::{Args, Subcommand};

use super::AgainArgs;

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
    /// Where everything lies by now.
    #[command(flatten)]
    pub again: AgainArgs,
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
