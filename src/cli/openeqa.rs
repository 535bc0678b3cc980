//! The flags of `openeqa`.

use std::num::NonZeroUsize;
use std::path::PathBuf;

use clap::{Arg, Args};

use super::{
    BatchFileArgs, EnhancementArgs, LightArgs, ModelArgs, OutputArgs, ScaleArgs, SendingArgs,
    SensorArgs,
};

/// The flags of `openeqa`.
#[derive(Debug, Args)]
pub struct OpenEqaArgs {
    /// The questions, as open-eqa-v0.json
    #[arg(long, value_name = "FILE", help_heading = "OpenEQA")]
    pub questions: PathBuf,
    /// The folder of walks: the frames of a question lie in DIR/EPISODE_HISTORY/*-rgb.png
    #[arg(long, value_name = "DIR", help_heading = "OpenEQA")]
    pub frames: PathBuf,
    /// Only questions of these splits, as hm3d-v0,scannet-v0
    #[arg(long, value_name = "LIST", help_heading = "OpenEQA")]
    pub splits: Option<String>,
    /// Only questions of these categories, as "object localization,world knowledge"
    #[arg(long, value_name = "LIST", help_heading = "OpenEQA")]
    pub categories: Option<String>,
    /// Only the questions whose ids stand in this file, a JSON array, as open-eqa-v0-184-questions.json
    #[arg(long, value_name = "FILE", help_heading = "OpenEQA")]
    pub subset: Option<PathBuf>,
    /// Only the first N questions
    #[arg(long, value_name = "N", help_heading = "OpenEQA")]
    pub limit: Option<NonZeroUsize>,
    /// How many frames of a walk are shown, spread evenly over it; default: 50, as upstream shows GPT-4V (Claude 3: 20,
    /// Gemini: 15)
    #[arg(long, value_name = "K", help_heading = "OpenEQA")]
    pub num_frames: Option<NonZeroUsize>,
    /// The longer side of the frames as sent, in pixels, or native; scaled as upstream does (OpenCV, bilinear); default: 512
    #[arg(long, value_name = "PIXELS|native", help_heading = "OpenEQA")]
    pub image_size: Option<String>,
    /// Where light is taken: before the frames are scaled (native), as a camera would, or after (resized), where the scaling
    /// averages no noise away; default: native
    #[arg(long, value_name = "native|resized", help_heading = "OpenEQA")]
    pub degrade: Option<String>,
    /// Which frames one state of the camera takes: a walk (episode) or each its own (frame); default: episode
    #[arg(long, value_name = "episode|frame", help_heading = "OpenEQA")]
    pub sensor: Option<String>,
    /// What the servers' sampling starts from, or none; default: 1234
    #[arg(long, value_name = "N|none", help_heading = "OpenEQA")]
    pub sampling_seed: Option<String>,
    /// Answers of people or another program, as upstream's files ([{"question_id", "answer"}], with "level" or "condition"
    /// beside them where it is not L0), to be marked like a model's; repeatable
    #[arg(long, value_name = "NAME=FILE", help_heading = "OpenEQA")]
    pub answers: Vec<String>,
    /// The model that marks the answers; default: none, answers are gathered and not marked
    #[arg(long, value_name = "NAME", help_heading = "Judge")]
    pub judge: Option<String>,
    /// How answers are judged and marks read: upstream (answers cut after their last full stop, marks read to the letter) or
    /// tolerant (whole answers, marks read as people would); default: upstream
    #[arg(long, value_name = "upstream|tolerant", help_heading = "Judge")]
    pub protocol: Option<String>,
    /// The judge's endpoint; default: that of the models
    #[arg(long, value_name = "URL", help_heading = "Judge")]
    pub judge_base_url: Option<String>,
    /// The variable that holds the key of the judge's endpoint, or none; default: OPENAI_API_KEY, or without
    /// --judge-base-url that of the models
    #[arg(
        long,
        value_name = "NAME|none",
        help_heading = "Judge",
        conflicts_with = "judge_api_key_file"
    )]
    pub judge_api_key_env: Option<String>,
    /// A file that holds the key of the judge's endpoint
    #[arg(long, value_name = "FILE", help_heading = "Judge")]
    pub judge_api_key_file: Option<PathBuf>,
    /// The judge's sampling temperature; default: 0.2
    #[arg(long, value_name = "T|auto|default", help_heading = "Judge")]
    pub judge_temperature: Option<String>,
    /// The most tokens of a judge's reply; default: 32
    #[arg(long, value_name = "N", help_heading = "Judge")]
    pub judge_max_tokens: Option<std::num::NonZeroU32>,
    /// Write a page on which people answer the questions about the frames into this folder, and ask no model
    #[arg(
        long,
        value_name = "DIR",
        help_heading = "OpenEQA",
        conflicts_with_all = ["batch", "dry_run"]
    )]
    pub study: Option<PathBuf>,
    /// Write what is left to ask as files of a Batch API, answers first and then marks, and ask nothing
    #[arg(long, help_heading = "Batch", conflicts_with = "dry_run")]
    pub batch: bool,
    /// Their files.
    #[command(flatten)]
    pub files: BatchFileArgs,
    /// Light.
    #[command(flatten)]
    pub light: LightArgs,
    /// Light, as a sensor sees it.
    #[command(flatten)]
    pub sensors: SensorArgs,
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

/// Flags that this command shares with an evaluation, with the defaults that they have here; those without a meaning here are not
/// shown.
pub(super) fn own(arg: Arg) -> Arg {
    match arg.get_id().as_str() {
        "constrain" | "prompts" | "max_side" => arg.hide(true),
        "levels" => arg.help("Levels, as L0-L5 or L0,L3; default: L0,L2,L4, as in the paper's table"),
        "variant" => arg.help(
            "Which of the paired variants: ev (exposure drop alone), noise (with sensor noise), both; default: noise",
        ),
        "model" => arg.help(
            "The model to ask, by its name at the endpoint; repeatable; built in: script:FILE",
        ),
        "temperature" => arg.help(
            "Sampling temperature; default for the server's own; auto for 0, or the server's own where the model refuses any other; \
             default: 0.2",
        ),
        "max_tokens" => {
            arg.help("The most tokens of an answer, hidden reasoning included; default: 128")
        }
        "out" => arg.help(
            "The run folder, which models, levels and judges may be added to; default: results/TIME-MODEL-QUESTIONS-HASH, found \
             again by the same command",
        ),
        "resume" => arg.help("Go on with the run in this folder, also at another address of the same models"),
        _ => arg,
    }
}
