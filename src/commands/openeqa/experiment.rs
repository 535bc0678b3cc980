//! The [`Experiment`] of open questions and of marks for the answers.

use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;

use serde_json::{Value, json};

use super::marks::{mark_prompt, plan_marks};
use super::plan::plan_answers;
use super::record::OpenItem;
use super::setup::OpenSetup;
use crate::engine::costs::text_tokens;
use crate::engine::experiment::{ExpectedRequest, Experiment};
use crate::engine::identity;
use crate::engine::images::frames::{Frames, Source};
use crate::engine::images::recipes::Recipe;
use crate::engine::images::trials::{Item as _, SourcePlan};
use crate::engine::models::ModelUnderTest;
use crate::engine::settings::JobSettings;
use crate::error::Result;
use crate::report::joined::open;
use crate::runs::Outcome;
use crate::runs::StdoutFormat;
use crate::runs::mark_index::{JUDGE, PROTOCOL};
use crate::runs::stored::StoredRun;
use crate::store::Store;
use crate::types::manifests::{Columns, Identity, JUDGES, PartPlace};
use crate::types::{Family, FrameId, OpenDetail, Record, RunQuestion};
use darkqa_score::choice::llm_match::Protocol;

/// A typical answer, for estimating the length of a judge's prompt.
const ANSWER: &str = "There is a small round table with two chairs next to the window of the living room.";

impl Experiment for OpenSetup<'_> {
    type Item = OpenItem;

    const PHASES: &'static [&'static str] = &["answers", "marks"];
    const REPLY: &'static str = "a sentence or a mark";
    const SOURCE: &'static str = "walk";

    fn settings(&self) -> &JobSettings {
        &self.config.job
    }

    fn data(&self) -> &str {
        self.config.questions.file_stem().and_then(std::ffi::OsStr::to_str).unwrap_or("openeqa")
    }

    fn models(&self, phase: usize) -> &[ModelUnderTest] {
        match phase {
            0 => &self.models,
            _ => self.judge.as_slice(),
        }
    }

    fn token_flag(&self, phase: usize) -> &'static str {
        match phase {
            0 => "--max-tokens",
            _ => "--judge-max-tokens",
        }
    }

    fn mark_protocol(&self, phase: usize) -> Option<Protocol> {
        (phase > 0).then_some(self.config.protocol)
    }

    fn sources(&self) -> &[Source] {
        &self.sources
    }

    fn part(&self) -> Option<PartPlace> {
        self.part
    }

    fn frames(&self) -> &dyn Frames {
        &self.walks
    }

    fn recipe(&self) -> &Recipe {
        &self.recipe
    }

    fn questions(&self) -> Vec<RunQuestion> {
        let walks: HashMap<&str, &Source> = self.sources.iter().map(|source| (&*source.name.0, source)).collect();
        self.questions
            .iter()
            .map(|question| {
                let walk = walks.get(&*question.episode);
                RunQuestion {
                    id: question.id.clone(),
                    place: self.file_places[&question.id],
                    scene: question.episode.clone(),
                    frame: FrameId(question.episode.clone()),
                    family: Family::from(&*question.category),
                    text: question.text.clone(),
                    choices: Vec::new(),
                    answer: Some(question.answer.clone()),
                    extra_answers: question.extra.clone(),
                    group: None,
                    evidence: Value::Null,
                    image: walk.and_then(|walk| walk.digest()),
                    images: Vec::new(),
                }
            })
            .collect()
    }

    fn identity(&self) -> Identity {
        let walk = &self.config.walk;
        [("--num-frames", json!(walk.frames)), ("--degrade", json!(walk.degraded_at)), ("--sensor", json!(walk.camera))]
            .into_iter()
            .map(|(field, value)| (field.to_owned(), value))
            .chain(identity::images(&self.recipe))
            .collect()
    }

    fn columns(&self) -> Columns {
        let mut columns = identity::columns(&self.models, &self.recipe, &self.config.job);
        if let Some(judge) = &self.judge {
            // A model that is its own judge may have other settings as a judge.
            let content = || BTreeMap::from([(judge.name.to_string(), identity::model_definition(judge))]);
            columns.insert(JUDGES.to_owned(), content());
            let models = columns.entry("model".to_owned()).or_default();
            for (name, content) in content() {
                models.entry(name).or_insert(content);
            }
        }
        columns
    }

    fn notes(&self) -> Vec<(&'static str, Value)> {
        let judge = self.judge.as_ref().map(|judge| &*judge.name);
        let answers: Vec<&str> = self.config.answers.iter().map(|file| &*file.name).collect();
        vec![
            (JUDGE, json!(judge)),
            (PROTOCOL, json!(self.config.protocol.to_string())),
            ("--frames", json!(self.config.walk.folder)),
            ("--answers", json!(answers)),
        ]
    }

    fn imported_records(&self) -> &[Record<OpenDetail>] {
        &self.file_answers
    }

    fn plan(
        &self,
        phase: usize,
        records: impl FnOnce() -> Result<Vec<Record<OpenDetail>>>,
    ) -> Result<Vec<SourcePlan<OpenItem>>> {
        Ok(match phase {
            0 => plan_answers(self)?,
            _ => plan_marks(self, &records()?)?,
        })
    }

    fn expected_requests(&self, remaining: &[SourcePlan<OpenItem>]) -> Vec<ExpectedRequest> {
        if self.judge.is_none() {
            return Vec::new();
        }
        // Every missing answer may be a new one, so each is expected to need a mark.
        remaining
            .iter()
            .flat_map(|source| &source.groups)
            .flat_map(|group| &group.trials)
            .filter_map(|trial| match &trial.item {
                OpenItem::Answer(question) => {
                    let mark = OpenItem::Mark { question: Arc::clone(question), answer: ANSWER.into() };
                    Some(ExpectedRequest {
                        model: 0,
                        text_tokens: text_tokens(&mark_prompt(question, ANSWER)),
                        reply_tokens: mark.reply_tokens(),
                    })
                }
                OpenItem::Mark { .. } => None,
            })
            .collect()
    }

    fn report(&self, store: &Store<OpenDetail>, run: StoredRun<OpenDetail>, show: StdoutFormat) -> Result<Outcome> {
        open::write(store, run, show)
    }
}
