//! One request to a model: a [`Trial`] of an [`Item`] (the question), with a [`Stimulus`] (its images).

use std::sync::Arc;

use crate::ask::{ImagePlaces, Message, Query};
use crate::engine::images::notes::ImageNotes;
use crate::error::Error;
use crate::pictures::Payload;
use crate::types::{Condition, Record, TrialKey};
use darkqa_score::answers::record::Detail;

/// Subject of a trial: a question with choices, an open question, or an answer to judge.
pub(crate) trait Item: Clone + Send + Sync + 'static {
    /// Fields that this kind of item adds to a record.
    type Detail: Detail;

    /// Expected number of tokens in a reply.
    fn reply_tokens(&self) -> f64;

    /// The question, in the form for built-in models.
    fn query(&self) -> Query<'_>;

    /// Name of the source of its images. If a server refuses only requests about one source, that source may be the
    /// cause.
    fn source(&self) -> &str;

    /// Number of earlier trials of the same question (repeats), from 0.
    fn turn(&self) -> u32;

    /// The record of a trial before its outcome is known.
    fn blank(trial: &Trial<Self>, stimulus: &Stimulus, model: &str) -> Record<Self::Detail>;
}

/// One item for one model.
#[derive(Debug, Clone)]
pub(crate) struct Trial<I> {
    pub(crate) key: TrialKey,
    /// Index of the model among those of the phase.
    pub(crate) model: usize,
    pub(crate) prompt: Prompt,
    pub(crate) item: I,
}

/// The text of a trial.
#[derive(Debug, Clone)]
pub(crate) struct Prompt {
    /// Text before the images.
    pub(crate) before: Arc<str>,
    /// Text after the images; `None` if there is none.
    pub(crate) after: Option<Arc<str>>,
    /// Where the images are placed in the text.
    pub(crate) places: ImagePlaces,
}

impl Prompt {
    /// A prompt whose whole text is before the images.
    pub(crate) fn from_text(text: Arc<str>) -> Self {
        Self { before: text, after: None, places: ImagePlaces::Together }
    }

    /// A prompt whose whole text is after the images.
    pub(crate) fn after_images(text: Arc<str>) -> Self {
        Self { before: Arc::from(""), after: Some(text), places: ImagePlaces::Together }
    }

    /// The same prompt with images in these places.
    pub(crate) fn with_places(self, places: ImagePlaces) -> Self {
        Self { places, ..self }
    }

    /// The text before and after the images; the second is empty if there is none.
    pub(crate) fn parts(&self) -> [&str; 2] {
        [&self.before, self.after.as_deref().unwrap_or_default()]
    }

    pub(crate) fn message<'a>(&'a self, images: &'a [Arc<Payload>]) -> Message<'a> {
        let [before, after] = self.parts();
        Message { before, images, after, places: self.places }
    }
}

/// The images that the trials of one group share; by default none.
#[derive(Debug, Default)]
pub(crate) struct Stimulus {
    /// Condition of the images; `None` without images.
    pub(crate) condition: Option<Condition>,
    pub(crate) images: Vec<Arc<Payload>>,
}

/// A stimulus with its trials, as the image pipeline sends it.
#[derive(Debug)]
pub(crate) struct PreparedGroup<I> {
    /// Images of the group; none if one of them could not be made.
    pub(crate) stimulus: Stimulus,
    pub(crate) trials: Vec<Trial<I>>,
    /// Reason why the images could not be made; else `None`.
    pub(crate) problem: Option<Error>,
    /// Notes about the images for the report.
    pub(crate) notes: ImageNotes,
}
