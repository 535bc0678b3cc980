//! The inputs that affect a reply, whose digest is the key of its trial: [`KeyFacts`].

use serde::Serialize;

use crate::images::trials::Prompt;
use crate::models::ModelUnderTest;
use darkqa_ask::ImagePlaces;
use darkqa_base::error::Result;
use darkqa_base::types::{Condition, Digest, QuestionId, TrialKey};

/// The inputs that affect a reply, from which the key of a trial is computed. Question and condition are included,
/// because built-in models answer by their names. The fields are sorted by name, as [`Digest::presorted`] requires.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct KeyFacts<'a> {
    before: &'a str,
    #[serde(skip_serializing_if = "Option::is_none")]
    behind: Option<&'a str>,
    /// Choices in the order shown; `None` for an open question.
    #[serde(skip_serializing_if = "Option::is_none")]
    choices: Option<&'a [String]>,
    /// Condition of the images; `None` if only text is sent.
    #[serde(skip_serializing_if = "Option::is_none")]
    condition: Option<&'a Condition>,
    /// Digest of the settings and inputs that determine the images; `None` if only text is sent.
    #[serde(skip_serializing_if = "Option::is_none")]
    image: Option<Digest>,
    model: &'a str,
    /// Digest of the settings that affect the model's replies.
    parameters: &'a str,
    /// Positions of the images in the prompt; `None` if they are together.
    #[serde(skip_serializing_if = "Option::is_none")]
    places: Option<ImagePlaces>,
    question: &'a QuestionId,
    /// Number of earlier trials with the same question; `None` for the first.
    #[serde(skip_serializing_if = "Option::is_none")]
    repeat: Option<u32>,
}

impl<'a> KeyFacts<'a> {
    /// Facts of an open question that is asked for the first time.
    pub fn new(
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
            behind: prompt.after.as_deref(),
            places: Some(prompt.places).filter(|places| *places != ImagePlaces::Together),
            choices: None,
            repeat: None,
            condition,
            image,
        }
    }

    /// Sets the choices in the order shown, and the number of earlier trials with the same question.
    #[must_use]
    pub fn with_choices(self, choices: &'a [String], repeat: u32) -> Self {
        Self { choices: Some(choices), repeat: (repeat > 0).then_some(repeat), ..self }
    }

    /// Computes the key of the trial, a digest of all facts.
    pub fn key(&self) -> Result<TrialKey> {
        Digest::presorted("darkqa.trial/2", self).map(Into::into)
    }
}
