//! All that the rules see of a frame, [`RuleContext`]; and what they say of it, [`RuleResult`].

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::frequency::Frequency;
use super::pick::Picker;
use super::reason::Reason;
use super::room::RoomSigns;
use super::rules::RuleBook;
use super::statistics::{FrameStatistics, Segment};
use crate::types::{Family, Labels, Question};

/// What the rules see of a frame.
#[derive(Debug, Clone, Copy)]
pub(crate) struct RuleContext<'a> {
    /// The rulebook.
    pub book: &'a RuleBook,
    /// The label space.
    pub labels: &'a Labels,
    /// What was measured.
    pub statistics: &'a FrameStatistics,
    /// What the frame says of its room.
    pub signs: &'a RoomSigns,
    /// The room that questions go by.
    pub room: Option<&'a str>,
    /// What is common where.
    pub frequency: &'a Frequency,
    /// What is picked among equals.
    pub picker: Picker<'a>,
}

/// A question that may be asked of a frame, with its one true answer.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Candidate {
    /// Its kind.
    pub family: Family,
    /// What it is about: a class, an activity, or nothing.
    pub about: String,
    /// In words.
    pub text: String,
    /// What is offered.
    pub choices: Vec<String>,
    /// The index of the true one.
    pub truth: usize,
    /// What makes it true.
    pub evidence: Value,
}

impl Candidate {
    /// The true answer.
    #[must_use]
    pub fn answer(&self) -> &str {
        self.choices.get(self.truth).map_or("", String::as_str)
    }
}

/// A question that is asked, with what it is about.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct GeneratedQuestion {
    /// The question.
    pub question: Question,
    /// What it is about: a class, an activity, or nothing.
    pub about: String,
    /// The scene of its frame.
    pub scene: String,
}

impl GeneratedQuestion {
    /// The true answer.
    #[must_use]
    pub fn answer(&self) -> &str {
        &self.question.choices.texts()[self.question.choices.truth()]
    }

    /// Its scene, its words and its answer: two with the same say the same.
    pub(super) fn said(&self) -> [String; 3] {
        [&*self.scene, &*self.question.text, self.answer()].map(str::to_owned)
    }
}

/// What a rule says of a candidate.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum RuleResult {
    /// It can be asked.
    Holds(Candidate),
    /// It cannot.
    Falls(Rejection),
}

/// A candidate that cannot be asked.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Rejection {
    /// The family it was of.
    pub family: Family,
    /// What it would have been about.
    pub about: String,
    /// The answer it would have had, where that was one of yes and no.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub answer: Option<String>,
    /// Why not.
    pub reason: Reason,
}

impl RuleContext<'_> {
    /// A claim that rests on these segments.
    pub(super) fn rests(&self, mut claim: Candidate, segments: &[&Segment]) -> RuleResult {
        let list: Vec<Value> = segments.iter().map(|segment| self.show(segment)).collect();
        if let Some(evidence) = claim.evidence.as_object_mut() {
            evidence.insert("segments".to_owned(), json!(list));
        }
        RuleResult::Holds(claim)
    }

    /// What of a segment a person needs to check it.
    fn show(&self, segment: &Segment) -> Value {
        let mut shown = json!({
            "id": segment.id,
            "class": segment.class,
            "word": segment.word,
            "area_ppm": self.statistics.area(segment),
            "bbox": segment.bbox,
        });
        if let (Some(depth), Some(shown)) = (segment.depth, shown.as_object_mut()) {
            shown.insert(
                "depth_mm".to_owned(),
                json!([depth.p10, depth.median, depth.p90]),
            );
        }
        shown
    }

    /// The segments that speak for a room.
    pub(super) fn signs_of(&self, room: &str) -> Vec<&Segment> {
        let signs = self.signs.segments.get(room);
        let segments = self.statistics.segments.iter();
        segments
            .filter(|segment| signs.is_some_and(|signs| signs.contains(&segment.id)))
            .collect()
    }

    /// What keeps anything from being said to be absent.
    pub(super) fn open_world(&self) -> Option<Reason> {
        let rule = &self.book.closed_world;
        if self.statistics.ppm(self.statistics.effective_void) > rule.void_ppm {
            Some(Reason::Void)
        } else if self.statistics.ppm(self.statistics.of_class("mirror")) > rule.mirror_ppm {
            Some(Reason::Mirror)
        } else {
            None
        }
    }

    /// Whether the data set's labels can say that there is none of a token: a class must be expressible, and a word's class
    /// is not known.
    pub(super) fn expressible(&self, token: &str) -> bool {
        !self.book.class.contains_key(token) || self.labels.expressible.contains(token)
    }
}

/// A candidate that cannot be asked.
pub(super) fn falls(
    family: Family,
    about: &str,
    answer: Option<bool>,
    reason: Reason,
) -> RuleResult {
    RuleResult::Falls(Rejection {
        family,
        about: about.to_owned(),
        answer: answer.map(|yes| YES_NO[usize::from(!yes)].to_owned()),
        reason,
    })
}

/// The choices of a question that is answered by yes or no.
pub(crate) const YES_NO: [&str; 2] = ["yes", "no"];

/// The choices of a question that is answered by yes or no.
pub(super) fn yes_no() -> Vec<String> {
    YES_NO.map(str::to_owned).to_vec()
}
