//! What is asked, one at a time: a [`Trial`] of an [`Item`], about a [`Stimulus`].

use std::sync::Arc;

use super::models::ModelUnderTest;
use crate::ask::{Message, Payload, Query};
use crate::error::Result;
use crate::types::{
    Condition, Digest, Failure, Kept, QuestionId, Reply, Thumbnail, TrialKey, View,
};

/// What a trial is about: a question with choices, an open one, or an answer that is to be judged.
pub(crate) trait Item: Clone + Send + Sync + 'static {
    /// What is kept of it.
    type Record: Entry;

    /// How many tokens a reply is likely to have.
    fn reply_tokens(&self) -> f64;

    /// The question, as built-in models know it.
    fn query(&self) -> Query<'_>;

    /// The frame or walk that its images are of: where refusals are about one alone, it may be at fault by itself.
    fn place(&self) -> &str;

    /// How many times the same question was put before.
    fn turn(&self) -> u32;

    /// The record of a trial for a model before anything came of it.
    fn blank(trial: &Trial<Self>, stimulus: &Stimulus, model: &str) -> Self::Record;
}

/// A record that something comes of.
pub(crate) trait Entry: Kept + Send {
    /// The model that was asked.
    fn model(&self) -> &str;

    /// What was asked.
    fn question(&self) -> &QuestionId;

    /// What was shown; `None` for words alone.
    fn condition(&self) -> Option<&Condition>;

    /// How many times the same was asked before.
    fn repeat(&self) -> u32;

    /// How many choices the question had; 0 if the answer is open.
    fn choices(&self) -> usize;

    /// The record with the reply and what is read from it.
    fn answered(self, reply: Reply) -> Result<Self>;

    /// The record with what went wrong after so many requests.
    fn failed_by(self, failure: Failure, attempts: u32) -> Self;

    /// The record as one that was asked in a batch.
    fn batched(self) -> Self;
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
#[derive(Debug, Clone, Copy)]
pub(crate) struct KeyFacts<'a> {
    pub(crate) model: &'a str,
    /// What the model answers by.
    pub(crate) parameters: &'a str,
    pub(crate) question: &'a str,
    pub(crate) before: &'a str,
    pub(crate) behind: &'a str,
    /// The choices in the order shown; none if the answer is open.
    pub(crate) choices: &'a [String],
    pub(crate) repeat: u32,
    /// `None` if nothing is shown.
    pub(crate) condition: Option<&'a Condition>,
    /// The digest of all that decides the images.
    pub(crate) image: Option<Digest>,
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
        let [before, behind] = prompt.parts();
        Self {
            model: model.model.name(),
            parameters: &model.digest,
            question: &question.0,
            before,
            behind,
            choices: &[],
            repeat: 0,
            condition,
            image,
        }
    }

    /// The key of the trial.
    pub(crate) fn key(&self) -> TrialKey {
        let text = format!("{self:?}");
        Digest::of(text.as_bytes()).into()
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

impl Stimulus {
    pub(crate) fn view(&self) -> View {
        if self.condition.is_some() {
            View::Image
        } else {
            View::Blind
        }
    }
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
