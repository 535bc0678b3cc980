//! Input of the rules for one frame, [`RuleContext`], and their output, [`RuleResult`].
//!
//! Picks that look random but depend only on the frame and the purpose: [`Picker`].

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::frequency::Frequency;
use super::reason::Reason;
use super::room::{RoomSigns, Views};
use super::rules::RuleBook;
use super::statistics::{FrameStatistics, Segment};
use super::vocabulary::Vocabulary;
use darkqa_base::types::{Digest, Family, FrameId, Labels, Question};

/// Input of the rules for one frame.
#[derive(Debug, Clone, Copy)]
pub struct RuleContext<'a> {
    pub book: &'a RuleBook,
    pub labels: &'a Labels,
    pub statistics: &'a FrameStatistics,
    pub signs: &'a RoomSigns,
    /// Room type of the frame, from `signs` or from the data set; `None` if it is unknown or if questions do not ask
    /// about it.
    pub room: Option<&'a str>,
    /// Room type of the frame, even if questions do not ask about it, such as a laundry room.
    pub any_room: Option<&'a str>,
    /// Classes that are common in each type of room.
    pub frequency: &'a Frequency,
    /// Words that the data set uses for objects.
    pub vocabulary: &'a Vocabulary,
    /// Colours of objects in all views of their scenes.
    pub views: &'a Views,
    /// Picks among equally good candidates.
    pub picker: Picker<'a>,
}

/// A question that may be asked of a frame, with its true answer.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Candidate {
    pub family: Family,
    /// Subject of the question: a class or an activity; empty for the room type.
    pub about: String,
    pub text: String,
    /// The choices in the order in which they are offered.
    pub choices: Vec<String>,
    /// Index of the true choice.
    pub truth: usize,
    /// Measurements that make the answer true, as a JSON object.
    pub evidence: Value,
}

impl Candidate {
    /// The text of the true choice.
    #[must_use]
    pub fn answer(&self) -> &str {
        self.choices.get(self.truth).map_or("", String::as_str)
    }
}

/// A question that is asked, with its subject and scene.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct GeneratedQuestion {
    /// The question, with its id, choices and evidence.
    pub question: Question,
    /// Subject of the question: a class or an activity; empty for the room type.
    pub about: String,
    /// Scene of the frame.
    pub scene: String,
}

impl GeneratedQuestion {
    /// The text of the true choice.
    #[must_use]
    pub fn answer(&self) -> &str {
        self.question.choices.truth().map_or("", |truth| &self.question.choices.texts()[truth])
    }

    /// Scene, text and answer; two questions that share all three repeat each other.
    pub(super) fn repeat_key(&self) -> [String; 3] {
        [&*self.scene, &*self.question.text, self.answer()].map(str::to_owned)
    }
}

/// Result of a rule for one candidate.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum RuleResult {
    /// The question can be asked.
    Viable(Candidate),
    /// The question cannot be asked.
    Rejected(Rejection),
}

/// A candidate that cannot be asked.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Rejection {
    pub family: Family,
    /// Subject of the question: a class or an activity; may be empty.
    pub about: String,
    /// Answer of the rejected question, "yes" or "no"; `None` for other families.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub answer: Option<String>,
    /// Why the question cannot be asked.
    pub reason: Reason,
}

impl RuleContext<'_> {
    /// Returns a viable candidate, with these segments added to its evidence.
    pub(super) fn viable(&self, mut candidate: Candidate, segments: &[&Segment]) -> RuleResult {
        let list: Vec<Value> = segments.iter().map(|segment| self.segment_json(segment)).collect();
        if let Some(evidence) = candidate.evidence.as_object_mut() {
            evidence.insert("segments".to_owned(), json!(list));
        }
        RuleResult::Viable(candidate)
    }

    /// JSON object of the facts that a person needs to check a segment.
    fn segment_json(&self, segment: &Segment) -> Value {
        let mut json = json!({
            "id": segment.id,
            "class": segment.class,
            "word": segment.word,
            "area_ppm": self.statistics.area_ppm(segment),
            "bbox": segment.bbox,
        });
        if let (Some(depth), Some(json)) = (segment.depth, json.as_object_mut()) {
            json.insert("depth_mm".to_owned(), json!([depth.p10, depth.median, depth.p90]));
        }
        json
    }

    /// Segments that are evidence for a room type.
    pub(super) fn room_evidence(&self, room: &str) -> Vec<&Segment> {
        let signs = self.signs.segments.get(room);
        self.statistics
            .segments
            .iter()
            .filter(|segment| signs.is_some_and(|signs| signs.contains(&segment.id)))
            .collect()
    }

    /// Reason why nothing in this frame can be called absent; `None` if absence can be shown.
    pub(super) fn absence_blocker(&self) -> Option<Reason> {
        let rule = &self.book.closed_world;
        if self.statistics.ppm(self.statistics.effective_void) > rule.void_ppm {
            Some(Reason::Void)
        } else if self.statistics.ppm(self.statistics.class_pixels("mirror")) > rule.mirror_ppm {
            Some(Reason::Mirror)
        } else {
            None
        }
    }

    /// True if an object of a class may be hidden among the unnamed pixels of a coarse class. False for a token that is
    /// a word.
    pub(super) fn may_be_hidden(&self, class: &str) -> bool {
        self.book
            .class
            .get(class)
            .map(|rule| &rule.hidden)
            .into_iter()
            .flatten()
            .any(|other| self.statistics.unnamed.contains_key(other))
    }

    /// True if the labels of the data set can show that a token is absent. A class must be expressible; a token that is
    /// a word always passes, because its class is unknown.
    pub(super) fn is_expressible(&self, token: &str) -> bool {
        !self.book.class.contains_key(token) || self.labels.expressible.contains(token)
    }
}

/// Returns the result for a candidate that cannot be asked; `answer` is true for "yes".
pub(super) fn rejected(family: Family, about: &str, answer: Option<bool>, reason: Reason) -> RuleResult {
    RuleResult::Rejected(Rejection {
        family,
        about: about.to_owned(),
        answer: answer.map(|yes| YES_NO[usize::from(!yes)].to_owned()),
        reason,
    })
}

/// The choices of a yes-no question, in the order in which they are offered.
pub const YES_NO: [&str; 2] = ["yes", "no"];

/// [`YES_NO`] as owned strings.
pub(super) fn yes_no() -> Vec<String> {
    YES_NO.map(str::to_owned).to_vec()
}

/// Prefix of every digest; changing it changes all questions.
const DOMAIN: &[u8] = b"darkqa-eval questions 1";

/// Pseudo-random picks for one frame.
///
/// There is no state: a pick is the BLAKE3 digest of seed, data set, frame, family and purpose, scaled to the range.
/// The order of the frames therefore does not matter.
#[derive(Debug, Clone, Copy)]
pub struct Picker<'a> {
    /// Seed of the rulebook.
    pub seed: u64,
    /// Name of the data set.
    pub dataset: &'a str,
    pub frame: &'a FrameId,
}

impl Picker<'_> {
    /// Returns the first 64 bits of the digest for a purpose.
    #[must_use]
    pub fn bits(&self, family: &str, purpose: &str) -> u64 {
        let seed = self.seed.to_le_bytes();
        let parts =
            [DOMAIN, &seed, self.dataset.as_bytes(), self.frame.0.as_bytes(), family.as_bytes(), purpose.as_bytes()];
        Digest::from_parts(parts).as_bytes().iter().take(8).fold(0, |bits, byte| (bits << 8) | u64::from(*byte))
    }

    /// Picks a number from 0 to `count` − 1; `count` must be above 0.
    #[must_use]
    pub fn pick(&self, family: &str, purpose: &str, count: usize) -> usize {
        ((u128::from(self.bits(family, purpose)) * count as u128) >> 64) as usize
    }

    /// Shuffles a list; all orders are equally likely (Fisher–Yates).
    pub fn shuffle<T>(&self, family: &str, list: &mut [T]) {
        for last in (1..list.len()).rev() {
            let other = self.pick(family, &format!("shuffle {last}"), last + 1);
            list.swap(last, other);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn picks_are_even_and_pinned() {
        let mut counts = [0; 6];
        let mut orders = std::collections::BTreeMap::new();
        for i in 0..6_000 {
            let frame = FrameId(format!("scene/{i}"));
            let picker = Picker { seed: 0, dataset: "d", frame: &frame };
            counts[picker.pick("color", "segment", 6)] += 1;
            let mut list = [0, 1, 2];
            picker.shuffle("closest", &mut list);
            *orders.entry(list).or_insert(0) += 1;
        }
        // Expected: 1,000 each, with a standard deviation of 29.
        assert!(counts.iter().all(|count| (880..1120).contains(count)), "{counts:?}");
        assert_eq!(orders.len(), 6);
        assert!(orders.values().all(|count| (880..1120).contains(count)), "{orders:?}");
        let frame = FrameId("scene/0".into());
        let picker = Picker { seed: 0, dataset: "d", frame: &frame };
        assert_eq!(picker.bits("color", "segment"), 13977079698431977642);
    }

    #[test]
    fn every_part_counts() {
        let (here, there) = (FrameId("a".into()), FrameId("b".into()));
        let one = Picker { seed: 0, dataset: "d", frame: &here };
        let bits = one.bits("color", "x");
        for other in [Picker { seed: 1, ..one }, Picker { dataset: "e", ..one }, Picker { frame: &there, ..one }] {
            assert_ne!(bits, other.bits("color", "x"));
        }
        assert_ne!(bits, one.bits("closest", "x"));
        assert_ne!(bits, one.bits("color", "y"));
    }
}
