//! The flags of an evaluation ([`EvaluateArgs`]) and its validated settings ([`Evaluation`]).

use std::num::NonZeroU32;
use std::path::{Path, PathBuf};

use clap::Args;

use super::choice_order::{ChoiceOrder, Repeats};
use crate::ask::{Constrain, Prompts};
use crate::data::{BankArgs, DataArgs, DataPlace, DecodeArgs, SceneArgs, SelectionArgs, SetArgs};
use crate::engine::images::trials::questions::{QuestionBank, rules};
use crate::engine::models::{ModelName, TextBaseline};
use crate::engine::settings::{ExperimentSettings, JobArgs, JobSettings};
use crate::error::{Error, Result};
use crate::pictures::DecodeRule;
use crate::runs::run_plan::RunPlan;
use crate::types::{Decides, SetLight, Truths, View};
use darkqa_questions::rules::Rules;

/// The flags of an evaluation, by help heading.
#[derive(Debug, Args)]
pub(crate) struct EvaluateArgs {
    /// The place of the data.
    #[command(flatten)]
    pub data: DataArgs,
    /// The light of the photographs, pairs, and classes by folder.
    #[command(flatten)]
    pub scene: SceneArgs,
    /// The flags that select questions.
    #[command(flatten)]
    pub selection: SelectionArgs,
    /// The questions that are asked about every image.
    #[command(flatten)]
    pub bank: BankArgs,
    /// The order in which choices are shown.
    #[command(flatten)]
    pub order: ChoiceOrder,
    /// The reading of images.
    #[command(flatten)]
    pub decode: DecodeArgs,
    /// The flags that every experiment has.
    #[command(flatten)]
    pub job: JobArgs,
    /// The flags for asking questions with choices.
    #[command(flatten)]
    pub choice: ChoiceArgs,
    /// The size in which images are sent.
    #[command(flatten)]
    pub shrink: ShrinkArgs,
}

/// The flags for asking questions with choices.
#[derive(Debug, Clone, Default, Args)]
#[command(next_help_heading = "Model")]
pub(crate) struct ChoiceArgs {
    /// Format that the server enforces on replies; numbers of constrained and free replies differ
    #[arg(long, value_enum, default_value_t, add = Decides::Reply)]
    pub constrain: Constrain,
    /// Request token probabilities (logprobs), for a report of confidence against accuracy; needs temperature 0
    #[arg(long, add = Decides::Reply)]
    pub probabilities: bool,
    /// Send the image before the text, as Anthropic advises; servers can then cache it for all questions about a frame
    #[arg(long, add = Decides::Reply)]
    pub image_first: bool,
    /// Folder with custom prompts (choice.txt, blind.txt); default: built in
    #[arg(long, value_name = "DIR", add = Decides::Reply)]
    pub prompts: Option<PathBuf>,
    /// Also ask every control of the observer (observer:other-room, or observer:tiles with a single scene, is always
    /// asked)
    #[arg(long, add = Decides::Trials)]
    pub observer_controls: bool,
}

/// The place of the image in a message.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum ImagePlace {
    AfterWords,
    BeforeWords,
}

/// The flag for the size in which images are sent.
#[derive(Debug, Clone, Default, Args)]
#[command(next_help_heading = "Sending")]
pub(crate) struct ShrinkArgs {
    /// Shrink images whose longer side exceeds this, in pixels; default: never
    #[arg(long, value_name = "PIXELS", add = Decides::Pixels)]
    pub max_side: Option<NonZeroU32>,
}

/// Validated settings of an evaluation.
#[derive(Debug)]
pub(super) struct Evaluation {
    pub(super) place: DataPlace,
    /// Settings for reading a ready-made set.
    pub(super) set: SetArgs,
    pub(super) scene: SceneArgs,
    pub(super) selection: SelectionArgs,
    /// Rule for decoding images.
    pub(super) rule: DecodeRule,
    /// Questions asked about every image, with the number per image; `None` if the data set has its own questions with
    /// answers.
    pub(super) bank: Option<QuestionBank>,
    pub(super) order: ChoiceOrder,
    /// Number of times that each order of choices is asked.
    pub(super) repeats: Repeats,
    pub(super) prompts: Prompts,
    /// The place of the image in a message.
    pub(super) image_place: ImagePlace,
    /// The rulebook for making questions and for the observer's answers.
    pub(super) rules: Rules,
    /// Ask every control of the observer, if the observer is asked.
    pub(super) observer_controls: bool,
    /// The plan in the folder of the run; `None` if there is none.
    pub(super) plan: Option<RunPlan>,
    pub(super) job: JobSettings,
}

impl EvaluateArgs {
    /// Validates the flags, and reads the files and environment variables that they name.
    ///
    /// # Errors
    /// [`Error::Usage`], which names the flag with the invalid value.
    pub(super) fn resolve(self) -> Result<Evaluation> {
        if self.job.models.is_empty() {
            return Err(self.job.no_model_error());
        }
        let prompts = self.choice.prompts.as_deref();
        let place = self.scene.place(self.data.place());
        let set_light = self.scene.set_light(&place, &self.data.set.root.data_root)?;
        let experiment = ExperimentSettings { data: place.path().map(Path::to_owned), set_light, ..self.experiment() };
        let bank = QuestionBank::open(&self.bank)?;
        let truths = bank.as_ref().map_or(Truths::Known, |_| Truths::Unknown);
        let max_cost = self.job.money.max_cost;
        let mut job = self.job.resolve(&experiment)?;
        let plan = job.place.plan()?;
        if let (Some(plan), Some(whole), true) = (&plan, max_cost, job.shard.is_part()) {
            job.money.max_cost = Some(whole * plan.cost_share(job.shard));
        }
        if truths == Truths::Unknown {
            check_without_truths(&job)?;
            if self.scene.pairs.is_some() {
                let problem = "the photographs in the dark would not be asked about with --ask: write questions with answers about the files in \
                               normal light (--questions), or ask about the dark ones alone with --data DIR --light dark";
                return Err(Error::usage("--pairs", problem));
            }
        }
        Ok(Evaluation {
            rules: rules(self.selection.rules.as_deref())?,
            observer_controls: self.choice.observer_controls,
            image_place: if self.choice.image_first { ImagePlace::BeforeWords } else { ImagePlace::AfterWords },
            place,
            set: self.data.set,
            scene: self.scene,
            selection: self.selection,
            rule: self.decode.rule(),
            repeats: self.order.repeats(truths),
            order: self.order,
            bank,
            plan,
            prompts: prompts.map_or_else(Prompts::built_in, Prompts::load)?,
            job,
        })
    }

    /// The settings that are specific to this experiment.
    pub(super) fn experiment(&self) -> ExperimentSettings {
        ExperimentSettings {
            constrain: self.choice.constrain,
            probabilities: self.choice.probabilities,
            max_side: self.shrink.max_side,
            sampling_seed: None,
            data: self.data.place().path().map(Path::to_owned),
            text_baseline: match self.bank.ask {
                None => TextBaseline::AsMarked,
                Some(_) => TextBaseline::Always,
            },
            set_light: SetLight::default(),
        }
    }
}

/// Checks that a run without true answers can compare every model with its own answers at L0.
///
/// # Errors
/// If the observer is asked, a model gets no images, or the untouched images are left out.
fn check_without_truths(job: &JobSettings) -> Result<()> {
    let models = &job.ask.models;
    if let Some(observer) = models.iter().find(|model| matches!(model.id, ModelName::Observer(_) | ModelName::RoomNet))
    {
        let problem = format_args!(
            "{} cannot be asked with --ask: it answers by the rules that make questions, and none made these; models \
             at an endpoint, random and script:FILE can",
            observer.name
        );
        return Err(Error::usage("--model", problem));
    }
    let seeing: Vec<&str> = models.iter().filter(|model| model.view == View::Image).map(|model| &*model.name).collect();
    if let Some(blind) = models.iter().find(|model| !seeing.contains(&&*model.name)) {
        let problem = format_args!(
            "{} is shown no image, and --ask compares a model with its own answers in the light: name it with --model and leave --blind out; it is \
             asked without images, too",
            blind.name
        );
        return Err(Error::usage("--ask", problem));
    }
    if !job.light.degradations().contains(&None) {
        let problem =
            "--ask compares a model with its own answers at L0: add L0 to --levels; what a run has is not asked again";
        return Err(Error::usage("--levels", problem));
    }
    Ok(())
}
