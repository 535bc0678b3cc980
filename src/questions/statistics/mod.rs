//! What is measured of a frame, Φ_f of the paper: [`FrameStatistics`], and of each of its segments: [`Segment`].
//!
//! The rules see nothing else of a frame, so that they can be changed without opening an image again.

mod components;
mod light;
mod measure;
mod opening;
mod rim;
pub(in crate::questions) mod scene;
mod shape;
#[cfg(test)]
mod tests;

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};

use super::colors::{BINS, Color, NONE};
use super::reason::Reason;
use super::rules::{ClassFlag, RuleBook};
use crate::types::{Digest, FrameId};

pub use measure::measure;

/// What is measured, and how. A change of it makes every kept statistic anew.
pub(crate) const VERSION: u64 = 1;

/// What is measured of a frame.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct FrameStatistics {
    /// The frame.
    pub frame: FrameId,
    /// The content of all that was measured, with the thresholds of measuring.
    pub key: Digest,
    /// The scene it is a view of.
    pub scene: String,
    /// Width and height in pixels.
    pub size: [usize; 2],
    /// The 10 %, 50 % and 90 % quantiles of luma.
    pub luma: [u8; 3],
    /// Pixels without a class.
    pub void: u64,
    /// Those of them that survive an opening: more than a margin between two labels.
    pub effective_void: u64,
    /// Those of them in the lower half.
    pub lower_void: u64,
    /// Pixels of each canonical class, the smallest segments' too.
    pub classes: BTreeMap<String, u64>,
    /// Those of them that belong to no segment.
    pub loose: BTreeMap<String, u64>,
    /// Pixels of segments by their own word, the smallest too.
    pub words: BTreeMap<String, u64>,
    /// Pixels of numbers that the label space has not, by number.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub unknown: BTreeMap<u16, u64>,
    /// What is known of depth.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub depth: Option<FrameDepth>,
    /// The segments that are not tiny, by number.
    pub segments: Vec<Segment>,
    /// The type of the room, where a person has said it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub room: Option<String>,
}

/// What is known of a frame's depth.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct FrameDepth {
    /// Pixels without depth.
    pub holes: u64,
    /// The median of the others in millimetres, as they lie in the map; 65,535 stands for that or more.
    pub median: u32,
    /// Whether segments' depths are distances along rays; along the axis, where the camera is unknown.
    pub along: DepthAxis,
}

/// What the depths of segments are measured along.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DepthAxis {
    /// The ray through the pixel.
    Ray,
    /// The optical axis.
    Axis,
}

/// What is measured of a segment.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Segment {
    /// Its number in the map; where the frame has no map of segments, or one of parts, the number of the connected piece of
    /// one class, row by row from 1.
    pub id: u32,
    /// The canonical class that most of it has; the first by name where two are as common.
    pub class: String,
    /// The data set's own word for it, in lower case.
    pub word: String,
    /// Whether the word says that it is in another room or outside.
    #[serde(default, skip_serializing_if = "SegmentPlace::is_here")]
    pub stands: SegmentPlace,
    /// The region of the scene, where that is known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub region: Option<i64>,
    /// How many parts of an over-segmentation it is made of; 0 where there were none.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub parts: usize,
    /// Its pixels.
    pub area: u64,
    /// Those of them that have its class.
    pub pure: u64,
    /// Left, top, right and bottom, the latter two exclusive.
    pub bbox: [usize; 4],
    /// Pixels of its rim: those with a 4-neighbour outside of it or of the image.
    pub rim: u64,
    /// Those of them within the frame's border.
    pub rim_on_border: u64,
    /// Pixels of the eroded mask, or of the whole where that is empty: depth and colour are theirs.
    pub core: u64,
    /// Their depth.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub depth: Option<SegmentDepth>,
    /// How many of them have each colour: the eleven names in their order, then none.
    pub colors: [u64; BINS],
    /// The median of each channel.
    pub median: [u8; 3],
    /// Over-exposed pixels.
    pub bright: u64,
    /// Crushed pixels.
    pub crushed: u64,
}

/// The depth of a segment in millimetres: nearest-rank quantiles.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct SegmentDepth {
    /// Pixels that have one.
    pub valid: u64,
    /// The nearest tenth.
    pub p10: u32,
    /// The median.
    pub median: u32,
    /// The farthest tenth.
    pub p90: u32,
}

/// Where a segment stands, by its word.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SegmentPlace {
    /// In the room.
    #[default]
    Here,
    /// In another room, or outside: seen through an opening.
    Elsewhere,
}

impl SegmentPlace {
    #[expect(clippy::trivially_copy_pass_by_ref, reason = "serde's way to call it")]
    fn is_here(&self) -> bool {
        *self == Self::Here
    }
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde's way to call it")]
fn is_zero(count: &usize) -> bool {
    *count == 0
}

/// A share in millionths.
#[must_use]
pub(crate) fn ppm(part: u64, whole: u64) -> u64 {
    part * 1_000_000 / whole.max(1)
}

impl FrameStatistics {
    /// All pixels.
    #[must_use]
    pub fn pixels(&self) -> u64 {
        (self.size[0] * self.size[1]) as u64
    }

    /// A share of all pixels in millionths.
    #[must_use]
    pub fn ppm(&self, part: u64) -> u64 {
        ppm(part, self.pixels())
    }

    /// The pixels of a class.
    #[must_use]
    pub fn of_class(&self, class: &str) -> u64 {
        self.classes.get(class).copied().unwrap_or(0)
    }

    /// The area of a segment in millionths.
    #[must_use]
    pub fn area(&self, segment: &Segment) -> u64 {
        self.ppm(segment.area)
    }

    /// Whether a segment is large, pure and whole enough to be evidence.
    #[must_use]
    pub fn qualified(&self, segment: &Segment, book: &RuleBook) -> bool {
        self.disqualified(segment, book).is_none()
    }

    /// Why a segment is no evidence; `None` where it is.
    #[must_use]
    pub fn disqualified(&self, segment: &Segment, book: &RuleBook) -> Option<Reason> {
        let rule = &book.qualified;
        let [left, top, right, bottom] = segment.bbox;
        let side = (right - left).min(bottom - top) as u64;
        let area = self.area(segment);
        let on_border = ppm(segment.rim_on_border, segment.rim);
        if segment.stands == SegmentPlace::Elsewhere {
            Some(Reason::Elsewhere)
        } else if segment.mixed(book) {
            Some(Reason::Mixed)
        } else if segment.unlike(book) {
            Some(Reason::Unlike)
        } else if area < rule.area_ppm {
            Some(Reason::Small)
        } else if ppm(side, self.size[1] as u64) < rule.side_per_height_ppm {
            Some(Reason::Thin)
        } else if on_border > rule.border_ppm && area < rule.border_area_ppm {
            Some(Reason::Cut)
        } else {
            None
        }
    }

    /// The segments that are evidence.
    pub fn evidence<'a>(&'a self, book: &'a RuleBook) -> impl Iterator<Item = &'a Segment> {
        let segments = self.segments.iter();
        segments.filter(|segment| self.qualified(segment, book))
    }

    /// Whether any pixel of a token is in the picture, the smallest segments' too.
    #[must_use]
    pub fn shows(&self, token: &str, book: &RuleBook) -> bool {
        if book.class.contains_key(token) && self.of_class(token) > 0 {
            return true;
        }
        // A word of a tiny segment is looked up without its class: a token that needs one is named as it.
        let words = self.words.keys();
        let mut tokens = words.map(|word| book.token(word, ""));
        tokens.any(|found| found == token)
    }
}

impl Segment {
    /// Whether too much of it is of other classes.
    #[must_use]
    pub fn mixed(&self, book: &RuleBook) -> bool {
        ppm(self.pure, self.area) < book.measure.purity_ppm
    }

    /// Whether its class does not cover it in plain words.
    #[must_use]
    pub fn unlike(&self, book: &RuleBook) -> bool {
        let words = book.names.unlike.get(&self.class);
        words.is_some_and(|words| words.contains(&self.word))
    }

    /// Its token.
    #[must_use]
    pub fn token<'a>(&'a self, book: &'a RuleBook) -> &'a str {
        book.token(&self.word, &self.class)
    }

    /// Whether it lies on a surface.
    #[must_use]
    pub fn flat(&self, book: &RuleBook) -> bool {
        book.is(&self.class, ClassFlag::Flat) || book.names.flat.contains(&self.word)
    }

    /// Its depth, where enough of it has one.
    #[must_use]
    pub fn measured(&self, book: &RuleBook) -> Option<SegmentDepth> {
        self.depth.filter(|depth| {
            depth.valid >= book.measure.valid_depth_px
                && ppm(depth.valid, self.core) >= book.measure.valid_depth_ppm
        })
    }

    /// The commonest name of its colours with its pixels, those of the next (a name or none), and those without a name; the
    /// first name by order where two are as common.
    #[must_use]
    pub fn leading_color(&self) -> (Option<Color>, u64, u64, u64) {
        let mut bins: Vec<(usize, u64)> = self.colors.iter().copied().enumerate().collect();
        bins.sort_by_key(|&(bin, count)| (std::cmp::Reverse(count), bin));
        let [(first, most), (_, next), ..] = bins[..] else {
            return (None, 0, 0, 0);
        };
        (
            Color::ALL.get(first).copied(),
            most,
            next,
            self.colors[NONE],
        )
    }
}

/// A data set's word in its one spelling, and where it says that the thing stands: lower case, single spaces, without the
/// suffixes `/otherroom` and `/outside` of HM3D-Sem.
#[must_use]
pub(crate) fn plain_word(word: &str) -> (String, SegmentPlace) {
    let lower = word.to_lowercase();
    let mut stands = SegmentPlace::Here;
    let mut rest = lower.trim();
    while let Some(before) = [
        "/otherroom",
        "/ otherroom",
        "/other room",
        "/outside",
        "/ outside",
    ]
    .iter()
    .find_map(|suffix| rest.strip_suffix(suffix))
    {
        (rest, stands) = (before.trim_end(), SegmentPlace::Elsewhere);
    }
    let words: Vec<&str> = rest.split_whitespace().collect();
    (words.join(" "), stands)
}

/// The label numbers of a frame that its label space has not.
#[must_use]
pub(crate) fn strangers(statistics: &FrameStatistics) -> BTreeSet<u16> {
    statistics.unknown.keys().copied().collect()
}
