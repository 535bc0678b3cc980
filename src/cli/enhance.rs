//! The flags of `enhance`.

use std::num::{NonZeroU64, NonZeroUsize};
use std::path::PathBuf;

use clap::Args;

/// The flags of `enhance`.
#[derive(Debug, Args)]
#[expect(
    clippy::struct_excessive_bools,
    reason = "switches are what clap parses them into"
)]
pub struct EnhanceArgs {
    /// The model as ONNX, or PRESET:FILE (zero-dce, zero-dce++, ruas-lol, ruas-upe, retinexformer, darkir, sci, iat,
    /// pairlie, enlightengan)
    #[arg(value_name = "MODEL")]
    pub model: PathBuf,
    /// Images (PNG, JPEG) and folders of frames
    #[arg(value_name = "INPUT", required_unless_present = "describe")]
    pub inputs: Vec<PathBuf>,
    /// Where the enhanced images go, as PNG under their own names
    #[arg(long, value_name = "DIR", required_unless_present = "describe")]
    pub out: Option<PathBuf>,
    /// Tell how the model is fed and read, and what says so; enhances nothing
    #[arg(long, conflicts_with_all = ["inputs", "out"])]
    pub describe: bool,
    /// In tiles of N × N pixels, their seams checked, or whole; default: 256 for images above 1280 × 720 where sidecar or
    /// preset say that tiles are exact, else whole
    #[arg(long, value_name = "N|whole", help_heading = "Enhancement")]
    pub tile: Option<String>,
    /// Enhance images whose longer side is longer than this, in pixels, in that size, and scale the result back (bilinear):
    /// for models that need the whole image and too much memory for it; default: never
    #[arg(long, value_name = "PIXELS", help_heading = "Enhancement")]
    pub llie_max_side: Option<NonZeroUsize>,
    /// Threads, 1024 at most; default: all cores
    #[arg(long, value_name = "N", help_heading = "Enhancement")]
    pub threads: Option<NonZeroUsize>,
    /// The ONNX Runtime library to load; default: ORT_DYLIB_PATH, else found, else installed once by pip
    #[arg(long, value_name = "FILE", help_heading = "Enhancement")]
    pub ort_lib: Option<PathBuf>,
    /// Never install ONNX Runtime
    #[arg(long, help_heading = "Enhancement")]
    pub offline: bool,
    /// The most pixels an image may have before it is refused undecoded; default: 100 million
    #[arg(long, value_name = "N", help_heading = "Output")]
    pub max_pixels: Option<NonZeroU64>,
    /// Make images again that are there already
    #[arg(long, help_heading = "Output")]
    pub force: bool,
    /// No progress
    #[arg(long, help_heading = "Output")]
    pub quiet: bool,
    /// A TOML file of flags by their long names
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    pub config: Option<PathBuf>,
}
