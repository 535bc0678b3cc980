//! The inputs that affect a reply, whose digest is the key of its trial: [`KeyHead`].

use serde::Serialize;

use crate::images::trials::Prompt;
use crate::models::ModelUnderTest;
use darkqa_ask::ImagePlaces;
use darkqa_base::error::Result;
use darkqa_base::types::{Condition, Digest, QuestionId, TrialKey};

/// Name of the digest.
const DOMAIN: &str = "darkqa.trial/2";

/// The inputs that all trials of a question in one wording share, as text that is written once.
///
/// The digest is that of one JSON object with the fields of [`HeadFacts`] and [`TailFacts`], which are sorted by name, as
/// [`Digest::presorted`] requires.
#[derive(Debug, Clone)]
pub struct KeyHead(String);

#[derive(Debug, Serialize)]
struct HeadFacts<'a> {
    before: &'a str,
    #[serde(skip_serializing_if = "Option::is_none")]
    behind: Option<&'a str>,
    /// Choices in the order shown; `None` for an open question.
    #[serde(skip_serializing_if = "Option::is_none")]
    choices: Option<&'a [String]>,
}

/// The inputs that differ between the trials of a question. Question and condition are included, because built-in models
/// answer by their names.
#[derive(Debug, Serialize)]
struct TailFacts<'a> {
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

/// A question as one trial asks it.
#[derive(Debug, Clone, Copy)]
pub struct Asked<'a> {
    pub question: &'a QuestionId,
    /// Positions of the images in the prompt.
    pub places: ImagePlaces,
    /// Condition of the images; `None` if only text is sent.
    pub condition: Option<&'a Condition>,
    /// Digest of the settings and inputs that determine the images; `None` if only text is sent.
    pub image: Option<Digest>,
    /// Number of earlier trials with the same question.
    pub repeat: u32,
}

impl KeyHead {
    /// The words of a question, with the choices in the order shown; `None` for an open question.
    ///
    /// # Errors
    /// Never in practice: texts can be written as JSON.
    pub fn new(prompt: &Prompt, choices: Option<&[String]>) -> Result<Self> {
        let facts = HeadFacts { before: &prompt.before, behind: prompt.after.as_deref(), choices };
        Digest::presorted_text(DOMAIN, &facts).map(Self)
    }

    /// Computes the key of a trial, a digest of all inputs.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn key(&self, model: &ModelUnderTest, asked: Asked<'_>) -> Result<TrialKey> {
        let facts = TailFacts {
            condition: asked.condition,
            image: asked.image,
            model: model.model.name(),
            parameters: &model.digest,
            places: Some(asked.places).filter(|places| *places != ImagePlaces::Together),
            question: asked.question,
            repeat: (asked.repeat > 0).then_some(asked.repeat),
        };
        Digest::presorted_after(DOMAIN, &self.0, &facts).map(Into::into)
    }
}
