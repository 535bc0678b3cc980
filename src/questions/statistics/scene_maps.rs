//! Masks and labels of the pixels of a frame: [`SceneMaps`].

use std::collections::{BTreeMap, BTreeSet};

use ndarray::{CowArray, Ix2};

use super::components::components;
use super::erosion::runs;
use super::opening::open_mask;
use super::plain_word;
use crate::rules::{CoarseRule, MeasureRule};
use darkqa_base::error::{Error, Result};
use darkqa_base::types::{Frame, Labels, Segmentation};

/// Label of pixels without a class.
const VOID: u32 = u32::MAX;

/// Source of the labels of pixels.
enum LabelSource<'a> {
    /// A semantic map, which gives each pixel a label.
    SemanticMap(CowArray<'a, u16, Ix2>),
    /// The names of segments: the label of each mask, or [`VOID`]. Index 0 is for pixels without a mask.
    SegmentNames(Vec<u32>),
}

/// Mask and label of each pixel of a frame.
pub(crate) struct SceneMaps<'a> {
    pub(crate) size: [usize; 2],
    pub(super) labels: &'a Labels,
    source: LabelSource<'a>,
    /// Mask of each pixel, from 1; 0 without a mask.
    pub(crate) masks: Vec<u32>,
    /// Number of each mask in the segment map.
    pub(crate) numbers: Vec<u32>,
    /// Number of parts of each mask; empty unless the map has parts.
    pub(super) parts: Vec<usize>,
    /// Class of each label from [`FIRST_NAMED`] on.
    named: BTreeMap<u32, String>,
}

/// First label of segments whose class comes from their name only; labels of semantic maps have 16 bits.
const FIRST_NAMED: u32 = 1 << 16;

impl<'a> SceneMaps<'a> {
    pub(crate) fn new(frame: &'a Frame, labels: &'a Labels) -> Result<Self> {
        let size = [frame.rgb.width(), frame.rgb.height()];
        let mut scene = Self {
            size,
            labels,
            source: LabelSource::SegmentNames(Vec::new()),
            masks: Vec::new(),
            numbers: Vec::new(),
            parts: Vec::new(),
            named: BTreeMap::new(),
        };
        if let Some(segments) = &frame.segments {
            scene.number_masks(values(&segments.as_standard_layout()));
        }
        match &frame.semantic {
            Some(semantic) => {
                scene.source = LabelSource::SemanticMap(semantic.as_standard_layout());
            }
            None if frame.segments.is_some() && !frame.names.is_empty() => {
                scene.label_by_name(frame);
            }
            None => {
                let problem =
                    "no classes: neither a semantic map (sem) nor segments (over) with names in segments.json";
                return Err(Error::data(format_args!("frame {:?}", frame.id.0), problem));
            }
        }
        match (&frame.segments, frame.segmentation) {
            (Some(_), Segmentation::Instances) => {}
            (Some(_), Segmentation::Parts) => scene.merge_parts(),
            (None, _) => scene.split_labels(),
        }
        Ok(scene)
    }

    /// Numbers the masks from 1, in the order of their numbers in the segment map.
    fn number_masks(&mut self, segments: &[u32]) {
        let mut ids = BTreeMap::new();
        for (left, _) in runs(segments) {
            if segments[left] != 0 {
                ids.insert(segments[left], 0);
            }
        }
        for (mask, id) in (1..).zip(ids.values_mut()) {
            *id = mask;
        }
        self.masks = vec![0; segments.len()];
        for (left, right) in runs(segments) {
            let mask = ids.get(&segments[left]).copied().unwrap_or(0);
            self.masks[left..right].fill(mask);
        }
        self.numbers = ids.into_keys().collect();
    }

    /// Labels each mask with the class of the name of its segment.
    fn label_by_name(&mut self, frame: &Frame) {
        let mut classes: BTreeMap<&str, u32> = BTreeMap::new();
        let named = self.numbers.iter().map(|number| {
            frame.names.get(number).map_or(VOID, |name| {
                let next = FIRST_NAMED + classes.len() as u32;
                *classes.entry(&name.canonical).or_insert(next)
            })
        });
        self.source = LabelSource::SegmentNames(std::iter::once(VOID).chain(named).collect());
        self.named = classes.into_iter().map(|(name, id)| (id, name.to_owned())).collect();
    }

    /// Makes a mask of each connected component of a label.
    fn split_labels(&mut self) {
        let LabelSource::SemanticMap(ids) = &self.source else {
            return;
        };
        self.masks = components(values(ids), self.size, |id| self.label(id).wrapping_add(1));
        self.numbers = (1..=self.masks.iter().copied().max().unwrap_or(0)).collect();
    }

    /// Merges the parts of objects: neighbouring masks whose most common label is the same.
    fn merge_parts(&mut self) {
        let mut joint = JointCounts::new();
        self.each_run(|left, right, mask, id| {
            *joint.entry((mask, id)).or_insert(0) += (right - left) as u64;
        });
        let mut modes = vec![(0, VOID); self.numbers.len() + 1];
        for ((mask, id), count) in joint {
            let mode = &mut modes[mask as usize];
            if count > mode.0 {
                *mode = (count, id);
            }
        }
        modes[0].1 = VOID;
        let labels: Vec<u32> = self.masks.iter().map(|mask| modes[*mask as usize].1.wrapping_add(1)).collect();
        let pieces = components(&labels, self.size, |label| label);
        let count = pieces.iter().copied().max().unwrap_or(0);
        let mut parts = vec![BTreeSet::new(); count as usize];
        for (left, right) in runs(&self.masks) {
            let mut x = left;
            while x < right {
                if let Some(piece) = pieces[x].checked_sub(1) {
                    parts[piece as usize].insert(self.masks[x]);
                }
                x += pieces[x..right].iter().take_while(|piece| **piece == pieces[x]).count();
            }
        }
        self.parts = parts.iter().map(BTreeSet::len).collect();
        self.masks = pieces;
        self.numbers = (1..=count).collect();
    }

    /// Label of a number of the semantic map; [`VOID`] for void numbers.
    fn label(&self, id: u16) -> u32 {
        if self.labels.void.contains(&id) { VOID } else { id.into() }
    }

    /// Visits every run of pixels of one mask and one label, row by row, as left, right (exclusive), mask and label.
    pub(super) fn each_run(&self, mut visit: impl FnMut(usize, usize, u32, u32)) {
        for y in 0..self.size[1] {
            self.each_run_in_row(y, &mut visit);
        }
    }

    /// Visits every run of pixels of one mask and one label in a row, as left, right (exclusive), mask and label.
    pub(super) fn each_run_in_row(&self, y: usize, visit: &mut impl FnMut(usize, usize, u32, u32)) {
        let [width, _] = self.size;
        let start = y * width;
        let masks = &self.masks[start..start + width];
        for (left, right) in runs(masks) {
            let (from, to, mask) = (start + left, start + right, masks[left]);
            match &self.source {
                LabelSource::SegmentNames(labels) => visit(from, to, mask, labels[mask as usize]),
                LabelSource::SemanticMap(ids) => {
                    let ids = &values(ids)[from..to];
                    for (left, right) in runs(ids) {
                        visit(from + left, from + right, mask, self.label(ids[left]));
                    }
                }
            }
        }
    }

    /// Canonical class of a label; `None` if it has no class.
    pub(super) fn class(&self, id: u32) -> Option<&str> {
        match u16::try_from(id) {
            Ok(id) => self.labels.labels.get(&id).map(|label| label.canonical.as_str()),
            Err(_) => self.named.get(&id).map(String::as_str),
        }
    }

    /// Word of the data set for a label; may be empty.
    pub(super) fn word(&self, id: u32) -> &str {
        let label = u16::try_from(id).ok().and_then(|id| self.labels.labels.get(&id));
        label.map_or("", |label| &label.name)
    }

    /// True if pixels of a mask and a label have a specific word: the name of their segment, or a label that identifies
    /// the object.
    pub(super) fn is_named(&self, frame: &Frame, mask: u32, id: u32, coarse: &CoarseRule) -> bool {
        let number = (mask as usize).checked_sub(1).and_then(|mask| self.numbers.get(mask));
        let name = match (&frame.segments, frame.segmentation) {
            (Some(_), Segmentation::Instances) => number.and_then(|number| frame.names.get(number)),
            _ => None,
        };
        match name {
            Some(name) => coarse.is_name(&plain_word(&name.name).0),
            None => coarse.identifies_object(&self.labels.space, &plain_word(self.word(id)).0),
        }
    }

    /// Number of pixels of each map number that the label space does not have.
    pub(super) fn unknown(&self, joint: &JointCounts) -> BTreeMap<u16, u64> {
        let mut unknown = BTreeMap::new();
        for (&(_, id), count) in joint {
            if let Ok(id) = u16::try_from(id)
                && !self.labels.labels.contains_key(&id)
            {
                *unknown.entry(id).or_insert(0) += count;
            }
        }
        unknown
    }

    /// Numbers of pixels without a class: of all pixels, after a morphological opening, and after the opening in the
    /// lower half of the frame.
    pub(super) fn void(&self, joint: &JointCounts, rule: &MeasureRule) -> (u64, u64, u64) {
        let [width, height] = self.size;
        let all = joint.iter().filter(|((_, id), _)| self.class(*id).is_none()).map(|(_, count)| count).sum();
        if all == 0 {
            return (0, 0, 0);
        }
        let mut void = vec![false; width * height];
        self.each_run(|left, right, _, id| void[left..right].fill(self.class(id).is_none()));
        open_mask(&mut void, self.size, scaled_length(height, rule.void_per_height));
        let [wide, lower] =
            [&void[..], &void[height / 2 * width..]].map(|pixels| pixels.iter().filter(|void| **void).count() as u64);
        (all, wide, lower)
    }
}

/// Number of pixels by mask and label.
pub(super) type JointCounts = BTreeMap<(u32, u32), u64>;

/// Values of a map, row by row.
fn values<'a, T>(map: &'a CowArray<'_, T, Ix2>) -> &'a [T] {
    map.as_slice().unwrap_or_default()
}

/// Length in pixels, proportional to the height: round(height / per_height), at least 1.
pub(super) fn scaled_length(height: usize, per_height: usize) -> usize {
    ((2 * height + per_height) / (2 * per_height)).max(1)
}
