//! The questions of a run ([`RunQuestion`]), stored next to its records.

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::digest::Digest;
use super::frame::FrameId;
use super::question::{Choices, Family, Question, QuestionId};
use super::strict_group::StrictGroup;
use crate::error::Error;

/// The key in [`RunQuestion::evidence`] under which a question that is asked about every image has its name among such questions.
pub const BANK_ID: &str = "bank_id";

/// One line of a run's `questions.jsonl`: a question with the scene of its frame. The file can also be used as `--questions`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct RunQuestion {
    /// The name of the question, unique in its data set.
    pub id: QuestionId,
    /// The index among all questions of the data, from 0; questions that were not asked count too.
    #[serde(default)]
    pub place: usize,
    /// The scene of the frame; empty if the data set names no scenes.
    #[serde(default)]
    pub scene: String,
    /// The frame that the question is about.
    pub frame: FrameId,
    /// The family of the question.
    pub family: Family,
    /// The text of the question, without the choices.
    #[serde(rename = "question")]
    pub text: String,
    /// The choices in the order of the data set; a record has them in the order shown.
    pub choices: Vec<String>,
    /// The text of the true choice; `None` if nobody knows it.
    pub answer: Option<String>,
    /// Further right answers; only for open questions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub extra_answers: Option<Vec<String>>,
    /// The facts from which the answer was derived.
    #[serde(default)]
    pub evidence: Value,
    /// The digest of the frame's file, or of the walk's files in the order shown. `None` if all models were blind.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub image: Option<Digest>,
    /// The frames of a question that shows several, in order; not in the file otherwise.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub images: Vec<FrameId>,
    /// The questions that this one is scored with, as `group` and `group_size`; not in the file if the data set has no groups.
    #[serde(default, flatten, skip_serializing_if = "Option::is_none")]
    pub group: Option<StrictGroup>,
}

impl RunQuestion {
    /// Whether two questions are the same, evidence and place aside; images and groups are compared if both are known.
    #[must_use]
    pub fn is_same(&self, other: &Self) -> bool {
        let words = |question: &Self| Self {
            image: None,
            group: None,
            evidence: Value::Null,
            place: 0,
            ..question.clone()
        };
        let images = self.image.zip(other.image);
        let groups = self.group.as_ref().zip(other.group.as_ref());
        words(self) == words(other)
            && images.is_none_or(|(image, other)| image == other)
            && groups.is_none_or(|(group, other)| group == other)
    }

    /// The question without its evidence, which may be ten times as large as the rest; the name in [`bank_id`](Self::bank_id) stays.
    #[must_use]
    pub fn without_evidence(mut self) -> Self {
        let bank_id = self.evidence.get_mut(BANK_ID).map(Value::take);
        self.evidence = bank_id.map_or(Value::Null, |id| serde_json::json!({ BANK_ID: id }));
        self
    }

    /// The digest of what a judge is told of the question: its words and its right answers. The same answer to two such questions has
    /// one mark.
    #[must_use]
    pub fn judged_words(&self) -> Digest {
        let answer = self.answer.as_deref().unwrap_or_default();
        let further = self.extra_answers.iter().flat_map(|answers| {
            let answers = answers.iter().map(String::as_bytes);
            std::iter::once(&b"extra"[..]).chain(answers)
        });
        let words = [self.text.as_bytes(), answer.as_bytes()].into_iter();
        Digest::of_parts(words.chain(further))
    }

    /// The name of the question among those that are asked about every image; its own name if it is about one image alone.
    #[must_use]
    pub fn bank_id(&self) -> &str {
        let bank_id = self.evidence.get(BANK_ID).and_then(Value::as_str);
        bank_id.unwrap_or(&self.id.0)
    }

    /// The stored form of a question at an index, about a frame of this scene.
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
            answer: question.choices.truth().map(|truth| choices[truth].clone()),
            extra_answers: None,
            evidence: question.evidence.clone(),
            image: None,
            images: Vec::new(),
            group: question.group.clone(),
        }
    }
    /// The question with choices that is stored.
    ///
    /// # Errors
    /// If its answer is not among its choices, or these are not the choices of a question.
    pub fn to_question(&self) -> Result<Question, Error> {
        let wrong = |problem: &dyn std::fmt::Display| {
            Error::data(format_args!("question {:?}", self.id.0), problem)
        };
        let truth = match &self.answer {
            None => None,
            Some(answer) => {
                let place = self.choices.iter().position(|choice| choice == answer);
                let problem = "its answer is not among its choices";
                Some(place.ok_or_else(|| wrong(&problem))?)
            }
        };
        let choices = Choices::known_by(self.choices.as_slice().into(), truth);
        Ok(Question {
            id: self.id.clone(),
            frame: self.frame.clone(),
            family: self.family.clone(),
            text: self.text.clone(),
            choices: choices.map_err(|e| wrong(&e))?,
            group: self.group.clone(),
            evidence: self.evidence.clone(),
        })
    }
}
