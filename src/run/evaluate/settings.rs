//! What an evaluation takes: [`EvaluateArgs`], and its settings: [`Evaluation`].

use std::num::NonZeroU32;
use std::path::PathBuf;

use clap::Args;

use super::choice_order::ChoiceOrder;
use crate::ask::{Constrain, Prompts};
use crate::dataset::{DataArgs, PixelLimit, SelectionArgs};
use crate::error::Result;
use crate::job::settings::{ExperimentSettings, JobArgs, JobSettings};
use crate::types::Decides;

/// The flags of an evaluation, by help heading.
#[derive(Debug, Args)]
pub(crate) struct EvaluateArgs {
    /// Data.
    #[command(flatten)]
    pub data: DataArgs,
    /// Questions about them.
    #[command(flatten)]
    pub selection: SelectionArgs,
    /// How choices are shown.
    #[command(flatten)]
    pub order: ChoiceOrder,
    /// How large an image may be.
    #[command(flatten)]
    pub limit: PixelLimit,
    /// What every experiment has.
    #[command(flatten)]
    pub job: JobArgs,
    /// How questions with choices are put.
    #[command(flatten)]
    pub choice: ChoiceArgs,
    /// In which size images are sent.
    #[command(flatten)]
    pub shrink: ShrinkArgs,
}

/// How questions with choices are put to a model.
#[derive(Debug, Clone, Default, Args)]
#[command(next_help_heading = "Model")]
pub(crate) struct ChoiceArgs {
    /// What the server lets the model say; other numbers than unconstrained ones
    #[arg(long, value_enum, default_value_t, add = Decides::Reply)]
    pub constrain: Constrain,
    /// A folder with custom prompts (choice.txt, blind.txt); default: built in
    #[arg(long, value_name = "DIR", add = Decides::Reply)]
    pub prompts: Option<PathBuf>,
}

/// In which size images are sent.
#[derive(Debug, Clone, Default, Args)]
#[command(next_help_heading = "Sending")]
pub(crate) struct ShrinkArgs {
    /// Shrink images whose longer side is longer than this, in pixels; default: never
    #[arg(long, value_name = "PIXELS", add = Decides::Pixels)]
    pub max_side: Option<NonZeroU32>,
}

/// The settings of an evaluation, validated.
#[derive(Debug)]
pub(super) struct Evaluation {
    pub(super) data: DataArgs,
    pub(super) selection: SelectionArgs,
    pub(super) limit: PixelLimit,
    pub(super) order: ChoiceOrder,
    pub(super) prompts: Prompts,
    pub(super) job: JobSettings,
}

impl EvaluateArgs {
    /// Looks at the files and variables that the flags name.
    ///
    /// # Errors
    /// [`Error::Usage`](crate::error::Error::Usage) with the flag that cannot be used.
    pub(super) fn resolve(self) -> Result<Evaluation> {
        if self.job.models.is_empty() {
            return Err(self.job.nameless());
        }
        let prompts = self.choice.prompts.as_deref();
        Ok(Evaluation {
            data: self.data,
            selection: self.selection,
            limit: self.limit,
            order: self.order,
            prompts: prompts.map_or_else(Prompts::built_in, Prompts::load)?,
            job: self.job.resolve(&ExperimentSettings {
                constrain: self.choice.constrain,
                max_side: self.shrink.max_side,
                sampling_seed: None,
            })?,
        })
    }
}
