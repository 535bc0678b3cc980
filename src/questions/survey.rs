//! All that the rules see of a frame, [`Survey`]; and what they say of it, [`Verdict`].

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::frequency::Frequency;
use super::pick::Picker;
use super::room::RoomSigns;
use super::rules::Book;
use super::statistics::{FrameStatistics, Segment};
use crate::types::{Family, Labels, Question};

/// What the rules see of a frame.
#[derive(Debug, Clone, Copy)]
pub struct Survey<'a> {
    /// The rulebook.
    pub book: &'a Book,
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
pub struct Claim {
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

impl Claim {
    /// The true answer.
    #[must_use]
    pub fn answer(&self) -> &str {
        self.choices.get(self.truth).map_or("", String::as_str)
    }
}

/// A question that is asked, with what it is about.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Asked {
    /// The question.
    pub question: Question,
    /// What it is about: a class, an activity, or nothing.
    pub about: String,
    /// The scene of its frame.
    pub scene: String,
}

impl Asked {
    /// The true answer.
    #[must_use]
    pub fn answer(&self) -> &str {
        &self.question.choices.texts()[self.question.choices.truth()]
    }
}

/// What a rule says of a candidate.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Verdict {
    /// It can be asked.
    Holds(Claim),
    /// It cannot.
    Falls(Fallen),
}

/// A candidate that cannot be asked.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Fallen {
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

/// Why a candidate cannot be asked.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Reason {
    /// The frame has no room.
    NoRoom,
    /// Too little of the frame is labelled.
    Unlabelled,
    /// Too little is seen: a bare wall is no room.
    Bare,
    /// The frame's room is not the one that the answer needs.
    OtherRoom,
    /// What makes the answer true is not seen well enough.
    Unseen,
    /// What the answer denies, or what would do at a pinch, is seen.
    Seen,
    /// Too large a part of the frame has no label, so that anything may hide there.
    Void,
    /// A mirror shows what is elsewhere.
    Mirror,
    /// The data set has no label for it, so that it may hide under another.
    Inexpressible,
    /// Something is seen that may be taken for it.
    Confusable,
    /// It is rare in such rooms: the answer would be guessed without looking.
    Implausible,
    /// Its segment is in another room.
    Elsewhere,
    /// Its segment has several classes.
    Mixed,
    /// Its word is not what its class is called.
    Unlike,
    /// Its segment is too small.
    Small,
    /// Its segment is too thin.
    Thin,
    /// Its segment is cut by the frame's border.
    Cut,
    /// There are several of its class.
    NotUnique,
    /// It is over-exposed.
    Bright,
    /// It is crushed to black.
    Crushed,
    /// No colour dominates.
    Motley,
    /// Its colour has no name that people agree on.
    Nameless,
    /// Its colour is none of those offered.
    NotOffered,
    /// The frame has no depth.
    NoDepth,
    /// The frame's depths are none of a room: its scale is wrong.
    Scale,
    /// Fewer than two objects, or objects of one class only.
    Few,
    /// The two nearest are too near to each other.
    Gap,
    /// The nearest by its median is not the nearest by its near end.
    Disputed,
    /// Something that is not offered may be nearer.
    Rival,
    /// Something large has no depth.
    Unmeasured,
}

impl Survey<'_> {
    /// A claim that rests on these segments.
    pub(super) fn rests(&self, mut claim: Claim, segments: &[&Segment]) -> Verdict {
        let list: Vec<Value> = segments.iter().map(|segment| self.show(segment)).collect();
        if let Some(evidence) = claim.evidence.as_object_mut() {
            evidence.insert("segments".to_owned(), json!(list));
        }
        Verdict::Holds(claim)
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
pub(super) fn falls(family: Family, about: &str, answer: Option<bool>, reason: Reason) -> Verdict {
    Verdict::Falls(Fallen {
        family,
        about: about.to_owned(),
        answer: answer.map(|yes| YES_NO[usize::from(!yes)].to_owned()),
        reason,
    })
}

/// The choices of a question that is answered by yes or no.
pub const YES_NO: [&str; 2] = ["yes", "no"];

/// The choices of a question that is answered by yes or no.
pub(super) fn yes_no() -> Vec<String> {
    YES_NO.map(str::to_owned).to_vec()
}
