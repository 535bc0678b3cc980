//! What is asked, one at a time: a [`Trial`] of an [`Item`], about a [`Slide`].

use std::sync::Arc;

use crate::ask::{Message, Payload, Query};
use crate::types::{Condition, Detail, Record, Thumbnail, TrialKey};

/// What a trial is about: a question with choices, an open one, or an answer that is to be judged.
pub(super) trait Item: Clone + Send + Sync + 'static {
    /// What its record has beside what all have.
    type Detail: Detail;

    /// How many tokens a reply is likely to have.
    const REPLY: f64;

    /// The question, as built-in models know it.
    fn query(&self) -> Query<'_>;

    /// The frame or walk that its images are of: where refusals are about one alone, it may be at fault by itself.
    fn place(&self) -> &str;

    /// How many times the same question was put before.
    fn turn(&self) -> u32;

    /// The record of a trial for a model before anything came of it.
    fn blank(trial: &Trial<Self>, slide: &Slide, model: &str) -> Record<Self::Detail>;
}

/// One item for one model.
#[derive(Debug, Clone)]
pub(super) struct Trial<I> {
    pub(super) key: TrialKey,
    /// The model, by its place among those of the run.
    pub(super) asker: usize,
    pub(super) prompt: Prompt,
    pub(super) item: I,
}

/// The words of a trial.
#[derive(Debug, Clone)]
pub(super) struct Prompt {
    pub(super) before: Arc<str>,
    /// Those behind the images, where there are any.
    pub(super) behind: Option<Arc<str>>,
}

impl Prompt {
    /// Words alone, or before all images.
    pub(super) fn of(words: Arc<str>) -> Self {
        Self {
            before: words,
            behind: None,
        }
    }

    /// The words of both parts.
    pub(super) fn parts(&self) -> [&str; 2] {
        [&self.before, self.behind.as_deref().unwrap_or_default()]
    }

    pub(super) fn message<'a>(&'a self, images: &'a [Arc<Payload>]) -> Message<'a> {
        let [before, behind] = self.parts();
        Message {
            before,
            images,
            behind,
        }
    }
}

/// What the trials of one shot show; by default nothing.
#[derive(Debug, Default)]
pub(super) struct Slide {
    /// `None` where nothing is shown.
    pub(super) condition: Option<Condition>,
    pub(super) images: Vec<Arc<Payload>>,
}

/// A slide with its trials, as the darkroom hands it out.
#[derive(Debug)]
pub(super) struct Exposed<I> {
    /// Without its images where one could not be made.
    pub(super) slide: Slide,
    pub(super) trials: Vec<Trial<I>>,
    /// Why the images could not be made.
    pub(super) problem: Option<String>,
    /// A small copy for the report, where one is wanted.
    pub(super) thumbnail: Option<Thumbnail>,
}
