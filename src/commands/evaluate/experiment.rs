//! The [`Experiment`] of questions with choices.

use std::collections::HashSet;

use serde_json::{Value, json};

use super::plan::{ChoiceItem, plan_trials};
use super::power::{power_forecast, run_contents};
use super::settings::ImagePlace;
use super::setup::ChoiceSetup;
use crate::engine::experiment::Experiment;
use crate::engine::identity;
use crate::engine::images::frames::{Frames, Source};
use crate::engine::images::recipes::Recipe;
use crate::engine::images::trials::SourcePlan;
use crate::engine::images::trials::questions::ASK;
use crate::engine::models::ModelUnderTest;
use crate::engine::settings::JobSettings;
use crate::error::Result;
use crate::report::joined;
use crate::runs::Outcome;
use crate::runs::StdoutFormat;
use crate::runs::power_forecast::PowerForecast;
use crate::runs::stored::StoredRun;
use crate::store::Store;
use crate::types::manifests::{Columns, Identity, PartPlace};
use crate::types::{ChoiceDetail, QuestionId, Record, RunQuestion, SetLight, View};
use darkqa_questions::rules::Rules;
use darkqa_score::model_in_condition::is_reference;

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
        let ids: HashSet<&QuestionId> = self.questions.iter().map(|question| &question.id).collect();
        let others = self.with_other_rooms.iter().filter(|question| !ids.contains(&question.id));
        self.questions
            .iter()
            .chain(others)
            .map(|question| RunQuestion {
                image: self.digests.get(&question.frame).copied(),
                images: self.dataset.image_series(&question.frame).to_vec(),
                ..RunQuestion::new(question, self.file_places[&question.id], &self.dataset.scene(&question.frame))
            })
            .collect()
    }

    fn power(&self) -> Option<PowerForecast> {
        let models = self.models.iter().filter(|model| model.view == View::Image && !is_reference(&model.name));
        let asked = run_contents(&self.conditions, models.count());
        power_forecast(&self.dataset, &self.questions, &self.digests, asked)
    }

    fn identity(&self) -> Identity {
        let order = self.config.order;
        let rules = Rules::built_in().map(|rules| rules.digest());
        let rules = Some(self.config.rules.digest()).filter(|own| rules.is_ok_and(|rules| rules != *own));
        let fields = [
            Some(("--data", json!(self.dataset.name()))),
            Some(("--prompts", json!(self.config.prompts.digest()))),
            order.shuffle_options.then_some(("--shuffle-options", true.into())),
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
            .chain(identity::images(&self.recipe))
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
        [bank, reading, light, brightness].into_iter().flatten().collect()
    }

    fn columns(&self) -> Columns {
        identity::columns(&self.models, &self.recipe, &self.config.job)
    }

    fn plan(&self, _: usize, _: impl FnOnce() -> Result<Vec<Record>>) -> Result<Vec<SourcePlan<ChoiceItem>>> {
        plan_trials(self)
    }

    fn report(&self, store: &Store<ChoiceDetail>, run: StoredRun<ChoiceDetail>, show: StdoutFormat) -> Result<Outcome> {
        joined::choice::write(store, run, show)
    }
}
