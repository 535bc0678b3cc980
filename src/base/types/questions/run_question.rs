//! The questions of a run ([`RunQuestion`]), stored next to its records.

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::question::{Choices, Family, Question, QuestionId};
use super::strict_group::StrictGroup;
use crate::error::Error;
use crate::types::images::FrameId;
use crate::types::values::Digest;

/// The key in [`RunQuestion::evidence`] with the name of a question that is asked about every image
/// ([`RunQuestion::bank_id`]).
pub const BANK_ID: &str = "bank_id";

/// One line of a run's `questions.jsonl`: a question with the scene of its frame. The file can also be used as
/// `--questions`.
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
    /// The group of questions that are scored together, written as `group` and `group_size`; not in the file if the
    /// data set has no groups.
    #[serde(default, flatten, skip_serializing_if = "Option::is_none")]
    pub group: Option<StrictGroup>,
}

/// A part of a question in which two versions of it can differ.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum QuestionPart {
    /// The words of the question.
    Text,
    /// The choices, in order.
    Choices,
    /// The right answers.
    Answer,
    /// The name of the image, or the names of several.
    Frame,
    /// The content of the image, or the way in which its file is decoded.
    Image,
    /// The family of the question.
    Family,
    /// The scene of the frame.
    Scene,
    /// The group of questions that are scored together.
    Group,
}

impl QuestionPart {
    /// The part in words.
    #[must_use]
    pub fn words(self) -> &'static str {
        match self {
            Self::Text => "text",
            Self::Choices => "choices",
            Self::Answer => "answer",
            Self::Frame => "image name",
            Self::Image => "image",
            Self::Family => "family",
            Self::Scene => "scene",
            Self::Group => "group",
        }
    }
}

impl RunQuestion {
    /// True if two questions are equal, ignoring evidence and place. Images and groups are compared only if both are
    /// known.
    #[must_use]
    pub fn is_same(&self, other: &Self) -> bool {
        self.id == other.id && self.difference(other).is_none()
    }

    /// The first part in which two questions with the same name differ; `None` if [`Self::is_same`] is true.
    #[must_use]
    pub fn difference(&self, other: &Self) -> Option<QuestionPart> {
        let images = self.image.zip(other.image);
        let groups = self.group.as_ref().zip(other.group.as_ref());
        let parts = [
            (QuestionPart::Text, self.text != other.text),
            (QuestionPart::Choices, self.choices != other.choices),
            (QuestionPart::Answer, (&self.answer, &self.extra_answers) != (&other.answer, &other.extra_answers)),
            (QuestionPart::Frame, (&self.frame, &self.images) != (&other.frame, &other.images)),
            (QuestionPart::Image, images.is_some_and(|(image, other)| image != other)),
            (QuestionPart::Family, self.family != other.family),
            (QuestionPart::Scene, self.scene != other.scene),
            (QuestionPart::Group, groups.is_some_and(|(group, other)| group != other)),
        ];
        parts.into_iter().find(|(_, differs)| *differs).map(|(part, _)| part)
    }

    /// Removes the evidence, which may be ten times as large as the rest, except the name in
    /// [`bank_id`](Self::bank_id).
    #[must_use]
    pub fn without_evidence(mut self) -> Self {
        let bank_id = self.evidence.get_mut(BANK_ID).map(Value::take);
        self.evidence = bank_id.map_or(Value::Null, |id| serde_json::json!({ BANK_ID: id }));
        self
    }

    /// Digest of the question as a judge sees it: its words and its right answers. If two questions have equal digests,
    /// the same answer to both is marked once.
    #[must_use]
    pub fn judge_digest(&self) -> Digest {
        let answer = self.answer.as_deref().unwrap_or_default();
        let further = self.extra_answers.iter().flat_map(|answers| {
            let answers = answers.iter().map(String::as_bytes);
            std::iter::once(&b"extra"[..]).chain(answers)
        });
        let words = [self.text.as_bytes(), answer.as_bytes()].into_iter();
        Digest::from_parts(words.chain(further))
    }

    /// The name of a question that is asked about every image, the same for all images; for other questions their own
    /// name.
    #[must_use]
    pub fn bank_id(&self) -> &str {
        self.evidence.get(BANK_ID).and_then(Value::as_str).unwrap_or(&self.id.0)
    }

    /// The stored form of a question; `place` is its index among all questions of the data, `scene` the scene of its
    /// frame.
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

    /// Converts the stored form into a question with choices.
    ///
    /// # Errors
    /// If the answer is not among the choices, or the choices are invalid ([`Choices::new`]).
    pub fn to_question(&self) -> Result<Question, Error> {
        let truth = match &self.answer {
            None => None,
            Some(answer) => {
                let place = self.choices.iter().position(|choice| choice == answer);
                Some(place.ok_or_else(|| self.error("its answer is not among its choices"))?)
            }
        };
        let choices = Choices::with_truth(self.choices.as_slice().into(), truth);
        Ok(Question {
            id: self.id.clone(),
            frame: self.frame.clone(),
            family: self.family.clone(),
            text: self.text.clone(),
            choices: choices.map_err(|e| self.error(e))?,
            group: self.group.clone(),
            evidence: self.evidence.clone(),
        })
    }

    fn error(&self, problem: impl std::fmt::Display) -> Error {
        Error::data(format_args!("question {:?}", self.id.0), problem)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_part_that_differs_is_named() {
        let question: RunQuestion = serde_json::from_value(serde_json::json!({
            "id": "q", "frame": "f", "family": "color", "question": "?", "choices": ["x", "y"], "answer": "x",
            "image": Digest::from_bytes(b"one"),
        }))
        .unwrap();
        assert_eq!(question.difference(&question), None);
        let change = |change: fn(&mut RunQuestion)| {
            let mut other = question.clone();
            change(&mut other);
            question.difference(&other)
        };
        for (found, part) in [
            (change(|q| q.text.push('!')), QuestionPart::Text),
            (change(|q| q.choices.swap(0, 1)), QuestionPart::Choices),
            (change(|q| q.answer = None), QuestionPart::Answer),
            (change(|q| q.frame.0.push('2')), QuestionPart::Frame),
            (change(|q| q.image = Some(Digest::from_bytes(b"two"))), QuestionPart::Image),
            (change(|q| q.scene.push('s')), QuestionPart::Scene),
        ] {
            assert_eq!(found, Some(part));
        }
        // A run with only blind models stores no image digest; the place is not compared.
        assert_eq!(change(|q| q.image = None), None);
        assert_eq!(change(|q| q.place = 7), None);
    }
}
