//! Settings that all experiments share: the flags ([`JobArgs`]) and the validated settings ([`JobSettings`]).

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Display;
use std::num::NonZeroU32;
use std::path::{self, Path, PathBuf};
use std::time::Duration;

use clap::Args;
use serde_json::Value;

use super::reply_checks::Continuation;
use crate::costs::{MoneyArgs, MoneySettings};
use crate::image_cache::StoreArgs;
use crate::images::enhancement::enhancers;
use crate::images::enhancement::enhancers::EnhancerRunArgs;
use crate::images::recipes::image_recipe::ImageWords;
use crate::images::trials::check_used;
use crate::models::{AskSettings, AskingArgs, KeyUse, ModelArgs, ModelName, ResolveContext, TextBaseline};
use darkqa_ask::{AccessArgs, ConcurrencyBounds, Constrain, Parameters, RequestArgs, Sending, SettingsOrigin};
use darkqa_base::error::{Error, Result};
use darkqa_base::files::FolderAccess;
use darkqa_base::types::flags::seconds;
use darkqa_base::types::{Decides, SetLight, View};
use darkqa_enhance::{EnhancerArgs, ModelFile};
use darkqa_light::{LightArgs, LightSettings};
use darkqa_pictures::{ImageArgs, PayloadFormat};
use darkqa_runs::batch_system::TaskRange;
use darkqa_runs::outcome::{PrintArgs, RecordTable, StdoutFormat};
use darkqa_runs::resolved_shard::ResolvedShard;
use darkqa_runs::run_plan::RunPlan;
use darkqa_runs::shard::Shard;

/// The flags that every experiment has.
#[derive(Debug, Args)]
pub struct JobArgs {
    /// Levels and kinds of degradation.
    #[command(flatten)]
    pub light: LightArgs,
    /// Enhancers, and the images they are for.
    #[command(flatten)]
    pub enhancers: EnhancerArgs,
    /// Running of the enhancers.
    #[command(flatten)]
    pub loading: EnhancerRunArgs,
    /// Models that are asked.
    #[command(flatten)]
    pub models: ModelArgs,
    /// Parameters of the models.
    #[command(flatten)]
    pub parameters: Parameters,
    /// Fields added to requests or left out.
    #[command(flatten)]
    pub request: RequestArgs,
    /// Endpoint and its key.
    #[command(flatten)]
    pub access: AccessArgs,
    /// Concurrency, timeouts, retries and rate limits.
    #[command(flatten)]
    pub sending: Sending,
    /// Format and size of images.
    #[command(flatten)]
    pub images: ImageArgs,
    /// Limits of cost and failures.
    #[command(flatten)]
    pub money: MoneyArgs,
    /// Shard of this process, and timings.
    #[command(flatten)]
    pub scale: ScaleArgs,
    /// Folder of images that are shared with other runs.
    #[command(flatten)]
    pub stored: StoreArgs,
    /// Run folder and output.
    #[command(flatten)]
    pub output: OutputArgs,
    /// Flags that decide the images, as typed.
    #[arg(skip)]
    pub image_flags: ImageWords,
    /// Long names of the flags on the command line, without flags that variables or files set.
    #[arg(skip)]
    pub typed: BTreeSet<String>,
    /// Long names of the flags that neither the command line nor a variable or file sets.
    #[arg(skip)]
    pub unset: BTreeSet<String>,
    /// Arguments of the command line, without the program name.
    #[arg(skip)]
    pub words: Vec<String>,
}

/// Flags that distribute a job over processes.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Scale")]
pub struct ScaleArgs {
    /// Run shard I of N, split by frames or walks: I/N; auto/N or auto takes the numbers of the batch system (Slurm
    /// arrays, indexed Kubernetes jobs); none runs everything. --rpm, --tpm and --max-cost apply to all shards
    /// together. With another N, replies of earlier shards are copied; default: auto in a Slurm array, else none
    #[arg(long, value_name = "I/N|auto/N|auto|none", add = Decides::Trials)]
    pub shard: Option<String>,
    /// Number of shards that run at once, each with its share of --rpm and --tpm; default: all
    #[arg(long, value_name = "N", add = Decides::Nothing)]
    pub workers: Option<NonZeroU32>,
    /// Seconds that an interrupted run (Ctrl-C, SIGTERM, SIGHUP) waits for requests in flight; choose less than the
    /// grace period of the batch system
    #[arg(long, value_name = "SECONDS", value_parser = seconds, default_value = "120", add = Decides::Nothing)]
    pub grace: Duration,
    /// Print the time of each step, the bottleneck and remedies at the end
    #[arg(long, add = Decides::Nothing)]
    pub timings: bool,
}

/// Flags of the run folder and of the output.
#[derive(Debug, Clone, Default, Args)]
#[command(next_help_heading = "Output")]
pub struct OutputArgs {
    /// Run folder; default: results/TIME-MODEL-DATA-HASH, which the same command finds again
    #[arg(long, value_name = "DIR", conflicts_with = "resume", add = Decides::Nothing)]
    pub out: Option<PathBuf>,
    /// Continue the run in this folder: repeat its flags, with added values to extend it (--profile paper,physical);
    /// default: none
    #[arg(long, value_name = "DIR", add = Decides::Nothing)]
    pub resume: Option<PathBuf>,
    /// Create run and --images-cache folders with the permissions of the umask; default: readable by you only, because
    /// they hold replies and pictures of homes
    #[arg(long, add = Decides::Nothing)]
    pub shared: bool,
    /// How the report is printed.
    #[command(flatten)]
    pub show: PrintArgs,
}

/// Validated settings that all experiments share. Files, environment variables and API keys are read to resolve them,
/// and not later.
#[derive(Debug)]
pub struct JobSettings {
    /// Levels and kinds of degradation.
    pub light: LightSettings,
    /// The light in which the photographs of the data were taken.
    pub set_light: SetLight,
    /// Enhancers, and the images that they enhance.
    pub enhancers: EnhancerArgs,
    /// How the enhancers run.
    pub loading: EnhancerRunArgs,
    /// Models to ask, and their endpoint.
    pub ask: AskSettings,
    /// File format of an image as sent.
    pub format: PayloadFormat,
    /// Longest side of an image as sent, in pixels; `None` for no limit.
    pub max_side: Option<NonZeroU32>,
    /// Bounds of the number of requests in flight.
    pub concurrency: ConcurrencyBounds,
    /// Limits of cost and failures.
    pub money: MoneySettings,
    /// Shard of the run that this process runs.
    pub shard: Shard,
    /// The Slurm array whose tasks do the shards; `None` for shards that the user names.
    pub tasks: Option<TaskRange>,
    /// The longest wait for the requests in flight after an interrupt.
    pub grace: Duration,
    /// Print at the end how long each step took.
    pub show_timings: bool,
    /// Folder of images that are shared with other runs.
    pub images: StoreArgs,
    /// Folder of the run.
    pub place: RunPlace,
    /// Users who may read new folders.
    pub access: FolderAccess,
    /// Format of the results on standard output.
    pub show: StdoutFormat,
    /// Whether the table of records is written.
    pub table: RecordTable,
    /// Flags that decide the images, as typed.
    pub image_flags: ImageWords,
}

/// Settings that only some experiments have.
#[derive(Debug, Default)]
pub struct ExperimentSettings {
    /// Constraint that the server enforces on replies.
    pub constrain: Constrain,
    /// Whether to request the probabilities of choices.
    pub probabilities: bool,
    /// Seed of the server's sampling; `None` if none is sent.
    pub sampling_seed: Option<u64>,
    /// Longest side of an image as sent, in pixels; `None` for no limit.
    pub max_side: Option<NonZeroU32>,
    /// The file or folder of the data; `None` for the built-in rooms.
    pub data: Option<PathBuf>,
    /// Models that are also asked without images.
    pub text_baseline: TextBaseline,
    /// The light in which the photographs of the data were taken.
    pub set_light: SetLight,
}

impl JobSettings {
    /// True if at least one model of the run gets images.
    pub fn shows_images(&self) -> bool {
        self.ask.models.iter().any(|model| model.view == View::Image)
    }

    /// Reads the files of the enhancement models, after a check that the run uses each.
    ///
    /// Opens ONNX Runtime if an enhancer or the model `room-net` needs it, to report a missing library before any slow
    /// step. The folder of an existing run is exempt, because that run may not need the runtime any more.
    pub fn enhancers(&self) -> Result<Vec<ModelFile>> {
        check_used(&self.light, &self.enhancers)?;
        let files = enhancers::read_models(&self.enhancers.llie)?;
        let exists = match &self.place {
            RunPlace::Automatic => false,
            RunPlace::Named(path) | RunPlace::Resume(path) => path.exists(),
        };
        let needs_runtime = !files.is_empty() || self.ask.shows_images_to(&ModelName::RoomNet);
        if needs_runtime && !exists {
            self.loading.runtime.search().open()?;
        }
        Ok(files)
    }

    /// The run in the folder of the command; empty for a new run.
    pub fn continuation(&self) -> Continuation {
        self.place.for_shard(self.shard).continuation()
    }
}

impl JobArgs {
    /// Error for a command line without a model.
    pub fn no_model_error(&self) -> Error {
        let remedy = if self.output.resume.is_some() {
            "--resume takes the same flags as the run had, the model's name among them"
        } else {
            "a model's name at the endpoint, or room-net, observer or random to try without one; it would be asked about 48 built-in rooms from \
             L0 to L5, and --help lists what can be set"
        };
        Error::usage("--model", format_args!("no model is named: {remedy}"))
    }

    /// Request settings of models that no models file configures.
    fn request_defaults(&self, experiment: &ExperimentSettings) -> AskingArgs {
        AskingArgs {
            parameters: Parameters {
                origin: SettingsOrigin {
                    default_temperature: self.unset.contains("temperature"),
                    default_seed: self.unset.contains("sampling-seed"),
                    ..SettingsOrigin::default()
                },
                ..self.parameters.clone()
            },
            request: self.request.clone(),
            access: self.access.clone(),
            sending: self.sending,
            constrain: experiment.constrain,
            seed: experiment.sampling_seed,
            probabilities: experiment.probabilities,
            reply_headers: Vec::new(),
        }
    }

    /// Checks that each model has an endpoint and the API key that it needs, without sending a request. Returns `NAME
    /// (VIEW)` per model.
    ///
    /// # Errors
    /// [`Error::Usage`] with the invalid flag, variable or file.
    pub fn check_models(&self, experiment: &ExperimentSettings) -> Result<Vec<String>> {
        let context = ResolveContext {
            typed: &self.typed,
            shard: Shard::WHOLE,
            workers: None,
            keys: KeyUse::Needed,
            data: experiment.data.as_deref(),
            text_baseline: experiment.text_baseline,
        };
        let defaults = self.request_defaults(experiment);
        let settings = AskSettings::resolve(&self.models, &defaults, context)?;
        Ok(settings.models.iter().map(|model| format!("{} ({})", model.name, model.view)).collect())
    }

    /// Validates the flags, and reads the files and environment variables that they name.
    ///
    /// # Errors
    /// [`Error::Usage`] with the invalid flag.
    pub fn resolve(self, experiment: &ExperimentSettings) -> Result<JobSettings> {
        let place = RunPlace::from(self.output.clone());
        let ResolvedShard { shard, tasks } =
            ResolvedShard::resolve(self.scale.shard.as_deref(), |name| std::env::var(name).ok(), place.folder())?;
        let defaults = self.request_defaults(experiment);
        let context = ResolveContext {
            typed: &self.typed,
            shard,
            workers: self.scale.workers,
            keys: if self.money.dry_run { KeyUse::NotNeeded } else { KeyUse::Needed },
            data: experiment.data.as_deref(),
            text_baseline: experiment.text_baseline,
        };
        let mut ask = AskSettings::resolve(&self.models, &defaults, context)?;
        let place = place.check_writable()?;
        ask.continue_from(&place.for_shard(shard).continuation());
        Ok(JobSettings {
            light: LightSettings::resolve(&self.light, experiment.set_light)?,
            set_light: experiment.set_light,
            ask,
            enhancers: self.enhancers.for_set(experiment.set_light),
            loading: self.loading,
            format: self.images.image,
            max_side: experiment.max_side,
            concurrency: self.sending.concurrency,
            money: MoneySettings::resolve(&self.money, shard, &place.for_shard(shard).settings())?,
            shard,
            tasks,
            grace: self.scale.grace,
            show_timings: self.scale.timings,
            images: self.stored,
            show: self.output.show.format(),
            table: self.output.show.record_table(),
            access: FolderAccess::new(self.output.shared),
            place,
            image_flags: self.image_flags,
        })
    }
}

/// Default parent folder of run folders.
pub const RESULTS: &str = "results";

/// Choice of the run folder.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum RunPlace {
    /// The folder of an earlier run of the same command, or a new folder.
    Automatic,
    /// This folder, new or existing.
    Named(PathBuf),
    /// This folder, which must contain a run.
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
    /// The named folder.
    fn folder(&self) -> Option<&Path> {
        match self {
            Self::Named(folder) | Self::Resume(folder) => Some(folder),
            Self::Automatic => None,
        }
    }

    /// Reads the plan in the named folder; `None` if no folder is named, or if it has no plan.
    ///
    /// # Errors
    /// See [`RunPlan::read`].
    pub fn plan(&self) -> Result<Option<RunPlan>> {
        self.folder().map_or(Ok(None), RunPlan::read)
    }

    /// The run in the named folder. Empty without a run, or if the manifest cannot be read: opening the folder reports
    /// that error.
    fn continuation(&self) -> Continuation {
        Continuation {
            columns: self.read_or_default(darkqa_store::read_columns),
            settings: self.settings(),
            folder: self.folder().map(Path::to_owned),
        }
    }

    /// Settings in the manifest of the named folder; empty in the same cases as [`continuation`](Self::continuation).
    fn settings(&self) -> BTreeMap<String, Value> {
        self.read_or_default(darkqa_store::read_settings)
    }

    /// Reads the manifest of the named folder; the default if no folder is named or reading fails.
    fn read_or_default<T: Default>(&self, read_manifest: fn(&Path) -> Result<T>) -> T {
        let read = self.folder().map(|folder| read_manifest(folder).ok());
        read.flatten().unwrap_or_default()
    }

    /// Returns the choice if its folder is writable. The check runs before images are made, so that an error costs no
    /// time.
    ///
    /// # Errors
    /// [`Error::Usage`] if a folder to resume is missing, or if the folder is not writable.
    fn check_writable(self) -> Result<Self> {
        let (flag, path) = match &self {
            Self::Automatic => ("--out", Path::new(RESULTS)),
            Self::Named(path) => ("--out", path.as_path()),
            Self::Resume(path) if path.is_dir() => ("--resume", path.as_path()),
            Self::Resume(path) => {
                let path = path.display();
                let remedy = "it must hold a run, and --out DIR begins a new one";
                let problem = format_args!("{path}: no such folder; {remedy}");
                return Err(Error::usage("--resume", problem));
            }
        };
        let absolute = path::absolute(path).map_err(|e| not_writable(flag, path, &e))?;
        let existing = absolute.ancestors().find(|folder| folder.exists()).unwrap_or(&absolute);
        // An unnamed temporary file, which the system deletes when it is closed.
        tempfile::tempfile_in(existing).map_err(|e| not_writable(flag, existing, &e))?;
        Ok(self)
    }

    /// Choice for a shard: a subfolder of the folder of the whole run.
    #[must_use]
    pub fn for_shard(&self, shard: Shard) -> Self {
        match self {
            Self::Named(path) if shard.is_part() => Self::Named(path.join(shard.folder())),
            Self::Resume(path) if shard.is_part() => Self::Resume(path.join(shard.folder())),
            place => place.clone(),
        }
    }
}

fn not_writable(flag: &str, folder: &Path, e: &dyn Display) -> Error {
    let folder = folder.display();
    let remedy = "--out DIR names another folder";
    Error::usage(flag, format_args!("cannot write to {folder}: {e}; {remedy}"))
}
