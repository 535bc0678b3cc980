//! The flags of `openeqa` ([`OpenEqaArgs`]) and its validated settings ([`OpenEqa`]).
//!
//! The flags of the judge ([`JudgeArgs`]), and the resolved judge with its endpoint and key ([`Judge`]).

use std::num::NonZeroU32;
use std::path::PathBuf;
use std::str::FromStr;
use std::sync::Arc;

use clap::{Arg, Args};

use super::record::OpenSelectionArgs;
use darkqa_ask::{AccessArgs, KeyHeader, Parameters, Server, SettingsOrigin, Temperature};
use darkqa_base::error::{Error, Result};
use darkqa_base::types::Decides;
use darkqa_base::types::manifests::JUDGES;
use darkqa_data::{DecodeArgs, RootArgs};
use darkqa_engine::batch::{BatchFileArgs, BatchRunArgs};
use darkqa_engine::images::frames::WalkArgs;
use darkqa_engine::models::ModelName;
use darkqa_engine::reply_checks::Continuation;
use darkqa_engine::settings::{ExperimentSettings, JobArgs, JobSettings};
use darkqa_pictures::DecodeRule;
use darkqa_score::choice::llm_match::Protocol;

/// The flags of `openeqa`.
#[derive(Debug, Args)]
pub(crate) struct OpenEqaArgs {
    /// The questions, as open-eqa-v0.json
    #[arg(long, value_name = "FILE", help_heading = "OpenEQA", add = Decides::Reply)]
    pub questions: PathBuf,
    /// The flags that select questions.
    #[command(flatten)]
    pub chosen: OpenSelectionArgs,
    /// The flags for showing walks.
    #[command(flatten)]
    pub walk: WalkArgs,
    /// Further folders that walks may lie in.
    #[command(flatten)]
    pub root: RootArgs,
    /// The reading of images.
    #[command(flatten)]
    pub decode: DecodeArgs,
    /// The seed of the servers' sampling, or none
    #[arg(
        long,
        value_name = "N|none",
        help_heading = "OpenEQA",
        default_value = "1234", add = Decides::Reply)]
    pub sampling_seed: SamplingSeed,
    /// Answers of people or another program, as upstream's files ([{"question_id", "answer"}], with "level" or
    /// "condition" beside them where it is not L0), to be marked like a model's; repeatable; default: none
    #[arg(long, value_name = "NAME=FILE", help_heading = "OpenEQA", add = Decides::Trials)]
    pub answers: Vec<AnswersFile>,
    /// The flags of the judge.
    #[command(flatten)]
    pub judge: JudgeArgs,
    /// Write a page on which people answer the questions about the frames into this folder, and ask no model; default:
    /// ask models
    #[arg(
        long,
        value_name = "DIR",
        help_heading = "OpenEQA",
        conflicts_with_all = ["batch", "batch_run", "dry_run"], add = Decides::Nothing)]
    pub study: Option<PathBuf>,
    /// Write what is left to ask as files of a Batch API, answers first and then marks, and ask nothing
    #[arg(long, help_heading = "Batch", conflicts_with_all = ["dry_run", "batch_run"], add = Decides::Nothing)]
    pub batch: bool,
    /// Ask what is left to ask in batches, answers first and then marks, and wait for their replies, as batch run does
    #[arg(long, help_heading = "Batch", add = Decides::Nothing)]
    pub batch_run: bool,
    /// The flags for batches that the program submits.
    #[command(flatten)]
    pub batches: BatchRunArgs,
    /// The flags for the batch files.
    #[command(flatten)]
    pub files: BatchFileArgs,
    /// The flags that every experiment has.
    #[command(flatten)]
    pub job: JobArgs,
}

/// The sampling seed sent to servers; `None` to send none.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SamplingSeed(Option<u64>);

/// A file with answers of people or of another program.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct AnswersFile {
    /// The name of the answers in tables, next to the names of models.
    pub name: String,
    pub path: PathBuf,
}

/// Validated settings of an evaluation by open questions.
#[derive(Debug)]
pub(super) struct OpenEqa {
    pub(super) questions: PathBuf,
    pub(super) chosen: OpenSelectionArgs,
    pub(super) walk: WalkArgs,
    /// Further folders that the walks may lie in.
    pub(super) root: RootArgs,
    /// Rule for decoding images.
    pub(super) rule: DecodeRule,
    pub(super) answers: Vec<AnswersFile>,
    /// `None` if the answers are not marked.
    pub(super) judge: Option<Judge>,
    pub(super) protocol: Protocol,
    pub(super) task: OpenTask,
    pub(super) job: JobSettings,
}

/// The task of the command.
#[derive(Debug)]
pub(super) enum OpenTask {
    /// Ask the remaining trials, or with `--dry-run` print an estimate.
    Run,
    /// Write the remaining trials as files of a Batch API.
    Batch(BatchFileArgs),
    /// Ask the remaining trials in batches.
    BatchRun(BatchFileArgs, BatchRunArgs),
    /// Write a page for human answers into this folder.
    Study(PathBuf),
}

impl OpenEqaArgs {
    /// Adapts the default and help text of a flag shared with an evaluation to this command. The defaults are those of
    /// upstream, the levels those of the paper's table.
    #[must_use]
    pub(crate) fn own(arg: Arg) -> Arg {
        match arg.get_id().as_str() {
            "levels" => arg.default_value("L0,L2,L4"),
            "variant" => arg.default_value("noise"),
            "temperature" => arg.default_value("0.2"),
            "max_tokens" => arg.default_value("128"),
            "model" => arg.help(
                "The model to ask, by its name at the endpoint; repeatable; built in: script:FILE; default: none",
            ),
            "out" => arg.help(
                "The run folder, which models, levels and judges may be added to; default: results/TIME-MODEL-QUESTIONS-HASH, found \
                 again by the same command",
            ),
            "resume" => arg.help(
                "Continue the run in this folder, also at another address of the same models; default: none",
            ),
            _ => arg,
        }
    }

    /// Validates the flags, and reads the files and environment variables that they name.
    ///
    /// # Errors
    /// [`Error::Usage`], which names the flag with the invalid value.
    pub(super) fn resolve(self) -> Result<OpenEqa> {
        let task = match (self.study, self.batch) {
            (Some(folder), _) => OpenTask::Study(folder),
            (None, true) => OpenTask::Batch(self.files),
            (None, false) if self.batch_run => OpenTask::BatchRun(self.files, self.batches),
            (None, false) => OpenTask::Run,
        };
        let nothing_to_ask = self.job.models.is_empty() && self.answers.is_empty();
        if nothing_to_ask && !matches!(task, OpenTask::Study(_)) {
            return Err(self.job.no_model_error());
        }
        let models = &self.job.models;
        models.named().try_for_each(ModelName::require_open_answers)?;
        let SamplingSeed(seed) = self.sampling_seed;
        let protocol = self.judge.protocol;
        let mut judge = self.judge.resolve(&self.job, seed)?;
        let data = self.walk.folder.clone();
        let job = self.job.resolve(&ExperimentSettings {
            sampling_seed: seed,
            data: Some(data),
            ..ExperimentSettings::default()
        })?;
        if let Some(judge) = &mut judge {
            judge.continue_from(&job.continuation());
        }
        if let Some(model) = job.ask.models.iter().find(|model| model.parameters.probabilities) {
            let problem = format_args!("{}: open questions have no choices", model.name);
            return Err(Error::usage("probabilities", problem));
        }
        Ok(OpenEqa {
            questions: self.questions,
            chosen: self.chosen,
            walk: self.walk,
            root: self.root,
            rule: self.decode.rule(),
            answers: self.answers,
            judge,
            protocol,
            task,
            job,
        })
    }
}

impl FromStr for AnswersFile {
    type Err = String;

    /// Reads `human=answers.json`.
    fn from_str(text: &str) -> Result<Self, String> {
        match text.split_once('=') {
            Some((name, path)) if !name.trim().is_empty() && !path.is_empty() => {
                Ok(Self { name: name.trim().to_owned(), path: path.into() })
            }
            _ => Err("NAME=FILE expected, as human=answers.json".to_owned()),
        }
    }
}

impl FromStr for SamplingSeed {
    type Err = String;

    /// Reads `1234` or `none`.
    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "none" => Ok(Self(None)),
            text => text
                .parse()
                .map(|seed| Self(Some(seed)))
                .map_err(|_| "a whole number from 0 on or none expected".to_owned()),
        }
    }
}

/// The flags of the judge, the model that marks the answers.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Judge")]
pub(crate) struct JudgeArgs {
    /// The model that marks the answers; default: none, answers are stored and not marked
    #[arg(long, value_name = "NAME", add = Decides::Trials)]
    pub judge: Option<ModelName>,
    /// How answers are judged and marks read
    #[arg(long, value_enum, default_value_t = Protocol::Upstream, add = Decides::Reply)]
    pub protocol: Protocol,
    /// The judge's endpoint; default: that of the models
    #[arg(long, value_name = "URL", add = Decides::Reply)]
    pub judge_base_url: Option<String>,
    /// The variable that holds the key of the judge's endpoint, or none; default: that of its vendor, or
    /// without --judge-base-url that of the models
    #[arg(long, value_name = "NAME|none", conflicts_with = "judge_api_key_file", add = Decides::Nothing)]
    pub judge_api_key_env: Option<String>,
    /// A file that holds the key of the judge's endpoint; default: none, a variable holds it
    #[arg(long, value_name = "FILE", add = Decides::Nothing)]
    pub judge_api_key_file: Option<PathBuf>,
    /// The judge's sampling temperature
    #[arg(long, value_name = "T|auto|default", default_value = "0.2", add = Decides::Reply)]
    pub judge_temperature: Temperature,
    /// The maximum number of tokens of a judge's reply
    #[arg(long, value_name = "N", default_value = "32", add = Decides::Reply)]
    pub judge_max_tokens: NonZeroU32,
}

/// The model that marks the answers, with its endpoint.
#[derive(Debug)]
pub(super) struct Judge {
    pub(super) model: ModelName,
    /// The endpoint; `None` if the model is built in.
    pub(super) server: Option<Arc<Server>>,
    /// Parameters of a request; the name of the model is set later.
    pub(super) parameters: Parameters,
}

impl Judge {
    /// Continues the marks of a stored run under their keys, if the settings differ only in what may change in it.
    pub(super) fn continue_from(&mut self, run: &Continuation) {
        let ModelName::Remote(id) = &self.model else {
            return;
        };
        let own = Parameters { model: id.clone(), ..self.parameters.clone() };
        if let Some(accepted) = run.accept(JUDGES, id, &own, true) {
            self.parameters = accepted;
        }
    }
}

impl JudgeArgs {
    /// Resolves the judge and the key of its endpoint; `None` without `--judge`. The key of one endpoint is never sent
    /// to another.
    ///
    /// # Errors
    /// If the judge cannot answer open questions, or its endpoint or key is invalid.
    pub(super) fn resolve(self, job: &JobArgs, seed: Option<u64>) -> Result<Option<Judge>> {
        let Some(model) = self.judge else {
            return Ok(None);
        };
        model.require_open_answers().map_err(at_judge)?;
        if self.judge_base_url.is_none() && job.access.base_url.is_empty() {
            model.check_spelling().map_err(at_judge)?;
        }
        let mut access = job.access.clone();
        let own_access =
            self.judge_base_url.is_some() || self.judge_api_key_env.is_some() || self.judge_api_key_file.is_some();
        if own_access {
            let access_args = match self.judge_base_url {
                Some(url) => access.for_base_url(url),
                None => access,
            };
            access = AccessArgs {
                api_key_env: self.judge_api_key_env,
                api_key_file: self.judge_api_key_file,
                key_header: KeyHeader::Auto,
                ..access_args
            };
        }
        if job.money.dry_run {
            access = access.without_key();
        }
        let server = match model {
            ModelName::Remote(_) => Some(Arc::new(access.server(job.sending).map_err(at_judge)?)),
            _ => None,
        };
        Ok(Some(Judge {
            model,
            server,
            parameters: Parameters {
                temperature: self.judge_temperature,
                max_tokens: self.judge_max_tokens,
                token_field: job.parameters.token_field,
                seed,
                origin: SettingsOrigin {
                    default_temperature: job.unset.contains("judge-temperature"),
                    default_seed: job.unset.contains("sampling-seed"),
                    is_judge: true,
                    ..SettingsOrigin::default()
                },
                ..Parameters::new(String::new())
            },
        }))
    }
}

fn at_judge(e: darkqa_base::error::Error) -> darkqa_base::error::Error {
    e.at("the judge")
}
