//! The measurements of a frame, Φ_f of the paper: [`FrameStatistics`], and of each of its segments: [`Segment`].
//!
//! The rules see nothing else of a frame, so changed rules do not need the images again.

mod components;
mod erosion;
mod light_samples;
mod mask_core;
mod mask_shapes;
mod measure;
mod opening;
pub(crate) mod scene_maps;
#[cfg(test)]
mod tests;

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};

use super::colors::{BINS, Color, NONE};
use super::reason::Reason;
use super::rules::{ClassFlag, RuleBook};
use darkqa_ground::types::images::OTHER_PLACES;
use darkqa_ground::types::{Digest, FrameId};

pub use measure::measure;

/// Version of the measurements. If it changes, all cached statistics are computed again.
pub const VERSION: u64 = 2;

/// The measurements of a frame.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct FrameStatistics {
    /// Id of the frame.
    pub frame: FrameId,
    /// Digest of the measured files and the thresholds for measuring.
    pub key: Digest,
    /// Scene of the frame.
    pub scene: String,
    /// Width and height in pixels.
    pub size: [usize; 2],
    /// 10 %, 50 % and 90 % quantiles of luma, from 0 to 255.
    pub luma: [u8; 3],
    /// The light of the frame by its surfaces: a high quantile of each channel, without windows, lamps, mirrors and screens.
    pub light: [u8; 3],
    /// Number of pixels without a class.
    pub void: u64,
    /// Number of void pixels that remain after a morphological opening, which removes thin margins between labels.
    pub effective_void: u64,
    /// Number of effective void pixels in the lower half of the frame.
    pub lower_void: u64,
    /// Number of pixels of each canonical class, with tiny segments.
    pub classes: BTreeMap<String, u64>,
    /// Number of pixels of each class that belong to no segment.
    pub loose: BTreeMap<String, u64>,
    /// Number of pixels of each class without a word of their own: neither a name nor a label that identifies the object.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub unnamed: BTreeMap<String, u64>,
    /// Number of pixels of segments by word, with tiny segments.
    pub words: BTreeMap<String, u64>,
    /// Number of pixels by map number, for numbers that the label space does not have.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub unknown: BTreeMap<u16, u64>,
    /// Measurements of the depth map; `None` without one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub depth: Option<FrameDepth>,
    /// The segments that are not tiny, sorted by number.
    pub segments: Vec<Segment>,
    /// Room type stated by the data set.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub room: Option<String>,
}

/// The measurements of a depth map.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct FrameDepth {
    /// Number of pixels without depth.
    pub holes: u64,
    /// Median of the other pixels in millimetres, as stored in the map; 65,535 stands for that or more.
    pub median: u32,
    /// Direction of the depths of segments; the optical axis if planar depth has no known camera.
    pub along: DepthAxis,
}

/// Direction along which the depths of segments are measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DepthAxis {
    /// Along the ray through the pixel.
    Ray,
    /// Along the optical axis of the camera.
    Axis,
}

/// The measurements of a segment.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Segment {
    /// Number in the map of segments. Without such a map, or with one of parts, the number of the connected component, counted
    /// row by row from 1.
    pub id: u32,
    /// Most common canonical class of the pixels; the first by name if two are equally common.
    pub class: String,
    /// Word of the data set for the segment, in lower case.
    pub word: String,
    /// Where the word comes from.
    #[serde(default, skip_serializing_if = "WordSource::is_name")]
    pub source: WordSource,
    /// Place of the segment as its word gives it.
    #[serde(default, skip_serializing_if = "SegmentPlace::is_here")]
    pub stands: SegmentPlace,
    /// Region of the scene, if it is known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub region: Option<i64>,
    /// Number of parts that were merged, for maps of parts; else 0.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub parts: usize,
    /// Number of pixels of the whole mask.
    pub area: u64,
    /// Number of pixels that have the class of the segment.
    pub pure: u64,
    /// Left, top, right and bottom in pixels; right and bottom are exclusive.
    pub bbox: [usize; 4],
    /// Number of rim pixels: those with a 4-neighbour outside the segment or the image.
    pub rim: u64,
    /// Number of rim pixels within the border of the frame.
    pub rim_on_border: u64,
    /// Number of core pixels: the eroded mask, or the whole mask if erosion leaves nothing. Depth and colour are measured on
    /// them.
    pub core: u64,
    /// Depth of the core; `None` if no core pixel has depth.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub depth: Option<SegmentDepth>,
    /// Number of core pixels of each colour: the eleven names in order, then those without a name.
    pub colors: [u64; BINS],
    /// Median code of each channel over the core.
    pub median: [u8; 3],
    /// The light around the segment by other surfaces: a high quantile of luma near it. `None` if there are none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub around: Option<u8>,
    /// Number of over-exposed core pixels.
    pub bright: u64,
    /// Number of core pixels crushed to black.
    pub crushed: u64,
}

/// The depth of a segment in millimetres: nearest-rank quantiles.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct SegmentDepth {
    /// Number of core pixels with depth.
    pub valid: u64,
    /// 10 % quantile in millimetres.
    pub p10: u32,
    /// 50 % quantile in millimetres.
    pub median: u32,
    /// 90 % quantile in millimetres.
    pub p90: u32,
}

/// Place of a segment, as its word gives it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SegmentPlace {
    /// In the same room as the camera.
    #[default]
    Here,
    /// In another room or outside, seen through an opening.
    Elsewhere,
}

/// Where the word of a segment comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum WordSource {
    /// The segment's own name.
    #[default]
    Name,
    /// The label of its pixels, which identifies the object.
    Label,
    /// The label of its pixels, or a name, that stands for things of several kinds.
    Coarse,
}

impl WordSource {
    #[expect(clippy::trivially_copy_pass_by_ref, reason = "serde's way to call it")]
    fn is_name(&self) -> bool {
        *self == Self::Name
    }
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

/// The share of a part in the whole, in millionths.
#[must_use]
pub fn ppm(part: u64, whole: u64) -> u64 {
    part * 1_000_000 / whole.max(1)
}

impl FrameStatistics {
    /// The number of pixels of the frame.
    #[must_use]
    pub fn pixels(&self) -> u64 {
        (self.size[0] * self.size[1]) as u64
    }

    /// The share of a number of pixels in the frame, in millionths.
    #[must_use]
    pub fn ppm(&self, part: u64) -> u64 {
        ppm(part, self.pixels())
    }

    /// The number of pixels of a class.
    #[must_use]
    pub fn class_pixels(&self, class: &str) -> u64 {
        self.classes.get(class).copied().unwrap_or(0)
    }

    /// The area of a segment, in millionths of the frame.
    #[must_use]
    pub fn area_ppm(&self, segment: &Segment) -> u64 {
        self.ppm(segment.area)
    }

    /// Whether a segment is evidence: large enough, of one class and not cut by the border.
    #[must_use]
    pub fn is_evidence(&self, segment: &Segment, book: &RuleBook) -> bool {
        self.evidence_flaw(segment, book).is_none()
    }

    /// Why a segment is not evidence; `None` if it is.
    #[must_use]
    pub fn evidence_flaw(&self, segment: &Segment, book: &RuleBook) -> Option<Reason> {
        let rule = &book.qualified;
        let [left, top, right, bottom] = segment.bbox;
        let side = (right - left).min(bottom - top) as u64;
        let area = self.area_ppm(segment);
        let on_border = ppm(segment.rim_on_border, segment.rim);
        if segment.stands == SegmentPlace::Elsewhere {
            Some(Reason::Elsewhere)
        } else if segment.is_mixed(book) {
            Some(Reason::Mixed)
        } else if segment.has_unfitting_word(book) {
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
        self.segments
            .iter()
            .filter(|segment| self.is_evidence(segment, book))
    }

    /// Whether the frame has any pixel of a token, tiny segments included.
    #[must_use]
    pub fn has_token(&self, token: &str, book: &RuleBook) -> bool {
        if book.class.contains_key(token) && self.class_pixels(token) > 0 {
            return true;
        }
        // Words are looked up without a class, because tiny segments are counted by word only. A token that needs a class
        // has the name of this class.
        self.words
            .keys()
            .map(|word| book.token(word, ""))
            .any(|found| found == token)
    }
}

impl Segment {
    /// Whether too many pixels have other classes.
    #[must_use]
    pub fn is_mixed(&self, book: &RuleBook) -> bool {
        ppm(self.pure, self.area) < book.measure.purity_ppm
    }

    /// Whether the word of the segment does not fit its class in plain English.
    #[must_use]
    pub fn has_unfitting_word(&self, book: &RuleBook) -> bool {
        let words = book.names.unlike.get(&self.class);
        words.is_some_and(|words| words.contains(&self.word))
    }

    /// The word by which questions call the segment; `None` if it has no word of its own, or one that questions do not use.
    #[must_use]
    pub fn question_word<'a>(&self, book: &'a RuleBook) -> Option<&'a str> {
        match self.source {
            WordSource::Coarse => None,
            WordSource::Name | WordSource::Label => book.question_word(&self.class, &self.word),
        }
    }

    /// The token of the segment by its word and class.
    #[must_use]
    pub fn token<'a>(&'a self, book: &'a RuleBook) -> &'a str {
        book.token(&self.word, &self.class)
    }

    /// Whether the segment lies flat on a surface.
    #[must_use]
    pub fn is_flat(&self, book: &RuleBook) -> bool {
        book.has_flag(&self.class, ClassFlag::Flat) || book.names.flat.contains(&self.word)
    }

    /// The depth of the segment; `None` if too few core pixels have depth.
    #[must_use]
    pub fn reliable_depth(&self, book: &RuleBook) -> Option<SegmentDepth> {
        self.depth.filter(|depth| {
            depth.valid >= book.measure.valid_depth_px
                && ppm(depth.valid, self.core) >= book.measure.valid_depth_ppm
        })
    }

    /// The most common colour name, its number of pixels, the number of the second most common bin (a name or none), and the
    /// number without a name. If two are equally common, the first in order counts.
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

/// A word of a data set in a uniform spelling (lower case, single spaces), and the place it gives. The suffixes `/otherroom` and
/// `/outside` of HM3D-Sem are removed.
#[must_use]
pub fn plain_word(word: &str) -> (String, SegmentPlace) {
    let lower = word.to_lowercase();
    let mut place = SegmentPlace::Here;
    let mut rest = lower.trim();
    while let Some(before) = OTHER_PLACES
        .iter()
        .find_map(|suffix| rest.strip_suffix(suffix))
    {
        (rest, place) = (before.trim_end(), SegmentPlace::Elsewhere);
    }
    let words: Vec<&str> = rest.split_whitespace().collect();
    (words.join(" "), place)
}

/// The map numbers of a frame that the label space does not have.
#[must_use]
pub fn unknown_labels(statistics: &FrameStatistics) -> BTreeSet<u16> {
    statistics.unknown.keys().copied().collect()
}
