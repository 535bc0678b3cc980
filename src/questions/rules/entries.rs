//! Tables of a rulebook. Fields without a comment are explained in `rules.toml`.

use std::collections::BTreeMap;
use std::collections::BTreeSet;

use serde::{Deserialize, Serialize};

use crate::colors::Color;

/// Thresholds for measuring a frame.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MeasureRule {
    pub border_px: usize,
    pub erosion_per_height: usize,
    pub most_depth_mm: u32,
    pub valid_depth_ppm: u64,
    pub valid_depth_px: u64,
    pub least_median_depth_mm: u32,
    pub most_median_depth_mm: u32,
    pub void_per_height: usize,
    pub purity_ppm: u64,
    pub bright: u8,
    pub crushed: u8,
    pub dark_luma: u8,
    pub detail_ppm: u64,
    pub luminous: BTreeSet<String>,
    pub light_rows: usize,
    pub light_percent: u64,
    pub around_percent: u64,
}

/// Thresholds that a segment must pass to be evidence.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EvidenceRule {
    pub area_ppm: u64,
    pub side_per_height_ppm: u64,
    pub border_ppm: u64,
    pub border_area_ppm: u64,
}

/// A property of a class.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ClassFlag {
    /// Part of the building, such as a wall.
    Structural,
    /// Flat on a surface, so never the closest object.
    Flat,
    /// Contains objects of many kinds; never asked.
    Generic,
    /// Questions name the class.
    Asked,
    /// Questions ask for the colour of the class.
    Color,
}

/// One canonical class of mpcat40.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ClassRule {
    /// Properties of the class; may be empty.
    pub flags: BTreeSet<ClassFlag>,
    /// Words that questions use for objects of the class; may be empty for classes that no question names.
    #[serde(default)]
    pub words: Vec<String>,
    /// Classes whose unnamed pixels may hide an object of this class.
    #[serde(default)]
    pub hidden: BTreeSet<String>,
}

/// Grammar and spelling of the words in questions.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GrammarRule {
    /// Words that are plural.
    pub plural: BTreeSet<String>,
    /// Words with the article "an"; the others take "a".
    pub an: BTreeSet<String>,
    /// Spelling in questions of words that data sets spell differently.
    pub spelled: BTreeMap<String, String>,
}

/// Vague words, which are used for several kinds of objects.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CoarseRule {
    /// Names of segments without information.
    pub vague: BTreeSet<String>,
    /// Words that identify an object, by label space. In a label space that is not listed, all words do.
    pub spaces: BTreeMap<String, BTreeSet<String>>,
}

impl CoarseRule {
    /// True if the name of a segment identifies the object.
    #[must_use]
    pub fn is_name(&self, name: &str) -> bool {
        !name.is_empty() && !name.starts_with("unknown") && !self.vague.contains(name)
    }

    /// True if the word of a label space identifies an object.
    #[must_use]
    pub fn identifies_object(&self, space: &str, word: &str) -> bool {
        let words = self.spaces.get(space);
        words.is_none_or(|words| words.contains(word)) && !word.is_empty()
    }
}

/// Words that change how a segment of a class is treated.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WordRules {
    /// Words whose segments are flat, regardless of their class.
    pub flat: BTreeSet<String>,
    /// Words that do not fit their class in plain English, by class.
    pub unlike: BTreeMap<String, BTreeSet<String>>,
}

/// Classes and words that may be mistaken for each other: if one is visible, none of the others can be called absent.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Confusable {
    pub classes: BTreeSet<String>,
    /// Words of segments that also belong to the group.
    #[serde(default)]
    pub names: BTreeSet<String>,
}

/// Scores that a room type needs, and the room types that questions ask about.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RoomRule {
    pub least_score: u32,
    pub least_lead: u32,
    pub order: Vec<String>,
}

/// A token: a kind of object that matters for the room type, recognized by the word and class of a segment.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TokenRule {
    /// Name of the token.
    pub token: String,
    /// Words of the data set that the token covers.
    #[serde(default)]
    pub names: BTreeSet<String>,
    /// Prefixes of words that the token covers.
    #[serde(default)]
    pub starts: Vec<String>,
    /// Class that the segment must have; `None` for any class.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub class: Option<String>,
}

/// A combination of objects that is evidence for a room type.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Clue {
    /// Room type that the clue supports.
    pub room: String,
    /// Points added to the score of the room type.
    pub weight: u32,
    /// Objects that must all be visible.
    pub seen: Vec<Sign>,
    /// Tokens that must not have a pixel in the frame.
    #[serde(default)]
    pub unseen: Vec<String>,
}

/// A token and the number of its segments that a clue needs.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sign {
    /// Token of the segments.
    pub token: String,
    /// Minimum area of a segment that counts, in millionths of the frame.
    #[serde(default)]
    pub area_ppm: u64,
    /// Minimum number of segments.
    #[serde(default = "one")]
    pub least: usize,
    /// Maximum number of segments; `None` for no limit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub most: Option<usize>,
}

fn one() -> usize {
    1
}

/// A rule that decides between two rival room types.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Contest {
    /// Room type that wins.
    pub winner: String,
    /// Room type that loses.
    pub loser: String,
    /// Minimum score of the winner.
    #[serde(default)]
    pub least_score: u32,
    /// Tokens whose areas are compared, the winner's first; `None` for no comparison.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tokens: Option<[String; 2]>,
    /// Minimum ratio of the winner's area to the other area.
    #[serde(default)]
    pub area_ratio: u64,
    /// Tokens that must not have a pixel in the frame.
    #[serde(default)]
    pub unseen: Vec<String>,
}

/// Minimum ratios of area and depth between a room and another one that is seen through a door.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Doorway {
    pub area_ratio: u64,
    pub depth_ratio_ppm: u64,
}

/// Limits for a frame in which a class or token can be called absent.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ClosedWorld {
    pub void_ppm: u64,
    pub mirror_ppm: u64,
}

/// Thresholds of "What type of room is this?"
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RoomTypeRule {
    pub text: String,
    pub labelled_ppm: u64,
    pub least_asked: usize,
    pub large_ppm: u64,
}

/// Template of "Is this room suitable for this?"
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AffordanceRule {
    pub text: String,
    pub strict: bool,
}

/// An activity that a room may be suitable for.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ActivityRule {
    /// The activity, in words that follow "I want to".
    pub activity: String,
    /// Room types where the activity is done.
    pub rooms: BTreeSet<String>,
    /// Sets of tokens; one complete set makes the activity possible.
    pub enablers: Vec<Vec<String>>,
    /// Tokens that could substitute an enabler.
    pub pinch: Vec<String>,
}

/// The thresholds of "Is there a chair in the image?"
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PresenceRule {
    pub text: String,
    pub plural: String,
    pub area_ppm: u64,
    pub purity_ppm: u64,
    pub border_ppm: u64,
    pub border_area_ppm: u64,
    pub frequent: usize,
}

/// The thresholds of "What color is the chair in the image?"
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ColorRule {
    pub text: String,
    pub plural: String,
    pub lone_ppm: u64,
    pub area_ppm: u64,
    pub eroded_px: u64,
    pub bright_ppm: u64,
    pub crushed_ppm: u64,
    pub dominant_ppm: u64,
    pub lead: u64,
    pub none_ppm: u64,
    pub view_px: u64,
    pub candidates: ColorChoices,
    pub fixed8: Vec<Color>,
    pub neighbours: Vec<[Color; 2]>,
}

/// Colours that are offered as choices.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ColorChoices {
    /// All eleven colour names.
    All11,
    /// The colours listed in `fixed8`.
    Fixed8,
    /// The answer and four colours that are unlikely to be confused with it.
    K5,
}

/// Thresholds of "Which object is closest to the camera?"
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ClosestRule {
    pub text: String,
    pub area_ppm: u64,
    pub gap_mm: u32,
    pub gap_ppm: u64,
    pub near_gap_mm: u32,
    pub gap_scope: GapScope,
    pub rival_ppm: u64,
    pub unmeasured_ppm: u64,
    pub lower_void_ppm: u64,
    pub choices: usize,
}

/// Objects between which the gap is measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum GapScope {
    /// The two nearest objects, even of the same class.
    Instances,
    /// The nearest object and the nearest one of another class.
    Classes,
}

/// Limits for balancing the answers.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BalanceRule {
    pub max_repeat: usize,
    pub least_entropy_ppm: u64,
    pub least_scenes: usize,
    pub room_type_share_ppm: u64,
    pub color_share_ppm: u64,
}
