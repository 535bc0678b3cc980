//! The flags of `questions`.

use std::num::{NonZeroU64, NonZeroUsize};
use std::path::PathBuf;

use clap::Args;

/// The flags of `questions`.
#[derive(Debug, Args)]
pub struct QuestionsArgs {
    /// A folder of frames with their maps (frames.jsonl, classes.json), as import makes it
    #[arg(value_name = "DATA")]
    pub data: PathBuf,
    /// Where the questions go (.jsonl); what was measured of the frames is kept beside it
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
    /// The rulebook; default: the one built in (src/questions/rules.toml)
    #[arg(long, value_name = "FILE", help_heading = "Rules")]
    pub rules: Option<PathBuf>,
    /// The names of colours, a table like src/questions/colors.txt; default: the one built in
    #[arg(long, value_name = "FILE", help_heading = "Rules")]
    pub colors: Option<PathBuf>,
    /// Only these families: room_type, affordance, presence, color, closest; default: all
    #[arg(long, value_name = "LIST", help_heading = "Rules")]
    pub families: Option<String>,
    /// How the answers are evened out: none (Algorithm 1 to the letter), binary (as many yes as no of each class and
    /// activity), full (no room and no colour too frequent, either); default: binary
    #[arg(long, value_name = "none|binary|full", help_heading = "Rules")]
    pub balance: Option<String>,
    /// What says which room it is: signature (what is seen of it, as the paper) or stated (room_gt of the data set);
    /// default: signature
    #[arg(long, value_name = "signature|stated", help_heading = "Rules")]
    pub room: Option<String>,
    /// Refuse numbers of a semantic map that classes.json does not have, instead of counting them as unlabelled
    #[arg(long, help_heading = "Rules")]
    pub strict: bool,
    /// Write what became of every candidate, a line each
    #[arg(long, value_name = "FILE", help_heading = "Checking")]
    pub candidates: Option<PathBuf>,
    /// Write the statistics of frames, questions and answers: JSON, CSV and a figure
    #[arg(long, value_name = "DIR", help_heading = "Checking")]
    pub stats: Option<PathBuf>,
    /// Write a page on which a person accepts or rejects each question
    #[arg(long, value_name = "FILE.html", help_heading = "Checking")]
    pub review: Option<PathBuf>,
    /// Leave out what a person has rejected on such a page; repeatable
    #[arg(long, value_name = "FILE", help_heading = "Checking")]
    pub verdicts: Vec<PathBuf>,
    /// Threads, 1024 at most; default: all cores
    #[arg(long, value_name = "N", help_heading = "Output")]
    pub threads: Option<NonZeroUsize>,
    /// The most pixels an image may have before it is refused undecoded; default: 100 million
    #[arg(long, value_name = "N", help_heading = "Output")]
    pub max_pixels: Option<NonZeroU64>,
    /// Print the statistics as JSON instead of a table
    #[arg(long, help_heading = "Output")]
    pub json: bool,
    /// No progress
    #[arg(long, help_heading = "Output")]
    pub quiet: bool,
    /// A TOML file of flags by their long names
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    pub config: Option<PathBuf>,
}
