//! Questions, their families and the bounding boxes of the objects that they are about.
//!
//! A [`Question`] with its [`Choices`], and the [`Answer`] that is read from a reply.
//!
//! The questions of a run ([`RunQuestion`]), stored next to its records.
//!
//! Bounding boxes of the objects that a question is about: [`RunQuestion::outlines`], [`RunQuestion::object`].
//!
//! Questions that are scored together: [`StrictGroup`].

use std::borrow::Cow;
use std::fmt;
use std::sync::Arc;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::evidence::{BANK_ID, Evidence};
use super::images::FrameId;
use super::text::counted;
use super::values::Digest;
use crate::error::Error;

/// The name of a question, unique in its data set.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct QuestionId(pub String);

impl fmt::Display for QuestionId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(&self.0)
    }
}

/// The kind of a question: a family that is made by rule, or a category of a ready-made set.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Family {
    /// "What type of room is this?"
    RoomType,
    /// "I want to sleep, is this room suitable for this?"
    Affordance,
    /// "Is there a cushion in the image?"
    Presence,
    /// "What color is the sofa in the image?"
    Color,
    /// "Which object is closest to the camera?"
    Closest,
    /// A category of a ready-made set, by its name there.
    Other(String),
}

/// Facts about a family that is made by rule.
#[derive(Debug)]
pub struct FamilyRow {
    /// The family.
    pub family: Family,
    /// Its name in files and tables, and the name of its table in a rulebook.
    pub name: &'static str,
    /// Its name in reports; the paper's name for the families of the paper.
    pub title: &'static str,
    /// The choices of its questions.
    pub answers: FamilyAnswers,
    /// True if its questions are about objects, whose bounding boxes are in their evidence.
    pub has_outline: bool,
}

/// The choices of the questions of a family.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FamilyAnswers {
    /// Yes and no, balanced for each text.
    YesNo,
    /// Words of one list for all questions; a figure shows models that answer with one word only.
    List,
    /// Objects of the frame.
    Objects,
}

/// The families that are made by rule, in the order of tables: the five of the paper (arXiv 2512.24985).
pub static FAMILIES: [FamilyRow; 5] = [
    FamilyRow {
        family: Family::RoomType,
        name: "room_type",
        title: "room type",
        answers: FamilyAnswers::List,
        has_outline: false,
    },
    FamilyRow {
        family: Family::Affordance,
        name: "affordance",
        title: "room affordance",
        answers: FamilyAnswers::YesNo,
        has_outline: false,
    },
    FamilyRow {
        family: Family::Presence,
        name: "presence",
        title: "object recognition",
        answers: FamilyAnswers::YesNo,
        has_outline: true,
    },
    FamilyRow {
        family: Family::Color,
        name: "color",
        title: "object colour",
        answers: FamilyAnswers::List,
        has_outline: true,
    },
    FamilyRow {
        family: Family::Closest,
        name: "closest",
        title: "closest object",
        answers: FamilyAnswers::Objects,
        has_outline: true,
    },
];

impl Family {
    /// The name of all families together in tables and files; no family may have this name.
    pub const TOTAL: &str = "all";

    /// The families that are made by rule, in the order of tables.
    pub fn by_rule() -> impl Iterator<Item = Self> {
        FAMILIES.iter().map(|row| row.family.clone())
    }

    /// Facts about the family; `None` for a category of a ready-made set.
    #[must_use]
    pub fn row(&self) -> Option<&'static FamilyRow> {
        FAMILIES.iter().find(|row| row.family == *self)
    }

    /// Name in files and tables, from [`FAMILIES`] or from the ready-made set.
    #[must_use]
    pub fn name(&self) -> &str {
        match self {
            Self::Other(name) => name,
            family => family.row().map_or("", |row| row.name),
        }
    }

    /// The name in reports.
    #[must_use]
    pub fn title(&self) -> &str {
        self.row().map_or(self.name(), |row| row.title)
    }

    /// True for families made by rule whose answers are yes and no.
    #[must_use]
    pub fn is_yes_no(&self) -> bool {
        self.row().is_some_and(|row| row.answers == FamilyAnswers::YesNo)
    }
}

impl From<&str> for Family {
    fn from(name: &str) -> Self {
        let row = FAMILIES.iter().find(|row| row.name == name);
        row.map_or_else(|| Self::Other(name.to_owned()), |row| row.family.clone())
    }
}

impl fmt::Display for Family {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl Serialize for Family {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

impl<'de> Deserialize<'de> for Family {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Ok(Self::from(String::deserialize(deserializer)?.as_str()))
    }
}

/// The answers that a question offers, in the order shown, and the index of the true one if it is known.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Choices {
    texts: Arc<[String]>,
    truth: Option<usize>,
}

impl Choices {
    /// The maximum number of choices: one letter each.
    pub const MOST: usize = 26;

    /// Checks a list of choices: there are 2 to 26, none is empty, no two are equal (without regard to letter case and
    /// outer spaces), and `truth` is the index of one of them.
    ///
    /// # Errors
    /// [`Error::Data`] at the place `choices`.
    pub fn new(texts: Vec<String>, truth: usize) -> Result<Self, Error> {
        Self::with_truth(texts.into(), Some(truth))
    }

    /// Checks a list of choices without a known true one, as [`new`](Self::new) does.
    ///
    /// # Errors
    /// [`Error::Data`] at the place `choices`.
    pub fn without_truth(texts: Vec<String>) -> Result<Self, Error> {
        Self::with_truth(texts.into(), None)
    }

    /// Checks a list of choices with the index of the true one, or `None` if nobody knows it.
    ///
    /// # Errors
    /// [`Error::Data`] at the place `choices`.
    pub fn with_truth(texts: Arc<[String]>, truth: Option<usize>) -> Result<Self, Error> {
        if !(2..=Self::MOST).contains(&texts.len()) {
            return choices_error(format!("{}: a question needs 2 to {}", counted(texts.len(), "choice"), Self::MOST));
        }
        if let Some(truth) = truth.filter(|truth| *truth >= texts.len()) {
            return choices_error(format!("the answer is choice {} of {}", truth + 1, texts.len()));
        }
        let folded: Vec<String> = texts.iter().map(|text| text.trim().to_lowercase()).collect();
        for (i, text) in folded.iter().enumerate() {
            if text.is_empty() {
                return choices_error(format!("choice {} is empty", letter(i)));
            }
            if let Some(j) = folded[..i].iter().position(|earlier| earlier == text) {
                return choices_error(format!("choices {} and {} are both {:?}", letter(j), letter(i), texts[i]));
            }
        }
        Ok(Self { texts, truth })
    }

    /// The choices in the order shown.
    #[must_use]
    pub fn texts(&self) -> &[String] {
        &self.texts
    }

    /// The index of the true choice; `None` if nobody knows it, so that a reply is neither right nor wrong.
    #[must_use]
    pub fn truth(&self) -> Option<usize> {
        self.truth
    }

    /// The number of choices, at least 2.
    #[must_use]
    #[expect(clippy::len_without_is_empty, reason = "there are always two")]
    pub fn len(&self) -> usize {
        self.texts.len()
    }
}

/// The text of the choice "not enough is visible". A choice with these words, in any letter case, is not a wrong answer
/// but an abstention.
pub const CANNOT_TELL: &str = "cannot tell";

/// Whether the true answers to the questions of a run are known: of all of its questions, or of none.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Truths {
    /// Every question has a true answer: replies are right or wrong.
    Known,
    /// No true answer is known: a model is compared with its own answers at L0.
    Unknown,
}

fn choices_error(problem: String) -> Result<Choices, Error> {
    Err(Error::data("choices", problem))
}

/// The letter of the choice at an index: 0 is `A`.
#[must_use]
pub fn letter(index: usize) -> char {
    char::from(b'A' + (index % Choices::MOST) as u8)
}

/// One multiple-choice question about one frame.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Question {
    /// The name of the question, unique in its data set.
    pub id: QuestionId,
    /// The frame that the question is about.
    pub frame: FrameId,
    /// The family of the question.
    pub family: Family,
    /// The text of the question, without the choices.
    pub text: String,
    /// The answers that the model may choose from.
    pub choices: Choices,
    /// The group of questions that are scored together; `None` if the data set has no groups.
    pub group: Option<StrictGroup>,
    /// The facts from which the generator derived the answer.
    pub evidence: Evidence,
}

/// The answer that is read from a reply.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Answer {
    /// A choice, by its index.
    Chosen(usize),
    /// No readable choice; a choice is never guessed.
    Unparsed(UnreadReason),
}

/// The reason why no choice could be read from a reply.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum UnreadReason {
    /// The reply was empty.
    Empty,
    /// The model refused to answer.
    Refused,
    /// The reply was cut at the token limit before an answer.
    Truncated,
    /// A content filter withheld the reply.
    Filtered,
    /// More than one choice was named.
    Ambiguous,
    /// The reply named a letter that no choice has.
    OutOfRange,
    /// The reply named the letter of one choice with the text of another.
    Contradiction,
    /// The reply named one choice only to deny it.
    Negated,
    /// No choice was named in a form that the parsing accepts.
    NoChoice,
    /// A person said that they cannot tell.
    CannotTell,
}

impl UnreadReason {
    /// All reasons, in the order of tables.
    pub const ALL: [Self; 10] = [
        Self::Empty,
        Self::Refused,
        Self::Truncated,
        Self::Filtered,
        Self::Ambiguous,
        Self::OutOfRange,
        Self::Contradiction,
        Self::Negated,
        Self::NoChoice,
        Self::CannotTell,
    ];
}

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
    pub evidence: Evidence,
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
        let bank_id = self.evidence.bank_id().map(|id| serde_json::json!({ BANK_ID: id }));
        self.evidence = bank_id.map(Evidence::from).unwrap_or_default();
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
    pub fn bank_id(&self) -> Cow<'_, str> {
        self.evidence.bank_id().unwrap_or(Cow::Borrowed(&self.id.0))
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

/// A bounding box in pixels of a frame: left, top, right, bottom.
pub type PixelBox = [u32; 4];

impl RunQuestion {
    /// Bounding boxes of the objects in the question's evidence: all segments with the word asked about, or all
    /// candidates for the closest object. Empty for questions about the whole room or without evidence.
    #[must_use]
    pub fn outlines(&self) -> Vec<PixelBox> {
        let evidence = self.evidence.value();
        let about = evidence.get("about").and_then(Value::as_str).filter(|about| !about.is_empty());
        evidence
            .get("segments")
            .and_then(Value::as_array)
            .into_iter()
            .flatten()
            .filter(|segment| match (&self.family, about) {
                (Family::Closest, _) => true,
                (_, about) => about.is_some() && segment.get("word").and_then(Value::as_str) == about,
            })
            .filter_map(|segment| pixel_box(segment.get("bbox")?))
            .collect()
    }

    /// The smallest box around all of [`Self::outlines`]; `None` if there are none.
    #[must_use]
    pub fn object(&self) -> Option<PixelBox> {
        around(&self.outlines())
    }
}

/// The smallest box around all of these; `None` if there are none.
#[must_use]
pub fn around(boxes: &[PixelBox]) -> Option<PixelBox> {
    boxes
        .iter()
        .copied()
        .reduce(|one, other| [one[0].min(other[0]), one[1].min(other[1]), one[2].max(other[2]), one[3].max(other[3])])
}

/// Parses a box of evidence; `None` if the value is not a box.
fn pixel_box(value: &Value) -> Option<PixelBox> {
    let numbers: Option<Vec<u32>> =
        value.as_array()?.iter().map(|number| u32::try_from(number.as_u64()?).ok()).collect();
    let pixels: PixelBox = numbers?.try_into().ok()?;
    (pixels[0] < pixels[2] && pixels[1] < pixels[3]).then_some(pixels)
}

/// The group of a question in the strict score of its benchmark: a group is correct if all its questions are answered
/// correctly, as MME scores the two questions about an image (Fu et al. 2023, arXiv:2306.13394, section 2.2,
/// "accuracy+").
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct StrictGroup {
    /// The name of the group, unique in its data set.
    #[serde(rename = "group")]
    pub name: String,
    /// The number of questions in the group, at least 1; questions that cannot be asked count too.
    #[serde(rename = "group_size")]
    pub size: usize,
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn texts(texts: &[&str]) -> Vec<String> {
        texts.iter().map(|&text| text.to_owned()).collect()
    }

    #[test]
    fn choices_are_checked() {
        assert!(Choices::new(texts(&["yes", "no"]), 1).is_ok());
        let unknown = Choices::without_truth(texts(&["yes", "no"])).unwrap();
        assert_eq!(unknown.truth(), None);
        assert!(Choices::without_truth(texts(&["yes", " Yes "])).is_err());
        for (list, truth) in [
            (vec!["yes"], 0),
            (vec!["yes", "no"], 2),
            (vec!["yes", " Yes "], 0),
            (vec!["yes", ""], 0),
            (vec!["x"; 27], 0),
        ] {
            assert!(Choices::new(texts(&list), truth).is_err(), "{list:?} {truth}");
        }
    }

    #[test]
    fn families_read_back() {
        for family in Family::by_rule().chain([Family::Other("OCR".into())]) {
            assert_eq!(Family::from(family.name()), family);
        }
    }

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

    fn question(family: Family, evidence: impl Into<Evidence>) -> RunQuestion {
        let line =
            json!({"id": "q", "frame": "f", "family": "other", "question": "?", "choices": ["a", "b"], "answer": "a"});
        RunQuestion { family, evidence: evidence.into(), ..serde_json::from_value(line).unwrap() }
    }

    #[test]
    fn the_thing_asked_about_has_a_box() {
        let segments = json!([
            {"word": "sink", "bbox": [10, 20, 30, 40]},
            {"word": "bed", "bbox": [0, 0, 5, 5]},
            {"word": "sink", "bbox": [50, 10, 60, 30]},
            {"word": "sink", "bbox": [9, 9, 9, 12]},
            {"word": "sink", "bbox": "everywhere"},
        ]);
        let sink = question(Family::Presence, json!({"about": "sink", "segments": segments}));
        assert_eq!(sink.outlines(), [[10, 20, 30, 40], [50, 10, 60, 30]]);
        assert_eq!(sink.object(), Some([10, 10, 60, 40]));
        let closest = question(Family::Closest, json!({"about": "", "segments": segments}));
        assert_eq!(closest.object(), Some([0, 0, 60, 40]));
        for whole in
            [json!({"about": "", "segments": segments}), json!({"about": "lamp", "segments": segments}), Value::Null]
        {
            assert_eq!(question(Family::RoomType, whole).object(), None);
        }
    }
}
