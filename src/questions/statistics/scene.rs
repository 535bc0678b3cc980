//! The maps of a frame, as numbers: [`Scene`].

use std::collections::{BTreeMap, BTreeSet};

use super::components::components;
use super::opening::opened;
use super::rim::runs;
use crate::error::{Error, Result};
use crate::questions::rules::Measure;
use crate::types::{Frame, Labels, Segmentation};

/// A number of the semantic map that stands for nothing.
const VOID: u32 = u32::MAX;

/// The maps of a frame, as numbers.
pub(super) struct Scene<'a> {
    pub(super) size: [usize; 2],
    labels: &'a Labels,
    /// The label of each pixel; [`VOID`] for none.
    pub(super) ids: Vec<u32>,
    /// The mask of each pixel, from 1; 0 for none.
    pub(super) masks: Vec<u32>,
    /// The number of each mask in the map.
    pub(super) numbers: Vec<u32>,
    /// How many parts each mask is made of, where it is.
    pub(super) parts: Vec<usize>,
    /// The class of a number above those of a semantic map: that of a segment by its name alone.
    named: BTreeMap<u32, String>,
}

/// Where the numbers of classes begin that a segment has by its name alone.
const NAMED: u32 = 1 << 16;

impl<'a> Scene<'a> {
    pub(super) fn of(frame: &Frame, labels: &'a Labels) -> Result<Self> {
        let size = [frame.rgb.width(), frame.rgb.height()];
        let mut scene = Self {
            size,
            labels,
            ids: Vec::new(),
            masks: Vec::new(),
            numbers: Vec::new(),
            parts: Vec::new(),
            named: BTreeMap::new(),
        };
        if let Some(segments) = &frame.segments {
            scene.number(&segments.iter().copied().collect::<Vec<_>>());
        }
        match &frame.semantic {
            Some(semantic) => {
                let void: Vec<bool> = (0..=u16::MAX).map(|id| labels.void.contains(&id)).collect();
                scene.ids = semantic
                    .iter()
                    .map(|&id| {
                        if void[usize::from(id)] {
                            VOID
                        } else {
                            id.into()
                        }
                    })
                    .collect();
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

    /// Gives each pixel the class of its segment's name.
    fn by_name(&mut self, frame: &Frame) {
        let mut classes: BTreeMap<&str, u32> = BTreeMap::new();
        let of_mask: Vec<u32> = self
            .numbers
            .iter()
            .map(|number| match frame.names.get(number) {
                None => VOID,
                Some(name) => {
                    let next = NAMED + classes.len() as u32;
                    *classes.entry(&name.canonical).or_insert(next)
                }
            })
            .collect();
        let mask = |mask: &u32| match mask.checked_sub(1) {
            None => VOID,
            Some(mask) => of_mask[mask as usize],
        };
        self.ids = self.masks.iter().map(mask).collect();
        self.named = classes
            .into_iter()
            .map(|(name, id)| (id, name.to_owned()))
            .collect();
    }

    /// Cuts the classes into connected pieces.
    fn cut(&mut self) {
        let labels: Vec<u32> = self.ids.iter().map(|id| id.wrapping_add(1)).collect();
        self.masks = components(&labels, self.size);
        self.numbers = (1..=self.masks.iter().copied().max().unwrap_or(0)).collect();
    }

    /// Merges the parts of objects: neighbours whose commonest label is the same.
    fn merge(&mut self) {
        let mut joint: BTreeMap<(u32, u32), u64> = BTreeMap::new();
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
        let pieces = components(&labels, self.size);
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

    /// Visits every run of pixels of one mask and one label, row by row.
    pub(super) fn each_run(&self, mut visit: impl FnMut(usize, usize, u32, u32)) {
        let width = self.size[0];
        for row in 0..self.size[1] {
            let start = row * width;
            let (masks, ids) = (
                &self.masks[start..start + width],
                &self.ids[start..start + width],
            );
            for (left, right) in runs(masks) {
                for (from, to) in runs(&ids[left..right]) {
                    visit(
                        start + left + from,
                        start + left + to,
                        masks[left],
                        ids[left + from],
                    );
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
    pub(super) fn unknown(&self) -> BTreeMap<u16, u64> {
        let mut unknown = BTreeMap::new();
        for (left, right) in runs(&self.ids) {
            if let Ok(id) = u16::try_from(self.ids[left])
                && !self.labels.labels.contains_key(&id)
            {
                *unknown.entry(id).or_insert(0) += (right - left) as u64;
            }
        }
        unknown
    }

    /// Pixels without a class, those that survive an opening, and those of them in the lower half.
    pub(super) fn void(&self, rule: &Measure) -> (u64, u64, u64) {
        let [_, height] = self.size;
        let mut void = vec![false; self.ids.len()];
        for (left, right) in runs(&self.ids) {
            void[left..right].fill(self.class(self.ids[left]).is_none());
        }
        let count = |pixels: &[bool]| pixels.iter().filter(|void| **void).count() as u64;
        let all = count(&void);
        if all == 0 {
            return (0, 0, 0);
        }
        opened(&mut void, self.size, rounded(height, rule.void_per_height));
        let lower = &void[height / 2 * self.size[0]..];
        (all, count(&void), count(lower))
    }
}

/// A length in pixels that goes with the height: at least 1, to the nearest.
pub(super) fn rounded(height: usize, per_height: usize) -> usize {
    ((2 * height + per_height) / (2 * per_height)).max(1)
}
