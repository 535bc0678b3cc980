//! What is asked, one at a time: a [`Trial`] of an [`Item`], about a [`Stimulus`].

use std::sync::Arc;

use serde::Serialize;

use super::models::ModelUnderTest;
use crate::ask::{Message, Payload, Query};
use crate::error::Result;
use crate::types::{Condition, Detail, Digest, QuestionId, Record, Thumbnail, TrialKey};

/// What a trial is about: a question with choices, an open one, or an answer that is to be judged.
pub(crate) trait Item: Clone + Send + Sync + 'static {
    /// What is kept of it.
    type Detail: Detail;

    /// How many tokens a reply is likely to have.
    fn reply_tokens(&self) -> f64;

    /// The question, as built-in models know it.
    fn query(&self) -> Query<'_>;

    /// The frame or walk that its images are of: where refusals are about one alone, it may be at fault by itself.
    fn place(&self) -> &str;

    /// How many times the same question was put before.
    fn turn(&self) -> u32;

    /// The record of a trial for a model before anything came of it.
    fn blank(trial: &Trial<Self>, stimulus: &Stimulus, model: &str) -> Record<Self::Detail>;
}

/// One item for one model.
#[derive(Debug, Clone)]
pub(crate) struct Trial<I> {
    pub(crate) key: TrialKey,
    /// The model, by its place among those of the phase.
    pub(crate) model: usize,
    pub(crate) prompt: Prompt,
    pub(crate) item: I,
}

/// Everything that decides a reply, as it enters the key of a trial. Built-in models answer by the names of question and condition,
/// so these decide it, too.
#[derive(Debug, Clone, Copy, Serialize)]
pub(crate) struct KeyFacts<'a> {
    model: &'a str,
    /// What the model answers by.
    parameters: &'a str,
    question: &'a QuestionId,
    before: &'a str,
    behind: Option<&'a str>,
    /// The choices in the order shown; `None` if the answer is open.
    choices: Option<&'a [String]>,
    /// How many times the same was asked before; `None` the first time.
    repeat: Option<u32>,
    /// `None` if nothing is shown.
    condition: Option<&'a Condition>,
    /// The digest of all that decides the images.
    image: Option<Digest>,
}

impl<'a> KeyFacts<'a> {
    /// The facts of an open question that is asked for the first time.
    pub(crate) fn new(
        model: &'a ModelUnderTest,
        question: &'a QuestionId,
        prompt: &'a Prompt,
        condition: Option<&'a Condition>,
        image: Option<Digest>,
    ) -> Self {
        Self {
            model: model.model.name(),
            parameters: &model.digest,
            question,
            before: &prompt.before,
            behind: prompt.behind.as_deref(),
            choices: None,
            repeat: None,
            condition,
            image,
        }
    }

    /// The facts of a question with these choices, in the order shown, that was asked so many times before.
    pub(crate) fn with_choices(self, choices: &'a [String], repeat: u32) -> Self {
        Self {
            choices: Some(choices),
            repeat: (repeat > 0).then_some(repeat),
            ..self
        }
    }

    /// The key of the trial.
    pub(crate) fn key(&self) -> Result<TrialKey> {
        Digest::canonical("darkqa.trial/2", self).map(Into::into)
    }
}

/// The words of a trial.
#[derive(Debug, Clone)]
pub(crate) struct Prompt {
    pub(crate) before: Arc<str>,
    /// Those behind the images, where there are any.
    pub(crate) behind: Option<Arc<str>>,
}

impl Prompt {
    /// Words alone, or before all images.
    pub(crate) fn of(words: Arc<str>) -> Self {
        Self {
            before: words,
            behind: None,
        }
    }

    /// The words of both parts.
    pub(crate) fn parts(&self) -> [&str; 2] {
        [&self.before, self.behind.as_deref().unwrap_or_default()]
    }

    pub(crate) fn message<'a>(&'a self, images: &'a [Arc<Payload>]) -> Message<'a> {
        let [before, behind] = self.parts();
        Message {
            before,
            images,
            behind,
        }
    }
}

/// What the trials of one group show; by default nothing.
#[derive(Debug, Default)]
pub(crate) struct Stimulus {
    /// `None` where nothing is shown.
    pub(crate) condition: Option<Condition>,
    pub(crate) images: Vec<Arc<Payload>>,
}

/// A stimulus with its trials, as the image pipeline hands it out.
#[derive(Debug)]
pub(crate) struct PreparedGroup<I> {
    /// Without its images where one could not be made.
    pub(crate) stimulus: Stimulus,
    pub(crate) trials: Vec<Trial<I>>,
    /// Why the images could not be made.
    pub(crate) problem: Option<String>,
    /// A small copy for the report, where one is wanted.
    pub(crate) thumbnail: Option<Thumbnail>,
}
