//! The command line: exactly what the user typed, nothing checked against the world and nothing filled in.
//!
//! The same structure is read three times: from the arguments, from `DARKQA_*` variables and from a `--config` file
//! (see [`crate::config`]); so every field is an `Option`, a list or a switch, and no default stands here.

mod asking;
mod batch;
mod enhance;
mod export;
mod import;
mod merge;
mod openeqa;
mod questions;
mod report;
mod rooms;
mod serve;
mod show;
mod study;

use std::num::{NonZeroU32, NonZeroU64, NonZeroUsize};
use std::path::PathBuf;

use clap::{Args, Parser, Subcommand};
use serde::Serialize;

pub use asking::{ModelArgs, SendingArgs};
pub use batch::{BatchCommand, BatchExportArgs, BatchFileArgs, BatchImportArgs};
pub use enhance::EnhanceArgs;
pub use export::ExportArgs;
pub use import::ImportArgs;
pub use merge::MergeArgs;
pub use openeqa::OpenEqaArgs;
pub use questions::QuestionsArgs;
pub use report::ReportArgs;
pub use rooms::RoomsArgs;
pub use serve::ServeArgs;
pub use show::{AgainArgs, ShowArgs};
pub use study::{StudyCommand, StudyPackArgs, StudyReadArgs};

/// Measures how well a vision-language model sees in the dark.
///
/// Makes low-light versions of indoor images (levels L0–L5: 0, 2, 4, 6, 7.5, 9 EV darker; by exposure drop alone and
/// with sensor noise), mends them with any enhancement model given as ONNX, asks OpenAI-compatible endpoints
/// multiple-choice questions about each image, and scores the replies by exact match.
///
/// The same command run again goes on where it stopped: what was answered is never asked again.
#[derive(Debug, Parser)]
#[command(
    name = "darkqa-eval", version, about, long_about, max_term_width = 110, after_help = AFTER_HELP,
    args_conflicts_with_subcommands = true
)]
pub struct Cli {
    /// Anything but an evaluation.
    #[command(subcommand)]
    pub command: Option<Command>,
    /// What to evaluate, and how.
    #[command(flatten)]
    pub evaluate: EvaluateArgs,
}

/// What can be done besides evaluating.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Write the low-light versions of images, as an evaluation would send them
    Synthesize(SynthesizeArgs),
    /// Hold the synthesis against real pairs of images in normal and low light
    Realism(RealismArgs),
    /// Make multiple-choice questions about frames, by rule, from their depth, class and segment maps
    Questions(QuestionsArgs),
    /// Take over frames of another data set into the common interface
    Import(ImportArgs),
    /// Write ready-made sets for other tools, one for each condition, with its images
    Export(Box<ExportArgs>),
    /// Write the built-in rooms as frames with depth, class and segment maps
    Rooms(RoomsArgs),
    /// Enhance images by an ONNX model, as an evaluation would; or tell how it is fed and read
    Enhance(EnhanceArgs),
    /// Ask through a Batch API, at half the price: write its input files, take over its output files
    #[command(subcommand)]
    Batch(BatchCommand),
    /// Ask OpenEQA's open questions about walks through dark houses, the answers marked by a judge (LLM-Match)
    ///
    /// The frames of each walk are darkened, scaled and sent with upstream's prompts, byte for byte; so are the answers to the
    /// judge. The same answer to the same question is judged once. What was answered or marked is never asked again.
    #[command(name = "openeqa", mut_args(openeqa::own))]
    OpenEqa(Box<OpenEqaArgs>),
    /// Answer as the built-in models do behind an OpenAI-compatible endpoint on this machine, for trying clients without keys
    Serve(ServeArgs),
    /// Show what runs hold, from their records alone: tables, figures and one HTML file; several runs are compared
    Report(ReportArgs),
    /// Put the shards of an evaluation together as the one run that they are
    Merge(MergeArgs),
    /// Make the images that one question was asked with again, bit for bit, and prove it by their digests
    Show(ShowArgs),
    /// Let people answer what the models were asked: write a page for them, take their answers over as a model's
    #[command(subcommand)]
    Study(StudyCommand),
}

/// The flags of `synthesize`.
#[derive(Debug, Args)]
pub struct SynthesizeArgs {
    /// Images, folders of images, or folders of frames (frames.jsonl)
    #[arg(required = true, value_name = "INPUT")]
    pub inputs: Vec<PathBuf>,
    /// Where the images go, each with a JSON file that holds all that made it
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Light.
    #[command(flatten)]
    pub light: LightArgs,
    /// Light, as a sensor sees it.
    #[command(flatten)]
    pub sensor: SensorArgs,
    /// Make again the image that this JSON file stands beside, from the one INPUT that it was made from
    #[arg(long, value_name = "FILE", help_heading = "Synthesis")]
    pub from: Option<PathBuf>,
    /// One figure per input instead: levels (both variants by level, with amplified crops) or noise (each term alone)
    #[arg(
        long,
        value_name = "levels|noise",
        help_heading = "Synthesis",
        conflicts_with = "from"
    )]
    pub sheet: Option<String>,
    /// Make again what is there already
    #[arg(long, help_heading = "Synthesis")]
    pub force: bool,
    /// Threads, 1024 at most; default: all cores
    #[arg(long, value_name = "N", help_heading = "Synthesis")]
    pub threads: Option<NonZeroUsize>,
    /// The most pixels an image may have before it is refused undecoded; default: 100 million
    #[arg(long, value_name = "N", help_heading = "Synthesis")]
    pub max_pixels: Option<NonZeroU64>,
    /// No progress
    #[arg(long, help_heading = "Synthesis")]
    pub quiet: bool,
    /// A TOML file of flags by their long names
    #[arg(long, value_name = "FILE", help_heading = "Synthesis")]
    pub config: Option<PathBuf>,
}

/// The flags of `realism`.
#[derive(Debug, Args)]
pub struct RealismArgs {
    /// A folder of pairs: normal/ and low/, high/ and low/, val_rgb_h/ and val_rgb_l/, or files like normal1.png and
    /// low1.png
    #[arg(
        value_name = "PAIRS",
        required_unless_present = "normal",
        conflicts_with = "normal"
    )]
    pub pairs: Option<PathBuf>,
    /// The images in normal light, where they lie elsewhere
    #[arg(long, value_name = "DIR", requires = "low")]
    pub normal: Option<PathBuf>,
    /// The images in low light, of the same names
    #[arg(long, value_name = "DIR", requires = "normal")]
    pub low: Option<PathBuf>,
    /// The exposure drop of every pair in EV; default: estimated for each from its mean light
    #[arg(long, value_name = "EV", allow_negative_numbers = true)]
    pub ev: Option<f32>,
    /// The bins of the residuals' divergence: fu (64 bins within ±0.1) or kousha (4 codes wide); default: fu
    #[arg(long, value_name = "fu|kousha")]
    pub kl_bins: Option<String>,
    /// What is done about empty bins of fu: eps (1e-8 added to each) or drop (they are left out); both are shown; default:
    /// eps
    #[arg(long, value_name = "eps|drop")]
    pub kl_empty: Option<String>,
    /// Light, as a sensor sees it.
    #[command(flatten)]
    pub sensor: SensorArgs,
    /// Where the numbers by pair, the summary and the figures go; default: nowhere
    #[arg(long, value_name = "DIR", help_heading = "Output")]
    pub out: Option<PathBuf>,
    /// Print the summary as JSON instead of a table
    #[arg(long, help_heading = "Output")]
    pub json: bool,
    /// Threads, 1024 at most; default: all cores
    #[arg(long, value_name = "N", help_heading = "Output")]
    pub threads: Option<NonZeroUsize>,
    /// The most pixels an image may have before it is refused undecoded; default: 100 million
    #[arg(long, value_name = "N", help_heading = "Output")]
    pub max_pixels: Option<NonZeroU64>,
    /// No progress
    #[arg(long, help_heading = "Output")]
    pub quiet: bool,
    /// A TOML file of flags by their long names
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    pub config: Option<PathBuf>,
}

const AFTER_HELP: &str = "\
Precedence: flag, then environment (DARKQA_CONCURRENCY=16 for --concurrency 16), then --config FILE, then default.
OPENAI_BASE_URL, OPENAI_API_KEY and ORT_DYLIB_PATH are defaults: whatever names another goes before them.
Exit codes: 0 everything scored; 1 finished with failures; 2 usage, configuration or a fatal error; 130 interrupted,
or stopped by --max-cost.
Results go to standard output, progress and logs to standard error (RUST_LOG=darkqa_eval=debug shows more).";

/// The flags of an evaluation, by help heading.
#[derive(Debug, Default, Args)]
pub struct EvaluateArgs {
    /// Data.
    #[command(flatten)]
    pub data: DataArgs,
    /// Light.
    #[command(flatten)]
    pub light: LightArgs,
    /// Light, as a sensor sees it.
    #[command(flatten)]
    pub sensor: SensorArgs,
    /// Enhancement.
    #[command(flatten)]
    pub enhancement: EnhancementArgs,
    /// Model.
    #[command(flatten)]
    pub model: ModelArgs,
    /// Sending.
    #[command(flatten)]
    pub sending: SendingArgs,
    /// Scale.
    #[command(flatten)]
    pub scale: ScaleArgs,
    /// Output.
    #[command(flatten)]
    pub output: OutputArgs,
}

/// How it is spread over processes.
#[derive(Debug, Default, Args)]
#[command(next_help_heading = "Scale")]
pub struct ScaleArgs {
    /// Do one of N parts, by frames or walks: I/N; auto/N or auto as the batch system says (Slurm arrays, indexed Kubernetes jobs);
    /// none for everything. --rpm, --tpm and --max-cost are for all parts together; default: auto in a Slurm array, else none
    #[arg(long, value_name = "I/N|auto/N|auto|none")]
    pub shard: Option<String>,
    /// Say at the end where the time went, what binds and what would help
    #[arg(long)]
    pub timings: bool,
}

/// Which images and questions.
#[derive(Debug, Default, Args, Serialize)]
#[command(next_help_heading = "Data")]
pub struct DataArgs {
    /// A folder of frames, a ready-made set (.tsv, .jsonl), or built-in rooms, rooms:frames=N,seed=N,size=WIDTHxHEIGHT; default:
    /// rooms:frames=48,seed=7,size=640x480
    #[arg(long, value_name = "DIR|FILE|rooms:…")]
    pub data: Option<PathBuf>,
    /// The questions about a folder of frames; default: questions.jsonl in it, else made by rule
    /// from its maps
    #[arg(long, value_name = "FILE")]
    pub questions: Option<PathBuf>,
    /// Only the first N questions
    #[arg(long, value_name = "N")]
    pub limit: Option<NonZeroUsize>,
    /// Only these question families (or categories of a ready-made set), separated by commas
    #[arg(long, value_name = "LIST")]
    pub families: Option<String>,
    /// Show the choices of each question in an order drawn from --seed, the same in every condition
    #[arg(long)]
    pub shuffle_options: bool,
    /// Ask each question once for every rotation of its choices: what a model answers by position averages out
    #[arg(long)]
    pub circular: bool,
    /// Ask everything N times; default: 1
    #[arg(long, value_name = "N")]
    pub repeats: Option<NonZeroU32>,
    /// The most pixels an image may have before it is refused undecoded; default: 100 million
    #[arg(long, value_name = "N")]
    pub max_pixels: Option<NonZeroU64>,
}

/// How dark.
#[derive(Debug, Default, Args, Serialize)]
#[command(next_help_heading = "Light")]
pub struct LightArgs {
    /// Levels, as L0-L5 or L0,L3, and exposure drops in EV up to 16, as L0,3.3; default: L0-L5
    #[arg(long, value_name = "LEVELS")]
    pub levels: Option<String>,
    /// Which of the paired variants: ev (exposure drop alone), noise (with sensor noise), both; default: both
    ///
    #[arg(long, value_name = "ev|noise|both")]
    pub variant: Option<String>,
}

/// What takes the noisy images.
#[derive(Debug, Default, Args, Serialize)]
#[command(next_help_heading = "Light")]
pub struct SensorArgs {
    /// The seed of all random draws; default: 0
    #[arg(long, value_name = "N")]
    pub seed: Option<u64>,
    /// Light readings, how the paper's noise is understood: paper (DarkQA to the letter), eld (--amplify all), level
    /// (--coupling photon), physical (--amplify all --tone before-ev --coupling photon), several as paper,eld, or all;
    /// flags beside one go before its parts and make it custom; default: paper
    ///
    /// Conditions with noise carry the reading's name, as L3-noise@physical; that of paper is bare, L3-noise.
    #[arg(long, value_name = "LIST")]
    pub profile: Option<String>,
    /// What the light ratio r amplifies: shot-only (the paper's wording: read, row and quantisation noise act after it) or
    /// all (as ELD and all public code); default: shot-only
    ///
    /// It is the choice that matters most. At grey 128, L1, K 0.77 and r 200, read, row and quantisation noise add 0.03, 0
    /// and 0 codes of deviation by the wording, and 9–19, 1–3 and 1–2 codes with all. The wording is the default because
    /// it is what the paper says, and because the paper's comparison with real images fits the weaker noise.
    #[arg(long, value_name = "shot-only|all")]
    pub amplify: Option<String>,
    /// Where a forward tone curve stands: none (as the paper), before-ev (greys then fall as by exposure alone) or
    /// after-ev; default: none
    #[arg(long, value_name = "none|before-ev|after-ev")]
    pub tone: Option<String>,
    /// Whether the levels of a frame are developed from one noisy RAW image or each from its own; default: shared
    #[arg(long, value_name = "shared|fresh")]
    pub draws: Option<String>,
    /// What the light ratio r depends on: independent (drawn, as the paper) or photon (r = 2^EV: light lost is photons
    /// lost); default: independent
    #[arg(long, value_name = "independent|photon")]
    pub coupling: Option<String>,
    /// The sensor: sony-a7s2, nikon-d850, canon-eos-5d4, canon-eos-70d, canon-eos-700d, or a TOML file of a calibration;
    /// default: sony-a7s2
    #[arg(long, value_name = "NAME|FILE")]
    pub camera: Option<String>,
    /// Pin the system gain K of the sensor, in ADU per electron; default: log-uniform in the camera's range (0.1–6 for
    /// sony-a7s2) for each image
    #[arg(long, value_name = "K")]
    pub gain: Option<f64>,
    /// Pin the light ratio r of the sensor noise; default: uniform in 100–300 for each image
    #[arg(long, value_name = "R")]
    pub ratio: Option<f64>,
    /// Take the middle of every distribution for each image, instead of a draw
    #[arg(long)]
    pub fixed: bool,
}

/// What mends the images.
#[derive(Debug, Default, Args, Serialize)]
#[command(next_help_heading = "Enhancement")]
pub struct EnhancementArgs {
    /// An enhancement model as ONNX, or PRESET:FILE (zero-dce, zero-dce++, ruas-lol, ruas-upe, retinexformer, darkir, sci,
    /// iat, pairlie, enlightengan); repeatable: each is shown beside raw
    #[arg(long, value_name = "FILE")]
    pub llie: Vec<PathBuf>,
    /// Which dark variants are enhanced: noise, ev, both; default: noise
    #[arg(long, value_name = "noise|ev|both")]
    pub llie_on: Option<String>,
    /// Enhance in tiles of N × N pixels, their seams checked, or whole; default: 256 for images above 1280 × 720 where
    /// sidecar or preset say that tiles are exact, else whole
    #[arg(long, value_name = "N|whole")]
    pub tile: Option<String>,
    /// Enhance images whose longer side is longer than this, in pixels, in that size, and scale the result back (bilinear):
    /// for models that need the whole image and too much memory for it; default: never
    #[arg(long, value_name = "PIXELS")]
    pub llie_max_side: Option<NonZeroUsize>,
    /// Threads of synthesis and enhancement, 1024 at most; default: all cores
    #[arg(long, value_name = "N")]
    pub threads: Option<NonZeroUsize>,
    /// The ONNX Runtime library to load; default: ORT_DYLIB_PATH, else found, else installed once by pip
    #[arg(long, value_name = "FILE")]
    pub ort_lib: Option<PathBuf>,
    /// Never install ONNX Runtime
    #[arg(long)]
    pub offline: bool,
}

/// What is left behind.
#[derive(Debug, Default, Args)]
#[command(next_help_heading = "Output")]
pub struct OutputArgs {
    /// The run folder; default: results/TIME-MODEL-DATA-HASH, found again by the same command
    #[arg(long, value_name = "DIR", conflicts_with = "resume")]
    pub out: Option<PathBuf>,
    /// Go on with the run in this folder; takes the same flags as the run had
    #[arg(long, value_name = "DIR")]
    pub resume: Option<PathBuf>,
    /// Print the summary as JSON instead of a table
    #[arg(long)]
    pub json: bool,
    /// No progress
    #[arg(long)]
    pub quiet: bool,
    /// A TOML file of flags by their long names
    #[arg(long, value_name = "FILE")]
    pub config: Option<PathBuf>,
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::Cli;

    #[test]
    fn the_command_line_is_sound() {
        Cli::command().help_expected(true).debug_assert();
    }
}
