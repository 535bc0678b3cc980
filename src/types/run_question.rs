//! What a run asked, as it keeps it beside its records: [`RunQuestion`] questions and [`Thumbnail`]s of their images.

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::condition::Condition;
use super::digest::Digest;
use super::frame::FrameId;
use super::question::{Family, Question, QuestionId};

/// One line of a run's `questions.jsonl`: a question with the scene of its frame. It reads back as a file of questions, too.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct RunQuestion {
    /// The question's name.
    pub id: QuestionId,
    /// Its place among all questions of the data, those that were not asked included.
    #[serde(default)]
    pub place: usize,
    /// The scene of its frame; empty where the data set says nothing of scenes.
    #[serde(default)]
    pub scene: String,
    /// Its frame.
    pub frame: FrameId,
    /// Its kind.
    pub family: Family,
    /// The question in words.
    #[serde(rename = "question")]
    pub text: String,
    /// The choices in the order of the data set; a record has them as they were shown.
    pub choices: Vec<String>,
    /// The text of the true one.
    pub answer: String,
    /// Other answers that are right, too; of open questions alone.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub extra_answers: Option<Vec<String>>,
    /// What makes it true.
    #[serde(default)]
    pub evidence: Value,
    /// The digest of what it is about: the file of its frame, or those of its walk in the order shown. `None` if nobody was to see it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub image: Option<Digest>,
}

impl RunQuestion {
    /// Whether it asks the same as another of its name, about the same image if both say which.
    #[must_use]
    pub fn is_same(&self, other: &Self) -> bool {
        let words = |question: &Self| Self {
            image: None,
            evidence: Value::Null,
            place: 0,
            ..question.clone()
        };
        let images = self.image.zip(other.image);
        words(self) == words(other) && images.is_none_or(|(own, theirs)| own == theirs)
    }

    /// A question about a frame of this scene.
    #[must_use]
    pub fn new(question: &Question, place: usize, scene: &str) -> Self {
        let choices = question.choices.texts();
        Self {
            id: question.id.clone(),
            place,
            scene: scene.to_owned(),
            frame: question.frame.clone(),
            family: question.family.clone(),
            text: question.text.clone(),
            choices: choices.to_vec(),
            answer: choices[question.choices.truth()].clone(),
            extra_answers: None,
            evidence: question.evidence.clone(),
            image: None,
        }
    }
}

/// One line of a run's `thumbnails.jsonl`: a small copy of an image as it was sent.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Thumbnail {
    /// The frame.
    pub frame: FrameId,
    /// What was done to it.
    pub condition: Condition,
    /// The digest of the file that was sent.
    pub image: Digest,
    /// The whole of it, small, as a `data:` URL.
    pub small: String,
    /// The middle of it pixel for pixel, its light amplified, as a `data:` URL.
    pub crop: String,
    /// By how many EV the crop's light is amplified.
    pub stops: f32,
}
