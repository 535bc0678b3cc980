//! Measurements of a frame (Φ_f of the paper, [`FrameStatistics`]) and of its segments ([`Segment`]).
//!
//! The rules use only these measurements, so changed rules do not need the images again.

mod measure;
pub(crate) mod scene_maps;
#[cfg(test)]
mod tests;

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};

use super::colors::{BINS, Color, NONE};
use super::reason::Reason;
use super::rules::{ClassFlag, RuleBook};
use darkqa_base::types::images::OTHER_PLACES;
use darkqa_base::types::{Digest, FrameId};

pub use measure::measure;

/// Version of the measurements. If it changes, all cached statistics are computed again.
pub const VERSION: u64 = 2;

/// Measurements of a frame.
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
    /// Light of the frame: a high quantile of each channel over all surfaces except windows, lamps, mirrors and
    /// screens.
    pub light: [u8; 3],
    /// Number of pixels without a class.
    pub void: u64,
    /// Number of void pixels that remain after a morphological opening, which removes thin margins between labels.
    pub effective_void: u64,
    /// Number of effective void pixels in the lower half of the frame.
    pub lower_void: u64,
    /// Number of pixels of each canonical class, including tiny segments.
    pub classes: BTreeMap<String, u64>,
    /// Number of pixels of each class that belong to no segment.
    pub loose: BTreeMap<String, u64>,
    /// Number of pixels of each class that have neither a name nor a label that identifies the object.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub unnamed: BTreeMap<String, u64>,
    /// Number of pixels of segments by word, including tiny segments.
    pub words: BTreeMap<String, u64>,
    /// Number of pixels by map number, for numbers that the label space does not have.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub unknown: BTreeMap<u16, u64>,
    /// Measurements of the depth map; `None` without one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub depth: Option<FrameDepth>,
    /// Segments that are not tiny, sorted by number.
    pub segments: Vec<Segment>,
    /// Room type stated by the data set.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub room: Option<String>,
}

/// Measurements of a depth map.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct FrameDepth {
    /// Number of pixels without depth.
    pub holes: u64,
    /// Median depth of the other pixels in millimetres, as stored in the map; 65,535 means at least that.
    pub median: u32,
    /// Direction of the depths of segments: the optical axis for planar depth without camera intrinsics, else the ray.
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

/// Measurements of a segment.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Segment {
    /// Number in the segment map. Without such a map, or if it maps parts of objects, the number of the connected
    /// component, counted row by row from 1.
    pub id: u32,
    /// Most common canonical class of the pixels; the first by name if two are equally common.
    pub class: String,
    /// Word of the data set for the segment, in lower case.
    pub word: String,
    /// Source of the word.
    #[serde(default, skip_serializing_if = "WordSource::is_name")]
    pub source: WordSource,
    /// Place of the segment, according to its word.
    #[serde(rename = "stands", default, skip_serializing_if = "SegmentPlace::is_here")]
    pub place: SegmentPlace,
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
    /// Number of core pixels, on which depth and colour are measured: the eroded mask, or the whole mask if erosion
    /// leaves nothing.
    pub core: u64,
    /// Depth of the core; `None` if no core pixel has depth.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub depth: Option<SegmentDepth>,
    /// Number of core pixels of each colour: the eleven names in order, then those without a name.
    pub colors: [u64; BINS],
    /// Median code of each channel over the core.
    pub median: [u8; 3],
    /// Light around the segment: a high quantile of luma over other surfaces near it. `None` without such surfaces.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub around: Option<u8>,
    /// Number of over-exposed core pixels.
    pub bright: u64,
    /// Number of core pixels crushed to black.
    pub crushed: u64,
}

/// Depth of a segment in millimetres: nearest-rank quantiles.
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

/// Place of a segment, according to its word.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SegmentPlace {
    /// In the same room as the camera.
    #[default]
    Here,
    /// In another room or outside, seen through an opening.
    Elsewhere,
}

/// Source of the word of a segment.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum WordSource {
    /// The name of the segment.
    #[default]
    Name,
    /// The label of its pixels, which identifies the object.
    Label,
    /// A label or name that is used for objects of several kinds.
    Coarse,
}

impl WordSource {
    #[expect(clippy::trivially_copy_pass_by_ref, reason = "serde passes a reference")]
    fn is_name(&self) -> bool {
        *self == Self::Name
    }
}

impl SegmentPlace {
    #[expect(clippy::trivially_copy_pass_by_ref, reason = "serde passes a reference")]
    fn is_here(&self) -> bool {
        *self == Self::Here
    }
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde passes a reference")]
fn is_zero(count: &usize) -> bool {
    *count == 0
}

/// Share of a part in the whole, in millionths.
#[must_use]
pub fn ppm(part: u64, whole: u64) -> u64 {
    part * 1_000_000 / whole.max(1)
}

impl FrameStatistics {
    /// Number of pixels of the frame.
    #[must_use]
    pub fn pixels(&self) -> u64 {
        (self.size[0] * self.size[1]) as u64
    }

    /// Share of a number of pixels in the frame, in millionths.
    #[must_use]
    pub fn ppm(&self, part: u64) -> u64 {
        ppm(part, self.pixels())
    }

    /// Number of pixels of a class.
    #[must_use]
    pub fn class_pixels(&self, class: &str) -> u64 {
        self.classes.get(class).copied().unwrap_or(0)
    }

    /// Area of a segment, in millionths of the frame.
    #[must_use]
    pub fn area_ppm(&self, segment: &Segment) -> u64 {
        self.ppm(segment.area)
    }

    /// True if a segment is evidence: large enough, of one class and not cut by the border.
    #[must_use]
    pub fn is_evidence(&self, segment: &Segment, book: &RuleBook) -> bool {
        self.evidence_flaw(segment, book).is_none()
    }

    /// Reason why a segment is not evidence; `None` if it is.
    #[must_use]
    pub fn evidence_flaw(&self, segment: &Segment, book: &RuleBook) -> Option<Reason> {
        let rule = &book.qualified;
        let [left, top, right, bottom] = segment.bbox;
        let side = (right - left).min(bottom - top) as u64;
        let area = self.area_ppm(segment);
        let on_border = ppm(segment.rim_on_border, segment.rim);
        if segment.place == SegmentPlace::Elsewhere {
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

    /// Segments that are evidence.
    pub fn evidence<'a>(&'a self, book: &'a RuleBook) -> impl Iterator<Item = &'a Segment> {
        self.segments.iter().filter(|segment| self.is_evidence(segment, book))
    }

    /// True if the frame has a pixel of a token, including tiny segments.
    #[must_use]
    pub fn has_token(&self, token: &str, book: &RuleBook) -> bool {
        if book.class.contains_key(token) && self.class_pixels(token) > 0 {
            return true;
        }
        // Words are looked up without a class, because tiny segments are counted by word only. A token that requires a
        // class is named after that class.
        self.words.keys().map(|word| book.token(word, "")).any(|found| found == token)
    }
}

impl Segment {
    /// True if too many pixels have other classes.
    #[must_use]
    pub fn is_mixed(&self, book: &RuleBook) -> bool {
        ppm(self.pure, self.area) < book.measure.purity_ppm
    }

    /// True if the word of the segment does not fit its class in plain English, such as a dog bed in the class bed.
    #[must_use]
    pub fn has_unfitting_word(&self, book: &RuleBook) -> bool {
        book.names.unlike.get(&self.class).is_some_and(|words| words.contains(&self.word))
    }

    /// Word that questions use for the segment; `None` if it has no specific word, or one that questions do not use.
    #[must_use]
    pub fn question_word<'a>(&self, book: &'a RuleBook) -> Option<&'a str> {
        match self.source {
            WordSource::Coarse => None,
            WordSource::Name | WordSource::Label => book.question_word(&self.class, &self.word),
        }
    }

    /// Token of the segment, given by its word and class.
    #[must_use]
    pub fn token<'a>(&'a self, book: &'a RuleBook) -> &'a str {
        book.token(&self.word, &self.class)
    }

    /// True if the segment is flat on a surface.
    #[must_use]
    pub fn is_flat(&self, book: &RuleBook) -> bool {
        book.has_flag(&self.class, ClassFlag::Flat) || book.names.flat.contains(&self.word)
    }

    /// Depth of the segment; `None` if too few core pixels have depth.
    #[must_use]
    pub fn reliable_depth(&self, book: &RuleBook) -> Option<SegmentDepth> {
        self.depth.filter(|depth| {
            depth.valid >= book.measure.valid_depth_px && ppm(depth.valid, self.core) >= book.measure.valid_depth_ppm
        })
    }

    /// Most common colour name, its number of pixels, the number of pixels of the second most common bin (a name or
    /// none), and the number of pixels without a name. If two names are equally common, the first in order counts.
    #[must_use]
    pub fn leading_color(&self) -> (Option<Color>, u64, u64, u64) {
        let mut bins: Vec<(usize, u64)> = self.colors.iter().copied().enumerate().collect();
        bins.sort_by_key(|&(bin, count)| (std::cmp::Reverse(count), bin));
        let [(first, most), (_, next), ..] = bins[..] else {
            return (None, 0, 0, 0);
        };
        (Color::ALL.get(first).copied(), most, next, self.colors[NONE])
    }
}

/// Normalizes a word of a data set (lower case, single spaces) and returns the place that it gives. The suffixes
/// `/otherroom` and `/outside` of HM3D-Sem are removed.
#[must_use]
pub fn plain_word(word: &str) -> (String, SegmentPlace) {
    let lower = word.to_lowercase();
    let mut place = SegmentPlace::Here;
    let mut rest = lower.trim();
    while let Some(before) = OTHER_PLACES.iter().find_map(|suffix| rest.strip_suffix(suffix)) {
        (rest, place) = (before.trim_end(), SegmentPlace::Elsewhere);
    }
    let words: Vec<&str> = rest.split_whitespace().collect();
    (words.join(" "), place)
}

/// Map numbers of a frame that the label space does not have.
#[must_use]
pub fn unknown_labels(statistics: &FrameStatistics) -> BTreeSet<u16> {
    statistics.unknown.keys().copied().collect()
}
