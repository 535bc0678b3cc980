//! The [`Experiment`] of open questions and of marks for the answers.
//!
//! The trials of the models: [`plan_answers`].
//!
//! The trials of the judge: [`plan_marks`].

use std::collections::{BTreeMap, HashMap, HashSet};
use std::sync::Arc;

use serde_json::{Value, json};

use super::record::OpenItem;
use super::setup::OpenSetup;
use darkqa_ask::ImagePlaces;
use darkqa_ask::prompts::{blind, judge_prompt, vision};
use darkqa_base::error::Result;
use darkqa_base::types::manifests::{Columns, Identity, JUDGES, PartPlace};
use darkqa_base::types::{
    Condition, Digest, Evidence, Family, FrameId, OpenDetail, QuestionId, Record, RunQuestion, TrialKey, View,
};
use darkqa_data::openeqa::OpenQuestion;
use darkqa_engine::costs::text_tokens;
use darkqa_engine::experiment::{ExpectedRequest, Experiment};
use darkqa_engine::images::frames::{Frames, Source};
use darkqa_engine::images::recipes::Recipe;
use darkqa_engine::images::trials::{Item as _, Prompt, SourcePlan, Trial, TrialGroup};
use darkqa_engine::key_facts::{Asked, KeyHead};
use darkqa_engine::manifest;
use darkqa_engine::models::{ModelUnderTest, asked_in};
use darkqa_engine::settings::JobSettings;
use darkqa_report::joined::written;
use darkqa_runs::mark_index::{JUDGE, PROTOCOL};
use darkqa_runs::predictions::{AnswerState, predictions};
use darkqa_runs::stored::StoredRun;
use darkqa_runs::{Outcome, StdoutFormat};
use darkqa_score::choice::llm_match::Protocol;
use darkqa_store::Store;

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
                    evidence: Evidence::default(),
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
            .chain(manifest::images(&self.recipe))
            .collect()
    }

    fn columns(&self) -> Columns {
        let mut columns = manifest::columns(&self.models, &self.recipe, &self.config.job);
        if let Some(judge) = &self.judge {
            // A model that is its own judge may have other settings as a judge.
            let content = || BTreeMap::from([(judge.name.to_string(), manifest::model_definition(judge))]);
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

    fn each_source(
        &self,
        phase: usize,
        records: impl FnOnce() -> Result<Vec<Record<OpenDetail>>>,
        add: &mut dyn FnMut(SourcePlan<OpenItem>),
    ) -> Result<()> {
        let sources = match phase {
            0 => plan_answers(self)?,
            _ => plan_marks(self, &records()?)?,
        };
        sources.into_iter().for_each(add);
        Ok(())
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
        written::write_open(store, run, show)
    }
}

/// The trials of all answers, grouped by walk: first those without images, then those of each condition.
fn plan_answers(setup: &OpenSetup<'_>) -> Result<Vec<SourcePlan<OpenItem>>> {
    let mut by_walk = BTreeMap::<&str, Vec<&Arc<OpenQuestion>>>::new();
    for question in &setup.questions {
        by_walk.entry(&question.episode).or_default().push(question);
    }
    setup
        .sources
        .iter()
        .enumerate()
        .map(|(source, walk)| {
            let questions = by_walk.remove(&*walk.name.0).unwrap_or_default();
            let groups = std::iter::once(None)
                .chain(setup.conditions.iter().map(Some))
                .filter_map(|condition| group(setup, source, condition, &questions).transpose());
            Ok(SourcePlan { source, groups: groups.collect::<Result<_>>()? })
        })
        .collect()
}

/// The trials in a condition; `None` if no model is asked in it.
fn group(
    setup: &OpenSetup<'_>,
    source: usize,
    condition: Option<&Condition>,
    questions: &[&Arc<OpenQuestion>],
) -> Result<Option<TrialGroup<OpenItem>>> {
    let view = condition.map_or(View::Blind, |_| View::Image);
    let models = asked_in(&setup.models, condition);
    if models.is_empty() {
        return Ok(None);
    }
    let walk = &setup.sources[source];
    let images = condition.map(|condition| setup.recipe.stimulus_digest(walk, condition));
    let images: Option<Digest> = images.transpose()?;
    let mut trials = Vec::new();
    for question in questions {
        let prompt = prompt(question, view);
        let key_head = KeyHead::new(&prompt, None)?;
        let asked = Asked { question: &question.id, places: prompt.places, condition, image: images, repeat: 0 };
        let place = setup.question_places[&question.id];
        for &(index, model) in models.iter().filter(|(_, model)| model.is_asked(place)) {
            trials.push(Trial {
                key: key_head.key(model, asked)?,
                model: index,
                prompt: prompt.clone(),
                item: OpenItem::Answer(Arc::clone(question)),
            });
        }
    }
    Ok(Some(TrialGroup { condition: condition.cloned(), trials }))
}

/// The prompt of a question, for a model with images or a blind one.
fn prompt(question: &OpenQuestion, view: View) -> Prompt {
    match view {
        View::Blind => Prompt::from_text(blind(&question.text).into()),
        View::Image => {
            let (before, behind) = vision(&question.text);
            Prompt { before: before.into(), after: Some(behind.into()), places: ImagePlaces::Together }
        }
    }
}

/// The prompt that asks the judge to mark an answer.
fn mark_prompt(question: &OpenQuestion, answer: &str) -> Prompt {
    let extra = question.extra.as_deref();
    Prompt::from_text(judge_prompt(&question.text, &question.answer, extra, answer).into())
}

/// The key of a mark. It does not depend on model and condition, so that the same answer to a question is judged once.
fn mark_key(judge: &ModelUnderTest, prompt: &Prompt) -> Result<TrialKey> {
    let facts = (judge.model.name(), &*judge.digest, &*prompt.before);
    Digest::canonical("darkqa.mark/2", &facts).map(Into::into)
}

/// The trials for all marks of a run, grouped by walk. Each distinct answer to a question is marked once.
fn plan_marks(setup: &OpenSetup<'_>, records: &[Record<OpenDetail>]) -> Result<Vec<SourcePlan<OpenItem>>> {
    let Some(judge) = &setup.judge else {
        return Ok(Vec::new());
    };
    let ids: Vec<&QuestionId> = setup.questions.iter().map(|question| &question.id).collect();
    let mut by_walk: Vec<Vec<Trial<OpenItem>>> = Vec::new();
    by_walk.resize_with(setup.sources.len(), Vec::new);
    let mut planned = HashSet::new();
    for prediction in predictions(records, &ids, setup.config.protocol) {
        let AnswerState::Text { answer, .. } = prediction.state else {
            continue;
        };
        let question = &setup.questions[prediction.question];
        let prompt = mark_prompt(question, &answer);
        let key = mark_key(judge, &prompt)?;
        if planned.insert(key) {
            by_walk[setup.walk_of(question)].push(Trial {
                key,
                model: 0,
                prompt,
                item: OpenItem::Mark { question: Arc::clone(question), answer },
            });
        }
    }
    Ok(by_walk
        .into_iter()
        .enumerate()
        .map(|(source, trials)| SourcePlan { source, groups: vec![TrialGroup { condition: None, trials }] })
        .collect())
}
