//! The maps of a frame, as numbers: [`SceneMaps`].

use std::collections::{BTreeMap, BTreeSet};

use ndarray::{CowArray, Ix2};

use super::components::components;
use super::opening::opened;
use super::rim::runs;
use crate::error::{Error, Result};
use crate::questions::rules::MeasureRule;
use crate::types::{Frame, Labels, Segmentation};

/// A number of the semantic map that stands for nothing.
const VOID: u32 = u32::MAX;

/// What says the label of a pixel.
enum LabelSource<'a> {
    /// A semantic map.
    OfPixels(CowArray<'a, u16, Ix2>),
    /// The names of segments: the label of each mask, [`VOID`] for none, that of no mask first.
    OfMasks(Vec<u32>),
}

/// The maps of a frame, as numbers.
pub(in crate::questions) struct SceneMaps<'a> {
    pub(in crate::questions) size: [usize; 2],
    labels: &'a Labels,
    kinds: LabelSource<'a>,
    /// The mask of each pixel, from 1; 0 for none.
    pub(in crate::questions) masks: Vec<u32>,
    /// The number of each mask in the map.
    pub(in crate::questions) numbers: Vec<u32>,
    /// How many parts each mask is made of, where it is.
    pub(super) parts: Vec<usize>,
    /// The class of a number above those of a semantic map: that of a segment by its name alone.
    named: BTreeMap<u32, String>,
}

/// Where the numbers of classes begin that a segment has by its name alone.
const NAMED: u32 = 1 << 16;

impl<'a> SceneMaps<'a> {
    pub(in crate::questions) fn of(frame: &'a Frame, labels: &'a Labels) -> Result<Self> {
        let size = [frame.rgb.width(), frame.rgb.height()];
        let mut scene = Self {
            size,
            labels,
            kinds: LabelSource::OfMasks(Vec::new()),
            masks: Vec::new(),
            numbers: Vec::new(),
            parts: Vec::new(),
            named: BTreeMap::new(),
        };
        if let Some(segments) = &frame.segments {
            scene.number(plain(&segments.as_standard_layout()));
        }
        match &frame.semantic {
            Some(semantic) => {
                scene.kinds = LabelSource::OfPixels(semantic.as_standard_layout());
            }
            None if frame.segments.is_some() && !frame.names.is_empty() => scene.by_name(frame),
            None => {
                let problem = "no classes: neither a semantic map (sem) nor segments (over) with names in segments.json";
                return Err(Error::data(format_args!("frame {:?}", frame.id.0), problem));
            }
        }
        match (&frame.segments, frame.segmentation) {
            (Some(_), Segmentation::Instances) => {}
            (Some(_), Segmentation::Parts) => scene.merge(),
            (None, _) => scene.cut(),
        }
        Ok(scene)
    }

    /// Numbers the masks by their ids.
    fn number(&mut self, segments: &[u32]) {
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

    /// Gives each mask the class of its segment's name.
    fn by_name(&mut self, frame: &Frame) {
        let mut classes: BTreeMap<&str, u32> = BTreeMap::new();
        let named = self.numbers.iter().map(|number| {
            let name = frame.names.get(number);
            name.map_or(VOID, |name| {
                let next = NAMED + classes.len() as u32;
                *classes.entry(&name.canonical).or_insert(next)
            })
        });
        self.kinds = LabelSource::OfMasks(std::iter::once(VOID).chain(named).collect());
        self.named = classes
            .into_iter()
            .map(|(name, id)| (id, name.to_owned()))
            .collect();
    }

    /// Cuts the classes into connected pieces.
    fn cut(&mut self) {
        let LabelSource::OfPixels(ids) = &self.kinds else {
            return;
        };
        let label = |id| self.label(id).wrapping_add(1);
        self.masks = components(plain(ids), self.size, label);
        self.numbers = (1..=self.masks.iter().copied().max().unwrap_or(0)).collect();
    }

    /// Merges the parts of objects: neighbours whose commonest label is the same.
    fn merge(&mut self) {
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
        let labels: Vec<u32> = self
            .masks
            .iter()
            .map(|mask| modes[*mask as usize].1.wrapping_add(1))
            .collect();
        let pieces = components(&labels, self.size, |label| label);
        let count = pieces.iter().copied().max().unwrap_or(0);
        let mut parts = vec![BTreeSet::new(); count as usize];
        for (left, right) in runs(&self.masks) {
            let mut x = left;
            while x < right {
                if let Some(piece) = pieces[x].checked_sub(1) {
                    parts[piece as usize].insert(self.masks[x]);
                }
                x += pieces[x..right]
                    .iter()
                    .take_while(|piece| **piece == pieces[x])
                    .count();
            }
        }
        self.parts = parts.iter().map(BTreeSet::len).collect();
        self.masks = pieces;
        self.numbers = (1..=count).collect();
    }

    /// The label of a number of the semantic map.
    fn label(&self, id: u16) -> u32 {
        if self.labels.void.contains(&id) {
            VOID
        } else {
            id.into()
        }
    }

    /// Visits every run of pixels of one mask and one label, row by row.
    pub(super) fn each_run(&self, mut visit: impl FnMut(usize, usize, u32, u32)) {
        for y in 0..self.size[1] {
            self.each_run_of(y, &mut visit);
        }
    }

    /// Visits every run of a row.
    pub(super) fn each_run_of(&self, y: usize, visit: &mut impl FnMut(usize, usize, u32, u32)) {
        let [width, _] = self.size;
        let start = y * width;
        let masks = &self.masks[start..start + width];
        for (left, right) in runs(masks) {
            let (from, to, mask) = (start + left, start + right, masks[left]);
            match &self.kinds {
                LabelSource::OfMasks(labels) => visit(from, to, mask, labels[mask as usize]),
                LabelSource::OfPixels(ids) => {
                    let ids = &plain(ids)[from..to];
                    for (left, right) in runs(ids) {
                        visit(from + left, from + right, mask, self.label(ids[left]));
                    }
                }
            }
        }
    }

    /// The canonical class of a label; `None` for none.
    pub(super) fn class(&self, id: u32) -> Option<&str> {
        match u16::try_from(id) {
            Ok(id) => self
                .labels
                .labels
                .get(&id)
                .map(|label| label.canonical.as_str()),
            Err(_) => self.named.get(&id).map(String::as_str),
        }
    }

    /// The data set's word for a label.
    pub(super) fn word(&self, id: u32) -> &str {
        let label = u16::try_from(id)
            .ok()
            .and_then(|id| self.labels.labels.get(&id));
        label.map_or("", |label| &label.name)
    }

    /// Pixels of numbers that the label space has not.
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

    /// Pixels without a class, those that survive an opening, and those of them in the lower half.
    pub(super) fn void(&self, joint: &JointCounts, rule: &MeasureRule) -> (u64, u64, u64) {
        let [width, height] = self.size;
        let all = joint
            .iter()
            .filter(|((_, id), _)| self.class(*id).is_none());
        let all = all.map(|(_, count)| count).sum();
        if all == 0 {
            return (0, 0, 0);
        }
        let mut void = vec![false; width * height];
        self.each_run(|left, right, _, id| void[left..right].fill(self.class(id).is_none()));
        opened(&mut void, self.size, rounded(height, rule.void_per_height));
        let count = |pixels: &[bool]| pixels.iter().filter(|void| **void).count() as u64;
        (all, count(&void), count(&void[height / 2 * width..]))
    }
}

/// Pixels by mask and label.
pub(super) type JointCounts = BTreeMap<(u32, u32), u64>;

/// The numbers of a map, row by row.
fn plain<'a, T>(map: &'a CowArray<'_, T, Ix2>) -> &'a [T] {
    map.as_slice().unwrap_or_default()
}

/// A length in pixels that goes with the height: at least 1, to the nearest.
pub(super) fn rounded(height: usize, per_height: usize) -> usize {
    ((2 * height + per_height) / (2 * per_height)).max(1)
}
