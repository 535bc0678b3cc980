//! The flags of an evaluation ([`EvaluateArgs`]) and its validated settings ([`Evaluation`]).
//!
//! Order of the choices of a question, and number of repeats: [`ChoiceOrder`], [`shown_questions`].
//!
//! Settings that a run must share with its plan: [`plan_identity`].

use std::num::{NonZeroU16, NonZeroU32};
use std::path::Path;

use clap::{Args, ValueEnum};
use serde_json::{Value, json};

use darkqa_ask::{Constrain, PromptSet, Wording};
use darkqa_base::error::{Error, Result};
use darkqa_base::types::manifests::Identity;
use darkqa_base::types::{AxisLevel, Choices, Condition, Decides, Digest, Family, Question, SetLight, Truths, View};
use darkqa_data::{BankArgs, DataArgs, DataSource, Dataset, DecodeArgs, SceneArgs, SelectionArgs, SetArgs};
use darkqa_engine::images::recipes::Recipe;
use darkqa_engine::images::trials::{ASK, QuestionBank, rules};
use darkqa_engine::manifest;
use darkqa_engine::models::{ModelName, TextBaseline};
use darkqa_engine::settings::{ExperimentSettings, JobArgs, JobSettings};
use darkqa_pictures::DecodeRule;
use darkqa_questions::rules::Rules;
use darkqa_runs::StatedArgs;
use darkqa_runs::run_plan::RunPlan;

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
    /// The draws of the noise.
    #[command(flatten)]
    pub noise: NoiseDraws,
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
    /// Facts that the user states for the report.
    #[command(flatten)]
    pub stated: StatedArgs,
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
    /// Prompts: built in (paper, terse, letter), or a folder with choice.txt and blind.txt; repeatable with names:
    /// every question is then asked in each wording; default: paper
    #[arg(long, value_name = "[NAME=]DIR", add = Decides::Reply)]
    pub prompts: Vec<PromptSet>,
    /// Also ask every control of the observer (observer:other-room, or observer:tiles with a single scene, is always
    /// asked)
    #[arg(long, add = Decides::Trials)]
    pub observer_controls: bool,
}

/// The flag for draws of the noise.
#[derive(Debug, Clone, Copy, Args)]
#[command(next_help_heading = "Light")]
pub(crate) struct NoiseDraws {
    /// Ask about N draws of the noise of every noisy image, made with --seed and the N − 1 seeds after it; default: 1
    #[arg(long, value_name = "N", add = Decides::Trials)]
    pub noise_seeds: Option<NonZeroU16>,
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
    pub(super) place: DataSource,
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
    /// The wordings in which questions are asked, at least one.
    pub(super) wordings: Vec<Wording>,
    /// The place of the image in a message.
    pub(super) image_place: ImagePlace,
    /// The rulebook for making questions and for the observer's answers.
    pub(super) rules: Rules,
    /// Ask every control of the observer, if the observer is asked.
    pub(super) observer_controls: bool,
    /// The plan in the folder of the run; `None` if there is none.
    pub(super) plan: Option<RunPlan>,
    /// Facts that the user states for the report.
    pub(super) stated: StatedArgs,
    pub(super) job: JobSettings,
}

impl EvaluateArgs {
    /// True if a question may be asked in several wordings, orders or draws.
    pub(crate) fn asks_in_several_ways(&self) -> bool {
        let has_orders = self.order.circular || self.order.shuffle_options > Some(NonZeroU32::MIN);
        self.choice.prompts.len() > 1 || has_orders || self.noise.noise_seeds > Some(NonZeroU16::MIN)
    }

    /// Validates the flags, and reads the files and environment variables that they name.
    ///
    /// # Errors
    /// [`Error::Usage`], which names the flag with the invalid value.
    pub(super) fn resolve(self) -> Result<Evaluation> {
        if self.job.models.is_empty() {
            return Err(self.job.no_model_error());
        }
        let place = self.scene.place(self.data.place());
        let set_light = self.scene.set_light(&place, &self.data.set.root.data_root)?;
        let experiment = ExperimentSettings { data: place.path().map(Path::to_owned), set_light, ..self.experiment() };
        let bank = QuestionBank::open(&self.bank)?;
        let truths = bank.as_ref().map_or(Truths::Known, |_| Truths::Unknown);
        let max_cost = self.job.money.max_cost;
        let mut job = self.job.resolve(&experiment)?;
        job.light.draws = self.noise.noise_seeds.unwrap_or(NonZeroU16::MIN);
        check_draws(&job, truths)?;
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
            stated: self.stated,
            wordings: Wording::open(&self.choice.prompts)?,
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

/// Checks that several draws of the noise can be made and evaluated.
///
/// # Errors
/// If true answers are unknown, or images were enhanced by other programs, which have one draw.
fn check_draws(job: &JobSettings, truths: Truths) -> Result<()> {
    let flag = "--noise seeds";
    if job.light.draws == NonZeroU16::MIN {
        return Ok(());
    }
    if truths == Truths::Unknown {
        return Err(Error::usage(flag, "--ask compares a model with its own answers under one draw: leave seeds out"));
    }
    if !job.enhancers.enhanced.is_empty() {
        let problem = "the images of --enhanced are of one draw: leave seeds out, or enhance with --llie FILE.onnx";
        return Err(Error::usage(flag, problem));
    }
    Ok(())
}

/// The flags for the order of choices and for repeats.
#[derive(Debug, Clone, Copy, Args)]
#[command(next_help_heading = "Data")]
pub(crate) struct ChoiceOrder {
    /// Shuffle the choices of each question by --seed, equally in every condition, or ask in N different
    /// orders; default: none
    #[arg(long, value_name = "N", num_args = 0..=1, require_equals = true, default_missing_value = "1", add = Decides::Reply)]
    pub shuffle_options: Option<NonZeroU32>,
    /// Ask each question once per rotation of its choices, so that position preferences average out
    #[arg(long, add = Decides::Reply)]
    pub circular: bool,
    /// Ask everything N times; default: once, and with --ask the untouched images twice
    #[arg(long, value_name = "N", add = Decides::Trials)]
    pub repeats: Option<NonZeroU32>,
    /// Combinations of wording, order and draw under which a question is asked: all, or a random half, in which all
    /// wordings, orders and draws are equally frequent; default: all
    #[arg(long, value_enum, value_name = "all|half", add = Decides::Trials)]
    pub design: Option<DesignShare>,
}

/// Share of the combinations of wording, order and draw under which a question is asked.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum DesignShare {
    All,
    /// A random half of them, each level equally often.
    Half,
}

/// Number of times that each order of choices is asked.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Repeats {
    /// The same number in all conditions.
    Everywhere(NonZeroU32),
    /// This number for untouched images without an enhancer, and once in other conditions.
    Untouched(NonZeroU32),
}

/// Default number of times for untouched images if true answers are unknown. With two replies, the report can separate
/// the effect of light from the variation of a model's replies.
const UNTOUCHED_REPEATS: NonZeroU32 = NonZeroU32::MIN.saturating_add(1);

impl Repeats {
    /// The maximum over all conditions.
    pub(super) fn max(self) -> NonZeroU32 {
        match self {
            Self::Everywhere(times) | Self::Untouched(times) => times,
        }
    }

    /// The number of times in a condition; `None` is without an image.
    pub(super) fn times(self, condition: Option<&Condition>) -> u32 {
        match self {
            Self::Everywhere(times) => times.get(),
            Self::Untouched(times) if condition == Some(&Condition::raw(None)) => times.get(),
            Self::Untouched(_) => 1,
        }
    }
}

impl ChoiceOrder {
    /// Number of times that each order is asked: `--repeats`, or a default that depends on whether true answers are
    /// known.
    pub(super) fn repeats(self, truths: Truths) -> Repeats {
        match (self.repeats, truths) {
            (Some(times), _) => Repeats::Everywhere(times),
            (None, Truths::Known) => Repeats::Everywhere(NonZeroU32::MIN),
            (None, Truths::Unknown) => Repeats::Untouched(UNTOUCHED_REPEATS),
        }
    }
}

/// A question with its choices in one order.
#[derive(Debug)]
pub(super) struct ShownQuestion {
    /// The question with its choices in the order shown.
    pub(super) question: Question,
    /// Number of the order among those of the question, from 0.
    pub(super) order: u32,
    /// Number of times that this order was shown before.
    pub(super) repeat: u32,
}

/// All showings of a question: each of its [`orders`], repeated up to [`Repeats::max`].
///
/// A record stores the choices in the order shown, so that parsed choices need no mapping. Different orders have
/// different keys, because the key depends on the choices.
pub(super) fn shown_questions(
    question: &Question,
    choice_order: ChoiceOrder,
    repeats: Repeats,
    seed: u64,
) -> Result<Vec<ShownQuestion>> {
    let choices = &question.choices;
    let orders = orders(question, choice_order, seed);
    let mut shown = Vec::new();
    for repeat in 0..repeats.max().get() {
        for (number, order) in (0..).zip(&orders) {
            let texts = order.iter().map(|&index| choices.texts()[index].clone());
            let truth = order.iter().position(|&index| Some(index) == choices.truth());
            shown.push(ShownQuestion {
                question: Question { choices: Choices::with_truth(texts.collect(), truth)?, ..question.clone() },
                order: number,
                repeat,
            });
        }
    }
    Ok(shown)
}

/// Indices of the choices of a question in each order, without duplicates: that of the data or its shuffles, and with
/// `circular` all rotations of each.
///
/// A question has fewer shuffles than asked for if it has fewer orders: two choices have two.
fn orders(question: &Question, choice_order: ChoiceOrder, seed: u64) -> Vec<Vec<usize>> {
    let count = question.choices.len();
    let wanted = choice_order.shuffle_options.map_or(1, NonZeroU32::get) as usize;
    let possible = (1..=count).try_fold(1_usize, usize::checked_mul).unwrap_or(usize::MAX);
    let mut first: Vec<Vec<usize>> = Vec::new();
    let mut draw = 0;
    while first.len() < wanted.min(possible) {
        let order = match choice_order.shuffle_options {
            Some(_) => shuffled(question, seed, draw),
            None => (0..count).collect(),
        };
        draw += 1;
        if !first.contains(&order) {
            first.push(order);
        }
    }
    let rotations = if choice_order.circular { count } else { 1 };
    let mut orders: Vec<Vec<usize>> = Vec::new();
    for order in first {
        for rotation in 0..rotations {
            let mut order = order.clone();
            order.rotate_left(rotation);
            if !orders.contains(&order) {
                orders.push(order);
            }
        }
    }
    orders
}

/// The choices in random order. Sorting by a digest of each choice gives an order that does not depend on other
/// questions. The first draw is that of earlier versions, which had one.
fn shuffled(question: &Question, seed: u64, draw: u64) -> Vec<usize> {
    let texts = question.choices.texts();
    let mut order: Vec<usize> = (0..texts.len()).collect();
    order.sort_by_cached_key(|&index| {
        let (seed, number) = (seed.to_le_bytes(), draw.to_le_bytes());
        let parts = [&b"shuffle"[..], &seed, question.id.0.as_bytes(), texts[index].as_bytes(), &number];
        let used = if draw == 0 { &parts[..4] } else { &parts };
        *Digest::from_parts(used.iter().copied()).as_bytes()
    });
    order
}

/// The settings of data, questions and light. Models, enhancers and request settings are not included, so that they may
/// be added later.
pub(super) fn plan_identity(config: &Evaluation, dataset: &Dataset) -> Result<Identity> {
    let (selection, rule) = (&config.selection, config.rule);
    let data = match &config.place {
        rooms @ DataSource::Rooms(_) => rooms.to_string(),
        _ => dataset.name().to_owned(),
    };
    let rules = config.rules.digest();
    let is_own = Rules::built_in().is_ok_and(|built_in| built_in.digest() != rules);
    let families: Vec<&str> = selection.families.iter().map(Family::name).collect();
    let bank = config.bank.as_ref();
    let usual = DecodeRule::default();
    let job = &config.job;
    let levels: Vec<String> = job.light.levels.iter().map(AxisLevel::to_string).collect();
    let fields = [
        Some(("--data", json!(data))),
        is_own.then(|| ("--rules", json!(rules))),
        selection.limit.map(|limit| ("--limit", json!(limit))),
        (!families.is_empty()).then(|| ("--families", json!(families))),
        bank.map(|bank| bank.digest().map(|digest| (ASK, json!(digest)))).transpose()?,
        bank.map(|bank| ("--ask-per-image", json!(bank.questions_per_image()))),
        (rule.colour != usual.colour).then(|| ("--colour", json!(rule.colour.to_string()))),
        (rule.transfer != usual.transfer).then(|| ("--transfer", json!(rule.transfer.to_string()))),
        rule.exposure_ev.map(|ev| ("--exposure", json!(ev))),
        (job.set_light == SetLight::Dark).then(|| ("--light", json!(job.set_light))),
        Some(("--levels", json!(levels))),
        (!job.light.matches.is_empty()).then(|| ("--levels match", json!(job.light.matches))),
        Some(("--variant", json!(job.light.variants.to_string()))),
        Some(("--seed", json!(job.light.kinds.sensor.seed))),
    ];
    let fields = fields.into_iter().flatten().map(|(field, value)| (field.to_owned(), value));
    Ok(fields.chain(light_settings(config)).collect())
}

/// The settings of each noise profile and of each further variant, and the version of the synthesis.
fn light_settings(config: &Evaluation) -> Vec<(String, Value)> {
    let job = &config.job;
    let recipe = Recipe::lossless(&job.light.kinds, &[]);
    let version = manifest::images(&recipe).filter(|(field, _)| field == "synthesis");
    let columns = manifest::columns([], &recipe, job).into_iter().flat_map(|(column, values)| {
        values.into_iter().flat_map(move |(name, content)| {
            let place = format!("{column} {name}");
            let settings = content.as_object().cloned().unwrap_or_default();
            settings.into_iter().map(move |(flag, value)| (format!("{flag} of the {place}"), value))
        })
    });
    version.chain(columns).collect()
}

#[cfg(test)]
mod tests {
    use std::collections::{BTreeMap, BTreeSet};

    use super::*;
    use darkqa_base::types::{Evidence, Family, FrameId, QuestionId};

    fn question(id: usize) -> Question {
        let texts = ["a", "b", "c"].map(str::to_owned).to_vec();
        Question {
            id: QuestionId(id.to_string()),
            frame: FrameId("f".into()),
            family: Family::Closest,
            text: "?".into(),
            choices: Choices::new(texts, 1).unwrap(),
            group: None,
            evidence: Evidence::default(),
        }
    }

    fn shown(id: usize, shuffles: u32, circular: bool, repeats: u32) -> Vec<(String, u32)> {
        let [shuffle_options, repeats] = [shuffles, repeats].map(NonZeroU32::new);
        let choice_order = ChoiceOrder { shuffle_options, circular, repeats, design: None };
        let repeats = choice_order.repeats(Truths::Known);
        shown_questions(&question(id), choice_order, repeats, 7)
            .unwrap()
            .iter()
            .map(|shown| {
                let choices = &shown.question.choices;
                assert_eq!(choices.texts()[choices.truth().unwrap()], "b");
                (choices.texts().concat(), shown.repeat)
            })
            .collect()
    }

    fn expected(text: &str, repeat: u32) -> (String, u32) {
        (text.to_owned(), repeat)
    }

    #[test]
    fn every_rotation_is_repeated() {
        assert_eq!(shown(0, 0, false, 1), [expected("abc", 0)]);
        assert_eq!(
            shown(0, 0, true, 2),
            [
                expected("abc", 0),
                expected("bca", 0),
                expected("cab", 0),
                expected("abc", 1),
                expected("bca", 1),
                expected("cab", 1)
            ]
        );
    }

    #[test]
    fn shuffles_differ_and_number_at_most_all_orders() {
        for (shuffles, expected) in [(2, 2), (3, 3), (6, 6), (9, 6)] {
            let orders = shown(5, shuffles, false, 1);
            assert_eq!(orders.iter().collect::<BTreeSet<_>>().len(), expected);
            assert_eq!(orders[0], shown(5, 1, false, 1)[0], "the first is that of a single shuffle");
            assert_eq!(orders, shown(5, shuffles, false, 1));
        }
        // The rotations of two shuffles are all six orders, or three of them twice.
        let rotated = (0..40).map(|id| shown(id, 2, true, 1).len());
        assert!(rotated.clone().all(|count| count == 3 || count == 6) && rotated.clone().any(|count| count == 3));
    }

    fn times(repeats: Option<u32>, truths: Truths, condition: Option<&str>) -> u32 {
        let repeats = repeats.and_then(NonZeroU32::new);
        let order = ChoiceOrder { shuffle_options: None, circular: false, repeats, design: None };
        let condition = condition.map(|name| name.parse::<Condition>().unwrap());
        order.repeats(truths).times(condition.as_ref())
    }

    #[test]
    fn only_untouched_images_are_asked_twice_without_truths() {
        for (condition, expected) in [(Some("L0"), 2), (Some("L3-noise"), 1), (Some("L0+lift"), 1), (None, 1)] {
            assert_eq!(times(None, Truths::Unknown, condition), expected, "{condition:?}");
            assert_eq!(times(None, Truths::Known, condition), 1, "{condition:?}");
            assert_eq!(times(Some(3), Truths::Unknown, condition), 3, "{condition:?}");
        }
    }

    #[test]
    fn shuffled_orders_are_equally_frequent_and_reproducible() {
        let mut counts = BTreeMap::<String, usize>::new();
        for id in 0..6000 {
            let order = shown(id, 1, false, 1);
            assert_eq!(order, shown(id, 1, false, 1));
            *counts.entry(order[0].0.clone()).or_default() += 1;
        }
        assert_eq!(counts.len(), 6);
        // The expected count is 1000; the bounds are four standard deviations.
        assert!(counts.values().all(|n| (885..=1115).contains(n)), "{counts:?}");
    }
}
