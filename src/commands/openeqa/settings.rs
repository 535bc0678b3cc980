//! The flags of `openeqa` ([`OpenEqaArgs`]) and its validated settings ([`OpenEqa`]).

use std::path::PathBuf;
use std::str::FromStr;

use clap::{Arg, Args};

use super::judge::{Judge, JudgeArgs};
use super::questions::OpenSelectionArgs;
use crate::data::{DecodeArgs, RootArgs};
use crate::engine::batch::{BatchFileArgs, BatchRunArgs};
use crate::engine::images::frames::WalkArgs;
use crate::engine::models::ModelName;
use crate::engine::settings::{ExperimentSettings, JobArgs, JobSettings};
use crate::error::{Error, Result};
use crate::pictures::DecodeRule;
use crate::types::Decides;
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
