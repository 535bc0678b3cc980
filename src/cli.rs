//! The command line: exactly what the user typed, nothing checked against the world and nothing filled in.
//!
//! The same structure is read three times: from the arguments, from `DARKQA_*` variables and from a `--config` file
//! (see [`crate::config`]); so every field is an `Option`, a list or a switch, and no default stands here.

use std::num::{NonZeroU32, NonZeroUsize};
use std::path::PathBuf;

use clap::{Args, Parser};

/// Measures how well a vision-language model sees in the dark.
///
/// Makes low-light versions of indoor images (levels L0–L5: 0, 2, 4, 6, 7.5, 9 EV darker; by exposure drop alone and
/// with sensor noise), mends them with any enhancement model given as ONNX, asks OpenAI-compatible endpoints
/// multiple-choice questions about each image, and scores the replies by exact match.
///
/// The same command run again goes on where it stopped: what was answered is never asked again.
#[derive(Debug, Parser)]
#[command(name = "darkqa-eval", version, about, long_about, max_term_width = 110, after_help = AFTER_HELP)]
pub struct Cli {
    /// What to evaluate, and how.
    #[command(flatten)]
    pub evaluate: EvaluateArgs,
}

const AFTER_HELP: &str = "\
Precedence: flag, then environment (DARKQA_CONCURRENCY=16 for --concurrency 16), then --config FILE, then default.
OPENAI_BASE_URL, OPENAI_API_KEY and ORT_DYLIB_PATH are defaults: whatever names another goes before them.
Exit codes: 0 everything scored; 1 finished with failures; 2 usage, configuration or a fatal error; 130 interrupted.
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
    /// Enhancement.
    #[command(flatten)]
    pub enhancement: EnhancementArgs,
    /// Model.
    #[command(flatten)]
    pub model: ModelArgs,
    /// Sending.
    #[command(flatten)]
    pub sending: SendingArgs,
    /// Output.
    #[command(flatten)]
    pub output: OutputArgs,
}

/// Which images and questions.
#[derive(Debug, Default, Args)]
#[command(next_help_heading = "Data")]
pub struct DataArgs {
    /// A folder of frames, or a ready-made set (.tsv, .jsonl); default: small built-in rooms
    #[arg(long, value_name = "DIR|FILE")]
    pub data: Option<PathBuf>,
    /// The questions about a folder of frames; default: questions.jsonl in it
    #[arg(long, value_name = "FILE")]
    pub questions: Option<PathBuf>,
    /// Only the first N questions
    #[arg(long, value_name = "N")]
    pub limit: Option<NonZeroUsize>,
    /// Only these question families (or categories of a ready-made set), separated by commas
    #[arg(long, value_name = "LIST")]
    pub families: Option<String>,
}

/// How dark.
#[derive(Debug, Default, Args)]
#[command(next_help_heading = "Light")]
pub struct LightArgs {
    /// Levels, as L0-L5 or L0,L3; default: L0-L5
    #[arg(long, value_name = "LEVELS")]
    pub levels: Option<String>,
    /// Which of the paired variants: ev (exposure drop alone), noise (with sensor noise), both; default: both
    ///
    /// Sensor noise follows the wording of the DarkQA paper: the light ratio attenuates and amplifies the shot noise,
    /// and read, row and quantisation noise act after it.
    #[arg(long, value_name = "ev|noise|both")]
    pub variant: Option<String>,
    /// The seed of all random draws; default: 0
    #[arg(long, value_name = "N")]
    pub seed: Option<u64>,
    /// Pin the system gain K of the sensor, in ADU per electron; default: log-uniform in 0.1–6 for each image
    #[arg(long, value_name = "K")]
    pub gain: Option<f64>,
    /// Pin the light ratio r of the sensor noise; default: uniform in 100–300 for each image
    #[arg(long, value_name = "R")]
    pub ratio: Option<f64>,
}

/// What mends the images.
#[derive(Debug, Default, Args)]
#[command(next_help_heading = "Enhancement")]
pub struct EnhancementArgs {
    /// An enhancement model as ONNX (RGB, 0–1, NCHW); repeatable: each is shown beside raw
    #[arg(long, value_name = "FILE")]
    pub llie: Vec<PathBuf>,
    /// Which dark variants are enhanced: noise, ev, both; default: noise
    #[arg(long, value_name = "noise|ev|both")]
    pub llie_on: Option<String>,
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

/// Who is asked.
#[derive(Debug, Default, Args)]
#[command(next_help_heading = "Model")]
pub struct ModelArgs {
    /// The model to ask, by its name at the endpoint; repeatable; built in: random, script:FILE
    #[arg(long, value_name = "NAME")]
    pub model: Vec<String>,
    /// Show the models no image: words alone
    #[arg(long)]
    pub blind: bool,
    /// Add a text-only baseline by this model; repeatable
    #[arg(long, value_name = "NAME")]
    pub blind_model: Vec<String>,
    /// The endpoint; /chat/completions is appended; default: OPENAI_BASE_URL, else OpenAI's own
    #[arg(long, value_name = "URL")]
    pub base_url: Option<String>,
    /// The variable that holds the API key, or none for an endpoint without keys; default: OPENAI_API_KEY
    #[arg(long, value_name = "NAME|none", conflicts_with = "api_key_file")]
    pub api_key_env: Option<String>,
    /// A file that holds the API key
    #[arg(long, value_name = "FILE")]
    pub api_key_file: Option<PathBuf>,
    /// Send a key over unencrypted http to another machine
    #[arg(long)]
    pub allow_http: bool,
    /// Sampling temperature, or default for the server's own; default: 0
    #[arg(long, value_name = "T|default")]
    pub temperature: Option<String>,
    /// The most tokens of a reply, hidden reasoning included; default: 1024
    #[arg(long, value_name = "N")]
    pub max_tokens: Option<NonZeroU32>,
    /// The field that carries it: max_tokens, max_completion_tokens, none, or auto by endpoint; default: auto
    #[arg(long, value_name = "FIELD")]
    pub token_field: Option<String>,
    /// How long a reasoning model thinks, in the server's words (none, minimal, low, medium, high …)
    #[arg(long, value_name = "EFFORT")]
    pub reasoning_effort: Option<String>,
    /// How closely the server looks at images: auto, low, high; default: not sent
    #[arg(long, value_name = "DETAIL")]
    pub detail: Option<String>,
    /// A folder with prompts of your own (choice.txt, blind.txt); default: built in
    #[arg(long, value_name = "DIR")]
    pub prompts: Option<PathBuf>,
}

/// How it is sent.
#[derive(Debug, Default, Args)]
#[command(next_help_heading = "Sending")]
pub struct SendingArgs {
    /// Requests in flight at once; default: 8
    #[arg(long, value_name = "N")]
    pub concurrency: Option<NonZeroUsize>,
    /// Seconds until a try is given up, reply included; default: 120
    #[arg(long, value_name = "SECONDS")]
    pub timeout: Option<f64>,
    /// Further tries after a failure that may pass; default: 5
    #[arg(long, value_name = "N")]
    pub retries: Option<u32>,
    /// The longest wait, in seconds, that a server may ask for; default: 120
    #[arg(long, value_name = "SECONDS")]
    pub max_wait: Option<f64>,
    /// How images are sent: png (lossless) or jpeg:QUALITY; default: png
    #[arg(long, value_name = "FORMAT")]
    pub image: Option<String>,
    /// Shrink images whose longer side is longer than this, in pixels; default: never
    #[arg(long, value_name = "PIXELS")]
    pub max_side: Option<NonZeroU32>,
    /// Stop when this many trials have failed; default: never
    #[arg(long, value_name = "N")]
    pub max_failures: Option<NonZeroUsize>,
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
