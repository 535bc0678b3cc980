//! What `openeqa` is told, checked once: [`OpenEqa`].

use std::fmt;
use std::num::{NonZeroU32, NonZeroUsize};
use std::path::PathBuf;
use std::str::FromStr;

use serde::{Deserialize, Serialize};
use serde_json::json;

use super::asking::ask;
use super::layers::merge;
use super::show;
use super::{
    BatchFiles, JobSettings, Light, Mode, ModelName, Money, Server, Shard, enhancement, images,
    most_pixels, nameless, output, pace, parsed,
};
use crate::ask::Parameters;
use crate::cli::{EvaluateArgs, LightArgs, ModelArgs, OpenEqaArgs, SendingArgs};
use crate::error::{Error, Result};
use crate::score::llm_match::Protocol;

/// The levels of the paper's table, where nobody says otherwise.
const LEVELS: &str = "L0,L2,L4";
/// Its variant.
const VARIANT: &str = "noise";
/// Frames of a walk: upstream's for GPT-4V.
const FRAMES: usize = 50;
/// The longer side of a frame as sent: upstream's `--image-size`.
const SIDE: usize = 512;
/// Upstream's seed, for models and judge.
const SEED: u64 = 1234;
/// Upstream's temperature, for models and judge.
const TEMPERATURE: &str = "0.2";
/// The most tokens of an answer, upstream's.
const ANSWER_TOKENS: NonZeroU32 = NonZeroU32::new(128).unwrap();
/// The most tokens of a mark, upstream's.
const MARK_TOKENS: NonZeroU32 = NonZeroU32::new(32).unwrap();

/// A whole evaluation by open questions.
#[derive(Debug)]
pub struct OpenEqa {
    /// The file of questions.
    pub questions: PathBuf,
    /// Which questions.
    pub chosen: Chosen,
    /// How a walk is shown.
    pub walk: Walk,
    /// Answers of people or other programs.
    pub answers: Vec<AnswersFile>,
    /// Who marks the answers; `None` for nobody.
    pub judge: Option<Judge>,
    /// How answers are judged.
    pub protocol: Protocol,
    /// What is to be done.
    pub task: OpenTask,
    /// What it shares with every other experiment.
    pub job: JobSettings,
}

/// Which questions of a file.
#[derive(Debug, Default)]
pub struct Chosen {
    /// Those of these splits.
    pub splits: Option<Vec<String>>,
    /// Those of these categories.
    pub categories: Option<Vec<String>>,
    /// Those whose ids stand in this file.
    pub subset: Option<PathBuf>,
    /// The first so many of them.
    pub limit: Option<NonZeroUsize>,
}

/// How a walk is shown.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Walk {
    /// The folder of walks.
    pub folder: PathBuf,
    /// How many of its frames.
    pub frames: usize,
    /// Their longer side in pixels; `None` for as they are.
    pub side: Option<usize>,
    /// Where light is taken.
    pub darkened: Darkened,
    /// What one state of the camera takes.
    pub camera: CameraOf,
    /// The most pixels a frame may have.
    pub most_pixels: u64,
}

/// Where light is taken from a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Darkened {
    /// In its own size, as a camera would.
    Native,
    /// After it was scaled: noise is then not averaged by the scaling.
    Resized,
}

/// What one state of the camera takes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum CameraOf {
    /// All frames of a walk: one camera recorded it.
    Episode,
    /// One frame.
    Frame,
}

/// A setting that is one of two words.
macro_rules! either {
    ($kind:ident, $flag:literal: $first:literal = $one:ident, $second:literal = $two:ident) => {
        impl fmt::Display for $kind {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.pad(match self {
                    Self::$one => $first,
                    Self::$two => $second,
                })
            }
        }

        impl FromStr for $kind {
            type Err = Error;

            fn from_str(text: &str) -> Result<Self> {
                match text {
                    $first => Ok(Self::$one),
                    $second => Ok(Self::$two),
                    _ => Err(Error::usage(
                        $flag,
                        format_args!(concat!("{:?} is neither ", $first, " nor ", $second), text),
                    )),
                }
            }
        }
    };
}

either!(Darkened, "--degrade": "native" = Native, "resized" = Resized);
either!(CameraOf, "--sensor": "episode" = Episode, "frame" = Frame);

/// Answers of people or another program.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct AnswersFile {
    /// What they stand under among the models.
    pub name: String,
    /// The file.
    pub path: PathBuf,
}

/// Who marks the answers.
#[derive(Debug)]
pub struct Judge {
    /// The model.
    pub model: ModelName,
    /// Its endpoint; `None` where it is built in.
    pub server: Option<Server>,
    /// How it is to speak; its name is set.
    pub parameters: Parameters,
}

/// What is to be done.
#[derive(Debug)]
pub enum OpenTask {
    /// Ask what is left, or say what that would take.
    Run,
    /// Write it as files of a Batch API.
    Batch(BatchFiles),
    /// Write a page for people.
    Study(PathBuf),
}

impl OpenEqa {
    /// Checks what was said by flags, environment and `--config` file; of the last two, what an evaluation knows as well.
    ///
    /// # Errors
    /// [`Error::Usage`] with the flag that cannot be used.
    pub fn resolve(said: OpenEqaArgs) -> Result<Self> {
        let judge = JudgeArgs::of(&said);
        let walk = Walk::resolve(&said)?;
        let merged = merge(EvaluateArgs {
            light: said.light,
            sensor: said.sensors,
            enhancement: said.enhancement,
            model: said.model,
            sending: said.sending,
            output: said.output,
            scale: said.scale,
            ..EvaluateArgs::default()
        })?;
        refuse(&merged.model, &merged.sending)?;
        let mut recipe = show::recipe(&merged)?;
        let walk = Walk {
            most_pixels: most_pixels(merged.data.max_pixels),
            ..walk
        };
        // What an evaluation's data would be says nothing of walks.
        recipe.remove("data");
        recipe.insert(show::WALK.to_owned(), json!(walk));
        let answers = said.answers.iter().map(|text| answers_file(text));
        let answers: Vec<AnswersFile> = answers.collect::<Result<_>>()?;
        let task = match (said.study, said.batch) {
            (Some(folder), _) => OpenTask::Study(folder),
            (None, true) => OpenTask::Batch(BatchFiles::resolve(said.files)?),
            (None, false) => OpenTask::Run,
        };
        let shard = Shard::said(merged.scale.shard.as_deref(), |name| {
            std::env::var(name).ok()
        })?;
        let nobody = merged.model.model.is_empty() && merged.model.blind_model.is_empty();
        if nobody && answers.is_empty() && !matches!(task, OpenTask::Study(_)) {
            return Err(nameless(&merged.output));
        }
        let light = LightArgs {
            levels: merged.light.levels.or_else(|| Some(LEVELS.to_owned())),
            variant: merged.light.variant.or_else(|| Some(VARIANT.to_owned())),
        };
        let seed = sampling_seed(said.sampling_seed.as_deref())?;
        let judge = judge.resolve(&merged.model, &merged.sending, seed, shard)?;
        let model = ModelArgs {
            temperature: merged
                .model
                .temperature
                .or_else(|| Some(TEMPERATURE.to_owned())),
            max_tokens: merged.model.max_tokens.or(Some(ANSWER_TOKENS)),
            ..merged.model
        };
        let mut ask = ask(model, &merged.sending, shard)?;
        ask.parameters.seed = seed;
        ask.models
            .iter()
            .chain(&ask.blind_models)
            .try_for_each(speaks)?;
        Ok(Self {
            walk,
            questions: said.questions,
            chosen: Chosen {
                splits: said.splits.as_deref().map(list),
                categories: said.categories.as_deref().map(list),
                subset: said.subset,
                limit: said.limit,
            },
            answers,
            judge,
            protocol: parsed("--protocol", said.protocol.as_deref())?.unwrap_or(Protocol::Upstream),
            task,
            job: JobSettings {
                light: Light::resolve(&light, &merged.sensor)?,
                enhancement: enhancement(merged.enhancement)?,
                ask,
                images: images(&merged.sending)?,
                pace: pace(&merged.sending)?,
                money: Money::said(&merged.sending, shard)?,
                mode: Mode::said(merged.sending.dry_run),
                shard,
                show_timings: merged.scale.timings,
                output: output(merged.output),
                recipe,
            },
        })
    }
}

impl Walk {
    fn resolve(said: &OpenEqaArgs) -> Result<Self> {
        Ok(Self {
            folder: said.frames.clone(),
            frames: said.num_frames.map_or(FRAMES, usize::from),
            side: side(said.image_size.as_deref())?,
            darkened: parsed("--degrade", said.degrade.as_deref())?.unwrap_or(Darkened::Native),
            camera: parsed("--sensor", said.sensor.as_deref())?.unwrap_or(CameraOf::Episode),
            most_pixels: most_pixels(None),
        })
    }
}

/// What was said of the judge.
struct JudgeArgs {
    name: Option<String>,
    base_url: Option<String>,
    key_env: Option<String>,
    key_file: Option<PathBuf>,
    temperature: Option<String>,
    max_tokens: Option<NonZeroU32>,
}

impl JudgeArgs {
    fn of(said: &OpenEqaArgs) -> Self {
        Self {
            name: said.judge.clone(),
            base_url: said.judge_base_url.clone(),
            key_env: said.judge_api_key_env.clone(),
            key_file: said.judge_api_key_file.clone(),
            temperature: said.judge_temperature.clone(),
            max_tokens: said.judge_max_tokens,
        }
    }

    fn resolve(
        self,
        models: &ModelArgs,
        sending: &SendingArgs,
        seed: Option<u64>,
        shard: Shard,
    ) -> Result<Option<Judge>> {
        let Some(name) = self.name else {
            return Ok(None);
        };
        // The key of one endpoint is never sent to another.
        let own = self.base_url.is_some() || self.key_env.is_some() || self.key_file.is_some();
        let (key_env, key_file) = if own {
            (self.key_env, self.key_file)
        } else {
            (models.api_key_env.clone(), models.api_key_file.clone())
        };
        let asked = ask(
            ModelArgs {
                model: vec![name],
                base_url: self.base_url.or_else(|| models.base_url.clone()),
                api_key_env: key_env,
                api_key_file: key_file,
                key_header: models.key_header.clone().filter(|_| !own),
                ca_file: models.ca_file.clone(),
                allow_http: models.allow_http,
                temperature: self.temperature.or_else(|| Some(TEMPERATURE.to_owned())),
                max_tokens: self.max_tokens.or(Some(MARK_TOKENS)),
                token_field: models.token_field.clone(),
                ..ModelArgs::default()
            },
            sending,
            shard,
        )
        .map_err(|e| e.at("the judge"))?;
        let Some(model) = asked.models.into_iter().next() else {
            return Ok(None);
        };
        speaks(&model).map_err(|e| e.at("the judge"))?;
        Ok(Some(Judge {
            model,
            server: asked.server,
            parameters: Parameters {
                seed,
                ..asked.parameters
            },
        }))
    }
}

/// Makes sure that a model can answer in words.
fn speaks(model: &ModelName) -> Result<()> {
    let name = match model {
        ModelName::Random => "random",
        ModelName::Observer => "observer",
        ModelName::Script(_) | ModelName::Remote(_) => return Ok(()),
    };
    let problem = format_args!("{name} can only choose, and these questions are open");
    Err(Error::usage("--model", problem))
}

/// Refuses what an evaluation knows and has no meaning here.
fn refuse(model: &ModelArgs, sending: &SendingArgs) -> Result<()> {
    let refused = [
        (
            "--constrain",
            model.constrain.is_some(),
            "these questions are open: there is no letter to constrain a reply to",
        ),
        (
            "--prompts",
            model.prompts.is_some(),
            "the prompts are upstream's, byte for byte",
        ),
        (
            "--max-side",
            sending.max_side.is_some(),
            "--image-size says how large frames are sent",
        ),
    ];
    match refused.into_iter().find(|(_, said, _)| *said) {
        Some((flag, _, why)) => Err(Error::usage(flag, why)),
        None => Ok(()),
    }
}

fn list(text: &str) -> Vec<String> {
    text.split(',').map(|name| name.trim().to_owned()).collect()
}

/// `human=answers.json`.
fn answers_file(text: &str) -> Result<AnswersFile> {
    match text.split_once('=') {
        Some((name, path)) if !name.trim().is_empty() && !path.is_empty() => Ok(AnswersFile {
            name: name.trim().to_owned(),
            path: path.into(),
        }),
        _ => Err(Error::usage(
            "--answers",
            format_args!("{text:?}; NAME=FILE expected, as human=answers.json"),
        )),
    }
}

/// `512`, `native`.
fn side(said: Option<&str>) -> Result<Option<usize>> {
    match said {
        None => Ok(Some(SIDE)),
        Some("native") => Ok(None),
        Some(text) => match text.parse() {
            Ok(side) if side > 0 && side <= 65_536 => Ok(Some(side)),
            _ => {
                let problem = format_args!("{text:?}; a side in pixels or native expected");
                Err(Error::usage("--image-size", problem))
            }
        },
    }
}

/// `1234`, `none`.
fn sampling_seed(said: Option<&str>) -> Result<Option<u64>> {
    match said {
        None => Ok(Some(SEED)),
        Some("none") => Ok(None),
        Some(text) => text.parse().map(Some).map_err(|_| {
            let problem = format_args!("{text:?}; a whole number from 0 on or none expected");
            Error::usage("--sampling-seed", problem)
        }),
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;
    use crate::ask::Temperature;
    use crate::cli::{Cli, Command};
    use crate::types::KindSet;

    fn resolve(words: &[&str]) -> Result<OpenEqa> {
        let words = ["darkqa-eval", "openeqa", "--questions", "q.json"]
            .into_iter()
            .chain(["--frames", "walks"])
            .chain(words.iter().copied());
        match Cli::try_parse_from(words).unwrap().command {
            Some(Command::OpenEqa(said)) => OpenEqa::resolve(*said),
            _ => panic!("another command"),
        }
    }

    #[test]
    fn defaults_are_the_papers_and_upstreams() {
        let local = "http://127.0.0.1:1/v1";
        let config = resolve(&["--model", "m", "--judge", "j", "--base-url", local]).unwrap();
        let levels: Vec<String> = config
            .job
            .light
            .levels
            .iter()
            .map(ToString::to_string)
            .collect();
        assert_eq!(levels, ["L0", "L2", "L4"]);
        assert_eq!(config.job.light.variants, KindSet::NOISE);
        let parameters = &config.job.ask.parameters;
        assert_eq!(
            (
                parameters.temperature,
                parameters.max_tokens,
                parameters.seed
            ),
            (Temperature::Of(0.2), Some(128), Some(1234))
        );
        let judge = config.judge.unwrap();
        assert_eq!(
            (judge.parameters.temperature, judge.parameters.max_tokens),
            (Temperature::Of(0.2), Some(32))
        );
        assert_eq!(judge.model, ModelName::Remote("j".into()));
        assert_eq!((config.walk.frames, config.walk.side), (50, Some(512)));
    }

    #[test]
    fn the_judges_endpoint_gets_no_key_of_another() {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), "sk-model").unwrap();
        let key = file.path().to_str().unwrap();
        let words = ["--model", "m", "--judge", "j", "--api-key-file", key];
        let local = ["--base-url", "http://127.0.0.1:1/v1"];
        let config = resolve(&[&words[..], &local].concat()).unwrap();
        assert!(config.judge.unwrap().server.unwrap().access.key.is_some());
        let other = ["--judge-base-url", "http://127.0.0.1:2/v1"];
        let none = ["--judge-api-key-env", "none"];
        let config = resolve(&[&words[..], &local, &other, &none].concat()).unwrap();
        let access = config.judge.unwrap().server.unwrap().access;
        assert!(access.key.is_none() && access.base.to_string().contains(":2/"));
    }

    #[test]
    fn what_makes_no_sense_names_its_flag() {
        for (words, says) in [
            (vec![], "--model: no model is named"),
            (vec!["--model", "random"], "--model: random can only choose"),
            (vec!["--answers", "x"], "--answers: \"x\"; NAME=FILE"),
            (
                vec!["--model", "script:a", "--constrain", "json"],
                "--constrain: ",
            ),
            (
                vec!["--model", "script:a", "--max-side", "9"],
                "--max-side: --image-size",
            ),
            (
                vec!["--model", "script:a", "--image-size", "0"],
                "--image-size: ",
            ),
            (
                vec!["--model", "script:a", "--degrade", "later"],
                "--degrade: ",
            ),
            (vec!["--model", "script:a", "--sensor", "x"], "--sensor: "),
            (
                vec!["--model", "script:a", "--protocol", "x"],
                "--protocol: ",
            ),
            (
                vec!["--model", "script:a", "--sampling-seed", "x"],
                "--sampling-seed: ",
            ),
        ] {
            let error = resolve(&words).unwrap_err().to_string();
            assert!(error.starts_with(says), "{words:?}: {error}");
        }
    }
}
