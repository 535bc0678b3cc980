//! The entries of a rulebook.

use std::collections::BTreeMap;
use std::collections::BTreeSet;

use serde::{Deserialize, Serialize};

use crate::questions::colors::Color;

/// What is measured of a frame.
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
}

/// What makes a segment evidence.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[expect(
    clippy::struct_field_names,
    reason = "the names are those of rules.toml"
)]
pub struct EvidenceRule {
    pub area_ppm: u64,
    pub side_per_height_ppm: u64,
    pub border_ppm: u64,
    pub border_area_ppm: u64,
}

/// What a class is like.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ClassFlag {
    /// Part of the building.
    Structural,
    /// On a surface: never the closest object.
    Flat,
    /// Never asked, may hide anything.
    Generic,
    /// Questions name it.
    Asked,
    /// Its colour is asked.
    Color,
}

/// One canonical class.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ClassRule {
    /// What it is called in a question; the class itself where it is not said.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// Its article; "a" where it is not said.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub article: Option<String>,
    /// What it is like.
    pub flags: BTreeSet<ClassFlag>,
}

/// What words add to classes.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WordRules {
    /// Flat whatever their class.
    pub flat: BTreeSet<String>,
    /// Words that a class does not cover in plain speech.
    pub unlike: BTreeMap<String, BTreeSet<String>>,
}

/// A group of which one hides the absence of another.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Confusable {
    /// Its classes.
    pub classes: BTreeSet<String>,
    /// Words of segments that belong to it, too.
    #[serde(default)]
    pub names: BTreeSet<String>,
}

/// When a room has a type.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RoomRule {
    pub least_score: u32,
    pub least_lead: u32,
    pub order: Vec<String>,
}

/// What a segment says of its room, by its word.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TokenRule {
    /// The token.
    pub token: String,
    /// The words it stands for.
    #[serde(default)]
    pub names: BTreeSet<String>,
    /// The beginnings of words it stands for.
    #[serde(default)]
    pub starts: Vec<String>,
    /// The class that the segment must have.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub class: Option<String>,
}

/// What speaks for a room.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Clue {
    /// The room.
    pub room: String,
    /// How strongly.
    pub weight: u32,
    /// What must be seen.
    pub seen: Vec<Sign>,
    /// What may not be anywhere.
    #[serde(default)]
    pub unseen: Vec<String>,
}

/// A token that must be seen so often.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sign {
    /// The token.
    pub token: String,
    /// The least area of a segment that counts.
    #[serde(default)]
    pub area_ppm: u64,
    /// How many of them at least.
    #[serde(default = "one")]
    pub least: usize,
    /// How many of them at most.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub most: Option<usize>,
}

fn one() -> usize {
    1
}

/// Which of two rooms wins.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Contest {
    /// The room that wins.
    pub winner: String,
    /// The one it wins against.
    pub loser: String,
    /// The score that the winner needs.
    #[serde(default)]
    pub least_score: u32,
    /// The tokens whose areas are compared, the winner's first.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tokens: Option<[String; 2]>,
    /// How many times as large the winner's must be.
    #[serde(default)]
    pub area_ratio: u64,
    /// What may not be anywhere.
    #[serde(default)]
    pub unseen: Vec<String>,
}

/// A room seen through a door.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Doorway {
    pub area_ratio: u64,
    pub depth_ratio_ppm: u64,
}

/// What must hold before anything is said to be absent.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ClosedWorld {
    pub void_ppm: u64,
    pub mirror_ppm: u64,
}

/// The thresholds of "What type of room is this?"
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RoomTypeRule {
    pub text: String,
    pub labelled_ppm: u64,
    pub least_asked: usize,
    pub large_ppm: u64,
}

/// The template of "Is this room suitable for this?"
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AffordanceRule {
    pub text: String,
    pub strict: bool,
}

/// What a room may be suitable for.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ActivityRule {
    /// In words that follow "I want to".
    pub activity: String,
    /// The rooms where it is done.
    pub rooms: BTreeSet<String>,
    /// Sets of tokens, any one of which makes it possible.
    pub enablers: Vec<Vec<String>>,
    /// What would do at a pinch.
    pub pinch: Vec<String>,
}

/// The thresholds of "Is there a chair in the image?"
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PresenceRule {
    pub text: String,
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
    pub lone_ppm: u64,
    pub area_ppm: u64,
    pub eroded_px: u64,
    pub bright_ppm: u64,
    pub crushed_ppm: u64,
    pub dominant_ppm: u64,
    pub lead: u64,
    pub none_ppm: u64,
    pub candidates: ColorChoices,
    pub fixed8: Vec<Color>,
    pub neighbours: Vec<[Color; 2]>,
}

/// Which colours are offered.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ColorChoices {
    /// All eleven names.
    All11,
    /// The eight of `fixed8`.
    Fixed8,
    /// The answer and four that are no neighbours of it.
    K5,
}

/// The thresholds of "Which object is closest to the camera?"
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

/// Between which objects the gap is measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum GapScope {
    /// The two nearest.
    Instances,
    /// The nearest, and the nearest of another class.
    Classes,
}

/// How the answers are evened out.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BalanceRule {
    pub max_repeat: usize,
    pub least_entropy_ppm: u64,
    pub least_scenes: usize,
    pub room_type_share_ppm: u64,
    pub color_share_ppm: u64,
}
