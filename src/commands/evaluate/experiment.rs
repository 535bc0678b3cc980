//! The [`Experiment`] of questions with choices.
//!
//! The trials of an evaluation: [`plan_trials`].

use std::collections::HashSet;
use std::num::NonZeroU32;
use std::sync::Arc;

use serde_json::{Value, json};

use super::samples::Sample;
use super::settings::{DesignShare, ImagePlace, shown_questions};
use super::setup::{ChoiceSetup, is_other_room};
use super::write_plan::{power_forecast, run_contents};
use darkqa_ask::{ImagePlaces, Query, Wording};
use darkqa_base::error::{Error, Result};
use darkqa_base::types::manifests::{Columns, Identity, PartPlace, RunManifest};
use darkqa_base::types::{
    ChoiceDetail, Condition, FrameId, Question, Record, RunQuestion, SetLight, Shared, TrialOutcome, View,
};
use darkqa_engine::experiment::Experiment;
use darkqa_engine::images::frames::{Frames, Source};
use darkqa_engine::images::recipes::Recipe;
use darkqa_engine::images::trials::{ASK, Item, Prompt, SourcePlan, Stimulus, Trial, TrialGroup};
use darkqa_engine::key_facts::{Asked, KeyHead};
use darkqa_engine::manifest;
use darkqa_engine::models::{ModelUnderTest, asked_in};
use darkqa_engine::settings::JobSettings;
use darkqa_questions::rules::Rules;
use darkqa_report::joined;
use darkqa_runs::forecast::PowerForecast;
use darkqa_runs::stored::StoredRun;
use darkqa_runs::{EXPOSURE_VALUE, Outcome, PROMPTS, StdoutFormat};
use darkqa_score::model_in_condition::is_reference;
use darkqa_score::variation::random_half;
use darkqa_store::Store;

impl Experiment for ChoiceSetup<'_> {
    type Item = ChoiceItem;

    const PHASES: &'static [&'static str] = &["answers"];
    const REPLY: &'static str = "a letter";
    const SOURCE: &'static str = "frame";

    fn settings(&self) -> &JobSettings {
        &self.config.job
    }

    fn data(&self) -> &str {
        self.dataset.name()
    }

    fn models(&self, _: usize) -> &[ModelUnderTest] {
        &self.models
    }

    fn sources(&self) -> &[Source] {
        &self.sources
    }

    fn probe_sources(&self) -> &[Source] {
        &self.probe_sources
    }

    fn part(&self) -> Option<PartPlace> {
        self.part
    }

    fn frames(&self) -> &dyn Frames {
        &*self.dataset
    }

    fn recipe(&self) -> &Recipe {
        &self.recipe
    }

    fn questions(&self) -> Vec<RunQuestion> {
        // In a shard, other-room is also asked questions about frames of other shards, with images of this one.
        let others = self.samples.iter().filter(|sample| sample.source.is_none());
        self.own()
            .chain(others)
            .map(|sample| {
                let question = &sample.question;
                RunQuestion {
                    image: sample.digest,
                    images: self.dataset.image_series(&question.frame).to_vec(),
                    ..RunQuestion::new(question, sample.file_place, &self.dataset.scene(&question.frame))
                }
            })
            .collect()
    }

    fn power(&self) -> Option<PowerForecast> {
        let models = self.models.iter().filter(|model| model.view == View::Image && !is_reference(&model.name));
        let asked = run_contents(&self.conditions, models.count());
        power_forecast(&self.dataset, self.own().map(|sample| (&sample.question, sample.digest)), asked)
    }

    fn identity(&self) -> Identity {
        let order = self.config.order;
        let rules = Rules::built_in().map(|rules| rules.digest());
        let rules = Some(self.config.rules.digest()).filter(|own| rules.is_ok_and(|rules| rules != *own));
        let fields = [
            Some(("--data", json!(self.dataset.name()))),
            Some(("--prompts", prompt_digests(&self.config.wordings))),
            order.shuffle_options.map(|orders| ("--shuffle-options", shuffle_setting(orders))),
            order.circular.then_some(("--circular", true.into())),
            rules.map(|rules| ("--rules", json!(rules))),
            self.bank.map(|bank| (ASK, json!(bank))),
            // Left out if unset, so that runs older than the flag can be continued.
            (self.config.image_place == ImagePlace::BeforeWords).then_some(("--image-first", true.into())),
        ];
        fields
            .into_iter()
            .flatten()
            .map(|(field, value)| (field.to_owned(), value))
            .chain(manifest::images(&self.recipe))
            .collect()
    }

    fn notes(&self) -> Vec<(&'static str, Value)> {
        let bank = self.config.bank.as_ref().map(|bank| ("questions without answers", json!(bank.description())));
        let reading = match self.dataset.summary() {
            [] => None,
            lines => Some(("reading of the data", json!(lines))),
        };
        let set_light = self.config.job.set_light;
        let light = (set_light == SetLight::Dark).then(|| ("--light", json!(set_light)));
        let brightness = self.brightness.map(|(mean, frames)| {
            let note = json!({"mean": mean, "frames": frames});
            ("brightness", note)
        });
        let exposure =
            self.exposure_value.map(|(mean, frames)| (EXPOSURE_VALUE, json!({"mean": mean, "frames": frames})));
        // The page shows the prompt of a reply only if all have the same wording.
        let prompts = match &*self.config.wordings {
            [only] => only.prompts.stored().map(|prompts| (PROMPTS, prompts)),
            _ => None,
        };
        [bank, reading, light, brightness, exposure, prompts]
            .into_iter()
            .flatten()
            .chain(self.config.stated.settings())
            .collect()
    }

    fn columns(&self) -> Columns {
        manifest::columns(&self.models, &self.recipe, &self.config.job)
    }

    fn each_source(
        &self,
        _: usize,
        _: impl FnOnce() -> Result<Vec<Record>>,
        add: &mut dyn FnMut(SourcePlan<ChoiceItem>),
    ) -> Result<()> {
        plan_trials(self, add)
    }

    fn unchanged_report(&self, store: &Store, manifest: &RunManifest, show: StdoutFormat) -> Result<Option<Outcome>> {
        joined::stamp::unchanged(store, manifest, show)
    }

    fn report(&self, store: &Store<ChoiceDetail>, run: StoredRun<ChoiceDetail>, show: StdoutFormat) -> Result<Outcome> {
        joined::written::write(store, run, show)
    }
}

/// A question with its choices in one order.
#[derive(Debug, Clone)]
pub(crate) struct ChoiceItem {
    pub(super) question: Arc<Question>,
    /// Name of the wording; `None` if the run has a single one.
    pub(super) wording: Option<Shared<String>>,
    /// Number of the order of the choices among those of the question, from 0.
    pub(super) order: u32,
    /// Number of times that the question was asked before in this wording and order.
    pub(super) repeat: u32,
    /// Number of times that the question was asked before, in any wording and order of its choices.
    pub(super) turn: u32,
    /// The frame whose image is shown, if it is not the frame of the question.
    pub(super) shown_frame: Option<FrameId>,
}

impl Item for ChoiceItem {
    type Detail = ChoiceDetail;

    fn reply_tokens(&self) -> f64 {
        // The reply is one letter.
        4.0
    }

    fn query(&self) -> Query<'_> {
        Query::Choice(&self.question)
    }

    fn source(&self) -> &str {
        let shown = self.shown_frame.as_ref();
        &shown.unwrap_or(&self.question.frame).0
    }

    fn turn(&self) -> u32 {
        self.turn
    }

    fn blank(trial: &Trial<Self>, stimulus: &Stimulus, model: &str) -> Record {
        let question = &*trial.item.question;
        let mut images = stimulus.images.iter().map(|image| image.facts().clone());
        let detail = ChoiceDetail {
            frame: question.frame.clone(),
            family: question.family.clone(),
            choices: question.choices.texts().to_vec(),
            truth: question.choices.truth(),
            repeat: trial.item.repeat,
            wording: trial.item.wording.as_ref().map(ToString::to_string),
            order: trial.item.order,
            strict: None,
            lenient: None,
            outcome: TrialOutcome::Failed,
            image: images.next(),
            more_images: images.collect(),
            shown_frame: trial.item.shown_frame.clone(),
            observed: None,
            options: None,
        };
        let condition = stimulus.condition.clone();
        Record::blank(trial.key, question.id.clone(), model, condition, detail)
    }
}

/// One wording and order of a question, with the prompts for models that see the image and for blind models.
struct QuestionPrompts {
    item: ChoiceItem,
    image: KeyedPrompt,
    blind: KeyedPrompt,
    /// Position of the question among all selected ones.
    place: usize,
    /// Draws of the noise under which it is asked in this wording and order; `None` for all.
    draws: Option<Vec<u16>>,
}

/// A prompt, with the inputs that the keys of all its trials share.
struct KeyedPrompt {
    prompt: Prompt,
    key_head: KeyHead,
}

impl QuestionPrompts {
    /// True if the question is asked in a condition in this wording and order. A condition without drawn noise is
    /// asked for all draws at once.
    fn is_asked_in(&self, condition: Option<&Condition>) -> bool {
        match (&self.draws, condition.and_then(Condition::draw)) {
            (None, _) => true,
            (Some(draws), Some(draw)) => draws.contains(&draw),
            (Some(draws), None) => !draws.is_empty(),
        }
    }
}

/// The questions asked with the images of one frame.
#[derive(Default)]
struct FrameQuestions {
    /// Questions about the frame.
    own: Vec<QuestionPrompts>,
    /// Questions about other frames, for the control `observer:other-room`.
    others: Vec<QuestionPrompts>,
}

/// Adds all trials, grouped by frame: first the trials without an image, then those of each condition.
fn plan_trials(setup: &ChoiceSetup<'_>, add: &mut dyn FnMut(SourcePlan<ChoiceItem>)) -> Result<()> {
    let mut by_source = vec![[const { Vec::new() }; 2]; setup.sources.len()];
    for sample in &setup.samples {
        if let Some(source) = sample.source {
            by_source[source][0].push(sample);
        }
        if let Some(shown) = sample.other_room {
            by_source[shown][1].push(sample);
        }
    }
    for (source, [own, others]) in by_source.into_iter().enumerate() {
        // Only the prompts of one source are in memory at a time.
        let mut questions = FrameQuestions::default();
        for sample in own {
            questions.own.extend(prompts(setup, sample, None)?);
        }
        for sample in others {
            questions.others.extend(prompts(setup, sample, Some(&setup.sources[source].name))?);
        }
        let shown = setup.conditions.iter().filter(|condition| setup.sources[source].can_show(condition));
        let groups = std::iter::once(None)
            .chain(shown.map(Some))
            .filter_map(|condition| group(setup, source, condition, &questions).transpose())
            .collect::<Result<_>>()?;
        add(SourcePlan { source, groups });
    }
    Ok(())
}

/// A question in each wording and order of its choices. `shown_frame` is the frame whose image is shown, if it is not
/// the frame of the question.
fn prompts(setup: &ChoiceSetup<'_>, sample: &Sample, shown_frame: Option<&FrameId>) -> Result<Vec<QuestionPrompts>> {
    let (order, repeats, question) = (setup.config.order, setup.config.repeats, &sample.question);
    let is_of_several = !setup.dataset.image_series(&question.frame).is_empty();
    let shown_questions = shown_questions(question, order, repeats, setup.recipe.seed)?;
    let half = (order.design == Some(DesignShare::Half)).then(|| {
        let orders = shown_questions.iter().map(|shown| shown.order + 1).max().unwrap_or(1) as usize;
        let draws = usize::from(setup.config.job.light.draws.get());
        let key = format!("{} {}", setup.recipe.seed, question.id);
        random_half([setup.config.wordings.len(), orders, draws], &key)
    });
    let mut prompts = Vec::new();
    for shown in shown_questions {
        let question = Arc::new(shown.question);
        for (number, wording) in (0..).zip(&setup.config.wordings) {
            let draws = half.as_ref().map(|half| {
                let own = half.iter().filter(|levels| levels[..2] == [number, shown.order as u16]);
                own.map(|levels| levels[2]).collect()
            });
            let prompt = |view| {
                let words = wording.prompts.render(view, &question)?;
                let prompt = match (view, setup.config.image_place) {
                    (View::Image, ImagePlace::BeforeWords) => Prompt::after_images(words.into()),
                    _ => Prompt::from_text(words.into()),
                };
                Ok::<_, Error>(match view {
                    View::Image if is_of_several => prompt.with_places(ImagePlaces::Marked),
                    View::Image | View::Blind => prompt,
                })
            };
            let keyed = |view| {
                let prompt = prompt(view)?;
                let key_head = KeyHead::new(&prompt, Some(question.choices.texts()))?;
                Ok::<_, Error>(KeyedPrompt { prompt, key_head })
            };
            prompts.push(QuestionPrompts {
                image: keyed(View::Image)?,
                blind: keyed(View::Blind)?,
                place: sample.place,
                draws,
                item: ChoiceItem {
                    question: Arc::clone(&question),
                    wording: wording.name.clone(),
                    order: shown.order,
                    repeat: shown.repeat,
                    turn: prompts.len() as u32,
                    shown_frame: shown_frame.cloned(),
                },
            });
        }
    }
    Ok(prompts)
}

/// The trials in a condition; `None` if no model is asked in it.
fn group(
    setup: &ChoiceSetup<'_>,
    source: usize,
    condition: Option<&Condition>,
    questions: &FrameQuestions,
) -> Result<Option<TrialGroup<ChoiceItem>>> {
    let view = condition.map_or(View::Blind, |_| View::Image);
    let models = asked_in(&setup.models, condition);
    if models.is_empty() {
        return Ok(None);
    }
    let image =
        condition.map(|condition| setup.recipe.stimulus_digest(&setup.sources[source], condition)).transpose()?;
    let own = questions.own.iter().map(|shown| (shown, false));
    let others = questions.others.iter().map(|shown| (shown, true));
    let count = questions.own.len() + questions.others.len();
    let mut trials = Vec::with_capacity(count * models.len());
    let times = setup.config.repeats.times(condition);
    // Wordings may share their words without an image: the same request is sent once, for the first of them.
    let has_wordings = setup.config.wordings.len() > 1;
    let mut keys = HashSet::new();
    let asked = own.chain(others).filter(|(shown, _)| shown.item.repeat < times && shown.is_asked_in(condition));
    for (shown, is_of_other) in asked {
        let KeyedPrompt { prompt, key_head } = match view {
            View::Image => &shown.image,
            View::Blind => &shown.blind,
        };
        let asked = Asked {
            question: &shown.item.question.id,
            places: prompt.places,
            condition,
            image,
            repeat: shown.item.repeat,
        };
        for &(index, model) in models.iter().filter(|(_, model)| {
            model.is_asked(shown.place) && (view == View::Image && is_other_room(model)) == is_of_other
        }) {
            let key = key_head.key(model, asked)?;
            if has_wordings && !keys.insert(key) {
                continue;
            }
            trials.push(Trial { key, model: index, prompt: prompt.clone(), item: shown.item.clone() });
        }
    }
    Ok(Some(TrialGroup { condition: condition.cloned(), trials }))
}

/// Digest of the prompts, or of those of each wording by its name.
fn prompt_digests(wordings: &[Wording]) -> Value {
    match wordings {
        [Wording { name: None, prompts }] => json!(prompts.digest()),
        several => several
            .iter()
            .map(|wording| {
                let name = wording.name.as_ref().map_or_else(String::new, ToString::to_string);
                (name, json!(wording.prompts.digest()))
            })
            .collect(),
    }
}

/// Number of shuffled orders as a setting; `true` for one, as earlier versions wrote it.
fn shuffle_setting(orders: NonZeroU32) -> Value {
    if orders == NonZeroU32::MIN { true.into() } else { orders.get().into() }
}
