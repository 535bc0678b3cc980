//! The settings that every experiment has: as flags say them ([`JobArgs`]), and as they are used ([`JobSettings`]).

use std::num::NonZeroU32;
use std::path::PathBuf;

use clap::Args;

use super::enhancers::{self, EnhancerRunArgs};
use super::image_words::ImageWords;
use super::models::{AskSettings, ModelArgs};
use super::money::{MoneyArgs, MoneySettings};
use super::outcome::StdoutFormat;
use super::shard::Shard;
use crate::ask::{AccessArgs, Bounds, Constrain, ImageArgs, Parameters, PayloadFormat, Sending};
use crate::enhance::{EnhancerArgs, ModelFile};
use crate::error::{Error, Result};
use crate::synthesis::{LightArgs, LightSettings};
use crate::types::Decides;
use crate::types::View;

/// The flags that every experiment has.
#[derive(Debug, Args)]
pub(crate) struct JobArgs {
    /// Light.
    #[command(flatten)]
    pub light: LightArgs,
    /// Which images are enhanced, and by what.
    #[command(flatten)]
    pub enhancers: EnhancerArgs,
    /// How enhancers are run.
    #[command(flatten)]
    pub loading: EnhancerRunArgs,
    /// Who is asked.
    #[command(flatten)]
    pub models: ModelArgs,
    /// How the models are to speak.
    #[command(flatten)]
    pub parameters: Parameters,
    /// Where they are asked.
    #[command(flatten)]
    pub access: AccessArgs,
    /// How requests are sent.
    #[command(flatten)]
    pub sending: Sending,
    /// How images are sent.
    #[command(flatten)]
    pub images: ImageArgs,
    /// What it may cost.
    #[command(flatten)]
    pub money: MoneyArgs,
    /// How it is spread over processes.
    #[command(flatten)]
    pub scale: ScaleArgs,
    /// What is left behind.
    #[command(flatten)]
    pub output: OutputArgs,
    /// The flags that decide the images, as they were said.
    #[arg(skip)]
    pub pictures: ImageWords,
}

/// How a job is spread over processes.
#[derive(Debug, Clone, Default, Args)]
#[command(next_help_heading = "Scale")]
pub(crate) struct ScaleArgs {
    /// Do one of N parts, by frames or walks: I/N; auto/N or auto as the batch system says (Slurm arrays, indexed Kubernetes jobs);
    /// none for everything. --rpm, --tpm and --max-cost are for all parts together; default: auto in a Slurm array, else none
    #[arg(long, value_name = "I/N|auto/N|auto|none", add = Decides::Trials)]
    pub shard: Option<String>,
    /// Say at the end where the time went, what binds and what would help
    #[arg(long, add = Decides::Nothing)]
    pub timings: bool,
}

/// What is left behind.
#[derive(Debug, Clone, Default, Args)]
#[command(next_help_heading = "Output")]
pub(crate) struct OutputArgs {
    /// The run folder; default: results/TIME-MODEL-DATA-HASH, found again by the same command
    #[arg(long, value_name = "DIR", conflicts_with = "resume", add = Decides::Nothing)]
    pub out: Option<PathBuf>,
    /// Go on with the run in this folder; takes the same flags as the run had; default: none
    #[arg(long, value_name = "DIR", add = Decides::Nothing)]
    pub resume: Option<PathBuf>,
    /// Print the summary as JSON instead of a table
    #[arg(long, add = Decides::Nothing)]
    pub json: bool,
}

/// The settings that every experiment has, validated. Files, environment and keys are read when they are made, and nowhere later.
#[derive(Debug)]
pub(crate) struct JobSettings {
    /// What is done to frames.
    pub light: LightSettings,
    /// Which images are enhanced, and by what.
    pub enhancers: EnhancerArgs,
    /// How enhancers are run.
    pub loading: EnhancerRunArgs,
    /// Who is asked.
    pub ask: AskSettings,
    /// The file format of images.
    pub format: PayloadFormat,
    /// The longest side of an image as sent, in pixels; `None` for as it is.
    pub max_side: Option<NonZeroU32>,
    /// The largest file of an image in bytes; `None` for what is known of the endpoint.
    pub max_image: Option<usize>,
    /// How many requests are in flight at once.
    pub concurrency: Bounds,
    /// What it may cost.
    pub money: MoneySettings,
    /// Which part of the whole this is.
    pub shard: Shard,
    /// Print at the end how long each step took.
    pub show_timings: bool,
    /// Where the run is kept.
    pub place: RunPlace,
    /// What standard output gets.
    pub show: StdoutFormat,
    /// The flags that decide the images, as they were said.
    pub pictures: ImageWords,
}

/// What one experiment has of the settings of models and others have not.
#[derive(Debug, Default)]
pub(crate) struct ExperimentSettings {
    /// What the server lets the model say.
    pub constrain: Constrain,
    /// What the server's sampling starts from.
    pub sampling_seed: Option<u64>,
    /// The longest side of an image as sent, in pixels.
    pub max_side: Option<NonZeroU32>,
}

impl JobSettings {
    /// Whether a model of the run is shown images.
    pub(crate) fn shows_images(&self) -> bool {
        self.ask.view == View::Image && !self.ask.models.is_empty()
    }

    /// The enhancement models' files, read, and ONNX Runtime found: before anything that takes time. A run that is there already may
    /// need no runtime any more.
    pub(crate) fn enhancers(&self) -> Result<Vec<ModelFile>> {
        let files = enhancers::read(&self.enhancers.llie)?;
        let is_there = match &self.place {
            RunPlace::Automatic => false,
            RunPlace::Named(path) | RunPlace::Resume(path) => path.exists(),
        };
        if !files.is_empty() && !is_there {
            self.loading.runtime.search().open()?;
        }
        Ok(files)
    }
}

impl JobArgs {
    /// The error for a call that names no model.
    pub(crate) fn nameless(&self) -> Error {
        let remedy = if self.output.resume.is_some() {
            "--resume takes the same flags as the run had, the model's name among them"
        } else {
            "a model's name at the endpoint, or observer or random to try without one; it would be asked about 48 built-in rooms from \
             L0 to L5, and --help lists what can be set"
        };
        Error::usage("--model", format_args!("no model is named: {remedy}"))
    }

    /// Looks at the files and variables that the flags name.
    ///
    /// # Errors
    /// [`Error::Usage`] with the flag that cannot be used.
    pub(crate) fn resolve(self, own: &ExperimentSettings) -> Result<JobSettings> {
        let shard = Shard::resolve(self.scale.shard.as_deref(), |name| std::env::var(name).ok())?;
        let sending = Sending {
            quota: shard.quota(self.sending.quota),
            ..self.sending
        };
        let parameters = Parameters {
            constrain: own.constrain,
            seed: own.sampling_seed,
            ..self.parameters
        };
        // A dry run sends nothing, so it needs no key.
        let access = if self.money.dry_run {
            self.access.without_key()
        } else {
            self.access
        };
        Ok(JobSettings {
            light: LightSettings::resolve(&self.light)?,
            ask: AskSettings::resolve(self.models, parameters, &access, sending)?,
            enhancers: self.enhancers,
            loading: self.loading,
            format: self.images.image,
            max_side: own.max_side,
            max_image: sending
                .max_image
                .map(|megabytes| (megabytes * 1e6) as usize),
            concurrency: sending.concurrency,
            money: MoneySettings::resolve(&self.money, shard)?,
            shard,
            show_timings: self.scale.timings,
            show: StdoutFormat::of(self.output.json),
            place: RunPlace::from(self.output),
            pictures: self.pictures,
        })
    }
}

/// Where the run is kept.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum RunPlace {
    /// The folder of the same command, else a new one.
    Automatic,
    /// This folder.
    Named(PathBuf),
    /// This folder, which must hold a run.
    Resume(PathBuf),
}

impl From<OutputArgs> for RunPlace {
    fn from(args: OutputArgs) -> Self {
        match (args.out, args.resume) {
            (Some(path), _) => Self::Named(path),
            (None, Some(path)) => Self::Resume(path),
            (None, None) => Self::Automatic,
        }
    }
}

impl RunPlace {
    /// Where a part of a run is kept: in a folder of its own within that of the whole.
    #[must_use]
    pub(crate) fn of(&self, shard: Shard) -> Self {
        match self {
            Self::Named(path) if shard.is_part() => Self::Named(path.join(shard.folder())),
            Self::Resume(path) if shard.is_part() => Self::Resume(path.join(shard.folder())),
            place => place.clone(),
        }
    }
}
