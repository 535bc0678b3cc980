//! Everything a run is told, checked once; nothing later reads the world again.

mod asking;
mod batch;
mod enhance;
mod export;
mod import;
mod layers;
mod light;
mod merge;
mod money;
mod openeqa;
mod questions;
mod realism;
mod report;
mod rooms;
mod serve;
mod shard;
mod show;
mod showing;
mod study;
mod synthesize;

use std::env;
use std::num::{NonZeroU32, NonZeroU64, NonZeroUsize};
use std::path::PathBuf;
use std::str::FromStr;
use std::time::Duration;

pub use asking::{Ask, ModelName, Server};
pub use batch::{BatchExport, BatchFiles, BatchImport};
pub use enhance::Enhance;
pub use export::{Export, Form};
pub use import::Import;
pub use layers::{merge, one_line};
pub use light::{Light, Sensor};
pub use merge::{Merge, Missing};
pub use money::Money;
pub use openeqa::{AnswersFile, CameraOf, Chosen, Darkened, Judge, OpenEqa, OpenTask, Walk};
pub use questions::{Questions, Strangers};
pub use realism::{PairPlace, Realism};
pub use report::{Readings, Report};
pub use rooms::MakeRooms;
pub use serve::Serve;
pub use shard::Shard;
pub use show::{Again, Pictures, Recipe, ShowItem};
pub use showing::{Order, Rotations, Showing};
pub use study::{StudyPack, StudyRead};
pub use synthesize::{Existing, Product, Synthesize};

use crate::ask::{Bounds, Format};
use crate::cli::{DataArgs, EnhancementArgs, EvaluateArgs, OutputArgs, SendingArgs};
use crate::dataset::picture::MOST_PIXELS;
use crate::dataset::{Place, Rooms};
use crate::enhance::{Install, RuntimeSearch, Tiling};
use crate::error::{Error, Result};
use crate::types::{Family, KindSet};

/// The most threads that can be asked for: more than any machine has use for, fewer than stop one.
const MOST_THREADS: usize = 1024;

/// A whole evaluation.
#[derive(Debug)]
pub struct Config {
    /// Which images and questions.
    pub data: Data,
    /// In which order choices are shown, and how often.
    pub showing: Showing,
    /// What it shares with every other experiment.
    pub job: JobSettings,
}

/// The settings that every experiment has.
#[derive(Debug)]
pub struct JobSettings {
    /// How dark.
    pub light: Light,
    /// What enhances the images.
    pub enhancement: Enhancement,
    /// Who is asked.
    pub ask: Ask,
    /// How images are sent.
    pub images: Images,
    /// How much at once, and when to give up.
    pub pace: Pace,
    /// What it may cost.
    pub money: Money,
    /// Whether anything is sent.
    pub mode: Mode,
    /// Which part of it this is.
    pub shard: Shard,
    /// Print at the end how long each step took.
    pub show_timings: bool,
    /// What is left behind.
    pub output: Output,
    /// What decides the images, as it was said.
    pub recipe: Recipe,
}

/// Which images and questions.
#[derive(Debug)]
pub struct Data {
    /// Where they are.
    pub place: Place,
    /// The questions, where they are not beside the images.
    pub questions: Option<PathBuf>,
    /// Only the first so many questions.
    pub limit: Option<NonZeroUsize>,
    /// Only these families.
    pub families: Option<Vec<Family>>,
    /// The most pixels an image may have.
    pub most_pixels: u64,
}

/// What mends the images.
#[derive(Debug)]
pub struct Enhancement {
    /// The ONNX files.
    pub models: Vec<PathBuf>,
    /// The variants that are mended.
    pub on: KindSet,
    /// How images are cut.
    pub tiling: Tiling,
    /// The longest side of an image that is enhanced in its own size; `None` for any.
    pub most_side: Option<NonZeroUsize>,
    /// Threads of synthesis and enhancement; `None` for all cores.
    pub threads: Option<NonZeroUsize>,
    /// Where ONNX Runtime is looked for.
    pub runtime: RuntimeSearch,
}

/// How images are sent.
#[derive(Debug)]
pub struct Images {
    /// The file format.
    pub format: Format,
    /// The longest side; `None` for as they are.
    pub max_side: Option<NonZeroU32>,
    /// The largest file in bytes; `None` for what is known of the endpoint.
    pub largest: Option<usize>,
}

/// How much at once, and when to give up.
#[derive(Debug)]
pub struct Pace {
    /// Requests in flight at once.
    pub concurrency: Bounds,
    /// So many failed trials end the run.
    pub max_failures: Option<usize>,
}

/// Whether anything is sent.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mode {
    /// Ask what is left.
    Run,
    /// Say what that would take, and send nothing.
    DryRun,
}

/// Where the run is kept.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum RunPlace {
    /// The folder of the same command, else a new one.
    Automatic,
    /// This folder.
    Named(PathBuf),
    /// This folder, which must hold a run.
    Resume(PathBuf),
}

impl RunPlace {
    /// Where a part of a run is kept: in a folder of its own within that of the whole.
    #[must_use]
    pub fn of(&self, shard: Shard) -> Self {
        match self {
            Self::Named(path) if shard.is_part() => Self::Named(path.join(shard.folder())),
            Self::Resume(path) if shard.is_part() => Self::Resume(path.join(shard.folder())),
            place => place.clone(),
        }
    }
}

/// What standard output gets.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Show {
    /// A table.
    Table,
    /// The summary as JSON.
    Json,
}

impl Show {
    pub(crate) fn said(json: bool) -> Self {
        if json { Self::Json } else { Self::Table }
    }
}

/// What is left behind.
#[derive(Debug)]
pub struct Output {
    /// Where.
    pub place: RunPlace,
    /// In what form on standard output.
    pub show: Show,
}

impl Config {
    /// Checks what was said by flags, environment and file (see [`merge`]), and fills in the defaults.
    ///
    /// The variables that other programs use, too (`OPENAI_BASE_URL`, `OPENAI_API_KEY`, `ORT_DYLIB_PATH`), are among
    /// the defaults. A variable that begins as ours do and sets nothing is warned of.
    ///
    /// # Errors
    /// [`Error::Usage`] with the flag that cannot be used.
    pub fn resolve(said: EvaluateArgs) -> Result<Self> {
        layers::warn_of_strangers();
        if said.model.model.is_empty() && said.model.blind_model.is_empty() {
            return Err(nameless(&said.output));
        }
        let shard = Shard::said(said.scale.shard.as_deref(), |name| env::var(name).ok())?;
        let light = Light::resolve(&said.light, &said.sensor)?;
        let recipe = show::recipe(&said)?;
        Ok(Self {
            showing: Showing::said(&said.data, light.sensor.seed),
            data: data(said.data)?,
            job: JobSettings {
                shard,
                show_timings: said.scale.timings,
                recipe,
                light,
                enhancement: enhancement(said.enhancement)?,
                ask: asking::ask(said.model, &said.sending, shard)?,
                images: images(&said.sending)?,
                pace: pace(&said.sending)?,
                money: Money::said(&said.sending, shard)?,
                mode: Mode::said(said.sending.dry_run),
                output: output(said.output),
            },
        })
    }
}

impl Mode {
    fn said(dry_run: bool) -> Self {
        if dry_run { Self::DryRun } else { Self::Run }
    }
}

fn nameless(output: &OutputArgs) -> Error {
    let mend = if output.resume.is_some() {
        "--resume takes the same flags as the run had, the model's name among them"
    } else {
        "a model's name at the endpoint, or observer or random to try without one"
    };
    Error::usage("--model", format_args!("no model is named: {mend}"))
}

fn images(said: &SendingArgs) -> Result<Images> {
    Ok(Images {
        format: parsed("--image", said.image.as_deref())?.unwrap_or(Format::Png),
        max_side: said.max_side,
        largest: positive("--max-image", said.max_image)?
            .map(|megabytes| (megabytes * 1e6) as usize),
    })
}

fn data(said: DataArgs) -> Result<Data> {
    let families = said.families.map(|list| {
        list.split(',')
            .map(|name| Family::from(name.trim()))
            .collect()
    });
    Ok(Data {
        place: place(said.data)?,
        questions: said.questions,
        limit: said.limit,
        families,
        most_pixels: most_pixels(said.max_pixels),
    })
}

/// Where the data are: a path, `rooms` or `rooms:frames=48,seed=7,size=1280x720`.
fn place(said: Option<PathBuf>) -> Result<Place> {
    let Some(path) = said else {
        return Ok(Place::Rooms(Rooms::default()));
    };
    match path.to_str() {
        Some("rooms") if !path.exists() => Ok(Place::Rooms(Rooms::default())),
        Some(text) if text.starts_with("rooms:") => text["rooms:".len()..]
            .parse()
            .map(Place::Rooms)
            .map_err(|e: Error| e.at("--data")),
        _ => Ok(Place::Path(path)),
    }
}

fn enhancement(said: EnhancementArgs) -> Result<Enhancement> {
    // ORT_DYLIB_PATH is the variable of the `ort` crate.
    let library = said.ort_lib.or_else(|| {
        env::var_os("ORT_DYLIB_PATH")
            .filter(|path| !path.is_empty())
            .map(PathBuf::from)
    });
    Ok(Enhancement {
        models: said.llie,
        on: parsed("--llie-on", said.llie_on.as_deref())?.unwrap_or(KindSet::NOISE),
        tiling: tiling(said.tile.as_deref())?,
        most_side: said.llie_max_side,
        threads: threads(said.threads)?,
        runtime: RuntimeSearch {
            library,
            install: if said.offline {
                Install::Offline
            } else {
                Install::Allowed
            },
        },
    })
}

/// How images are cut for an enhancer: `256`, `whole`.
fn tiling(said: Option<&str>) -> Result<Tiling> {
    match said {
        None => Ok(Tiling::Auto),
        Some("whole") => Ok(Tiling::Whole),
        Some(side) => side.parse().map(Tiling::Of).map_err(|_| {
            let problem = format_args!("{side:?}; a side in pixels or whole expected");
            Error::usage("--tile", problem)
        }),
    }
}

fn most_pixels(said: Option<NonZeroU64>) -> u64 {
    said.map_or(MOST_PIXELS, NonZeroU64::get)
}

fn threads(said: Option<NonZeroUsize>) -> Result<Option<NonZeroUsize>> {
    match said {
        Some(n) if n.get() > MOST_THREADS => Err(Error::usage(
            "--threads",
            format_args!("{n} are too many; {MOST_THREADS} at most"),
        )),
        _ => Ok(said),
    }
}

fn pace(said: &SendingArgs) -> Result<Pace> {
    Ok(Pace {
        concurrency: asking::concurrency(said)?,
        max_failures: said.max_failures.map(NonZeroUsize::get),
    })
}

fn positive(flag: &str, said: Option<f64>) -> Result<Option<f64>> {
    match said {
        Some(value) if !(value.is_finite() && value > 0.0) => Err(Error::usage(
            flag,
            format_args!("{value} is no number above 0"),
        )),
        _ => Ok(said),
    }
}

fn output(said: OutputArgs) -> Output {
    let place = match (said.out, said.resume) {
        (Some(path), _) => RunPlace::Named(path),
        (None, Some(path)) => RunPlace::Resume(path),
        (None, None) => RunPlace::Automatic,
    };
    Output {
        place,
        show: Show::said(said.json),
    }
}

fn parsed<T: FromStr<Err = Error>>(flag: &str, text: Option<&str>) -> Result<Option<T>> {
    text.map(|text| text.parse().map_err(|e: Error| e.at(flag)))
        .transpose()
}

fn seconds(flag: &str, said: Option<f64>) -> Result<Option<Duration>> {
    said.map(|seconds| {
        let duration = Duration::try_from_secs_f64(seconds)
            .ok()
            .filter(|duration| !duration.is_zero());
        duration.ok_or_else(|| {
            Error::usage(
                flag,
                format_args!("{seconds} is no number of seconds above 0"),
            )
        })
    })
    .transpose()
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;
    use crate::cli::Cli;

    fn resolve(words: &[&str]) -> Result<Config> {
        let cli = Cli::try_parse_from(std::iter::once(&"darkqa-eval").chain(words)).unwrap();
        Config::resolve(merge(cli.evaluate)?)
    }

    #[test]
    fn what_makes_no_sense_names_its_flag() {
        for (words, says) in [
            (vec![], "--model: no model is named"),
            (vec!["--model", ""], "--model: the name"),
            (
                vec!["--model", "random", "--variant", "dark"],
                "--variant: \"dark\" is none of",
            ),
            (vec!["--model", "random", "--gain=-1"], "--gain: "),
            (
                vec!["--model", "random", "--tone", "late"],
                "--tone: \"late\" is none of",
            ),
            (
                vec!["--model", "random", "--camera", "leica"],
                "--camera: \"leica\" is none of sony-a7s2",
            ),
            (
                vec!["--model", "random", "--profile", "physical", "--ratio", "9"],
                "--ratio: with --coupling photon",
            ),
            (
                vec!["--model", "random", "--temperature", "warm"],
                "--temperature: \"warm\"",
            ),
            (
                vec![
                    "--model",
                    "m",
                    "--base-url",
                    "http://127.0.0.1:1/v1",
                    "--timeout=-2",
                ],
                "--timeout: -2",
            ),
            (
                vec!["--model", "m", "--base-url", "ftp://x"],
                "--base-url: ",
            ),
            (
                vec!["--model", "m", "--api-key-env", "DARKQA_NO_SUCH_VARIABLE"],
                "--api-key-env: the variable",
            ),
        ] {
            let error = resolve(&words).unwrap_err().to_string();
            assert!(error.starts_with(says), "{words:?}: {error}");
        }
    }

    #[test]
    fn built_in_models_need_no_endpoint() {
        let config = resolve(&["--model", "random", "--blind-model", "script:a.jsonl"]).unwrap();
        assert!(config.job.ask.server.is_none());
        assert_eq!(
            config.job.ask.blind_models,
            [ModelName::Script("a.jsonl".into())]
        );
    }
}
