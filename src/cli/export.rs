//! The flags of `export`.

use std::num::{NonZeroU64, NonZeroUsize};
use std::path::PathBuf;

use clap::Args;

use super::{EnhancementArgs, LightArgs, SensorArgs};

/// The flags of `export`.
#[derive(Debug, Args)]
pub struct ExportArgs {
    /// The form: vlmevalkit (a .tsv with the images in it), imagefolder (metadata.jsonl beside the images, as Hugging Face
    /// and lmms-eval load it), llava (questions.jsonl beside the images)
    #[arg(value_name = "KIND")]
    pub kind: String,
    /// A folder of frames, or a ready-made set (.tsv, .jsonl)
    #[arg(value_name = "DATA")]
    pub data: PathBuf,
    /// Where the sets go, one for each condition
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// The questions about a folder of frames; default: questions.jsonl in it
    #[arg(long, value_name = "FILE")]
    pub questions: Option<PathBuf>,
    /// Only the first N questions
    #[arg(long, value_name = "N")]
    pub limit: Option<NonZeroUsize>,
    /// Only these question families (or categories of a ready-made set), separated by commas
    #[arg(long, value_name = "LIST")]
    pub families: Option<String>,
    /// The most pixels an image may have before it is refused undecoded; default: 100 million
    #[arg(long, value_name = "N")]
    pub max_pixels: Option<NonZeroU64>,
    /// Light.
    #[command(flatten)]
    pub light: LightArgs,
    /// Light, as a sensor sees it.
    #[command(flatten)]
    pub sensor: SensorArgs,
    /// Enhancement.
    #[command(flatten)]
    pub enhancement: EnhancementArgs,
    /// Write over sets that are there already
    #[arg(long, help_heading = "Output")]
    pub force: bool,
    /// No progress
    #[arg(long, help_heading = "Output")]
    pub quiet: bool,
    /// A TOML file of flags by their long names
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    pub config: Option<PathBuf>,
}
