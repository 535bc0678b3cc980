//! What `openeqa` takes: [`OpenEqaArgs`], and its settings: [`OpenEqa`].

use std::path::PathBuf;
use std::str::FromStr;

use clap::{Arg, Args};

use super::judge::{Judge, JudgeArgs};
use super::questions::OpenSelectionArgs;
use crate::dataset::PixelLimit;
use crate::error::Result;
use crate::job::batch::BatchFileArgs;
use crate::job::models::ModelName;
use crate::job::settings::{ExperimentSettings, JobArgs, JobSettings};
use crate::job::walk::Walk;
use crate::score::llm_match::Protocol;
use crate::types::Decides;

/// The flags of `openeqa`.
#[derive(Debug, Args)]
pub(crate) struct OpenEqaArgs {
    /// The questions, as open-eqa-v0.json
    #[arg(long, value_name = "FILE", help_heading = "OpenEQA", add = Decides::Reply)]
    pub questions: PathBuf,
    /// Which of them.
    #[command(flatten)]
    pub chosen: OpenSelectionArgs,
    /// How walks are shown.
    #[command(flatten)]
    pub walk: Walk,
    /// How large a frame may be.
    #[command(flatten)]
    pub limit: PixelLimit,
    /// What the servers' sampling starts from, or none
    #[arg(
        long,
        value_name = "N|none",
        help_heading = "OpenEQA",
        default_value = "1234", add = Decides::Reply)]
    pub sampling_seed: SamplingSeed,
    /// Answers of people or another program, as upstream's files ([{"question_id", "answer"}], with "level" or "condition"
    /// beside them where it is not L0), to be marked like a model's; repeatable; default: none
    #[arg(long, value_name = "NAME=FILE", help_heading = "OpenEQA", add = Decides::Trials)]
    pub answers: Vec<AnswersFile>,
    /// Who marks the answers.
    #[command(flatten)]
    pub judge: JudgeArgs,
    /// Write a page on which people answer the questions about the frames into this folder, and ask no model; default: ask models
    #[arg(
        long,
        value_name = "DIR",
        help_heading = "OpenEQA",
        conflicts_with_all = ["batch", "dry_run"], add = Decides::Nothing)]
    pub study: Option<PathBuf>,
    /// Write what is left to ask as files of a Batch API, answers first and then marks, and ask nothing
    #[arg(long, help_heading = "Batch", conflicts_with = "dry_run", add = Decides::Nothing)]
    pub batch: bool,
    /// Their files.
    #[command(flatten)]
    pub files: BatchFileArgs,
    /// What every experiment has.
    #[command(flatten)]
    pub job: JobArgs,
}

/// The seed that is sent to servers, if any.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SamplingSeed(Option<u64>);

/// Answers of people or another program.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct AnswersFile {
    /// What they stand under among the models.
    pub name: String,
    /// The file.
    pub path: PathBuf,
}

/// The settings of an evaluation by open questions, validated.
#[derive(Debug)]
pub(super) struct OpenEqa {
    pub(super) questions: PathBuf,
    pub(super) chosen: OpenSelectionArgs,
    pub(super) walk: Walk,
    pub(super) limit: PixelLimit,
    pub(super) answers: Vec<AnswersFile>,
    /// Who marks the answers; `None` for nobody.
    pub(super) judge: Option<Judge>,
    pub(super) protocol: Protocol,
    pub(super) task: OpenTask,
    pub(super) job: JobSettings,
}

/// What is to be done.
#[derive(Debug)]
pub(super) enum OpenTask {
    /// Ask what is left, or say what that would take.
    Run,
    /// Write it as files of a Batch API.
    Batch(BatchFileArgs),
    /// Write a page for people.
    Study(PathBuf),
}

impl OpenEqaArgs {
    /// The flags that this command shares with an evaluation, with the defaults and the words that they have here: upstream's, and
    /// the levels of the paper's table.
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
                "Go on with the run in this folder, also at another address of the same models; default: none",
            ),
            _ => arg,
        }
    }

    /// Looks at the files and variables that the flags name.
    ///
    /// # Errors
    /// [`Error::Usage`](crate::error::Error::Usage) with the flag that cannot be used.
    pub(super) fn resolve(self) -> Result<OpenEqa> {
        let task = match (self.study, self.batch) {
            (Some(folder), _) => OpenTask::Study(folder),
            (None, true) => OpenTask::Batch(self.files),
            (None, false) => OpenTask::Run,
        };
        let nobody = self.job.models.is_empty() && self.answers.is_empty();
        if nobody && !matches!(task, OpenTask::Study(_)) {
            return Err(self.job.nameless());
        }
        let models = &self.job.models;
        let mut names = models.model.iter().chain(&models.blind_model);
        names.try_for_each(ModelName::answers_in_words)?;
        let SamplingSeed(seed) = self.sampling_seed;
        let protocol = self.judge.protocol;
        let judge = self.judge.resolve(&self.job, seed)?;
        Ok(OpenEqa {
            questions: self.questions,
            chosen: self.chosen,
            walk: self.walk,
            limit: self.limit,
            answers: self.answers,
            judge,
            protocol,
            task,
            job: self.job.resolve(&ExperimentSettings {
                sampling_seed: seed,
                ..ExperimentSettings::default()
            })?,
        })
    }
}

impl FromStr for AnswersFile {
    type Err = String;

    /// Reads `human=answers.json`.
    fn from_str(text: &str) -> Result<Self, String> {
        match text.split_once('=') {
            Some((name, path)) if !name.trim().is_empty() && !path.is_empty() => Ok(Self {
                name: name.trim().to_owned(),
                path: path.into(),
            }),
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
