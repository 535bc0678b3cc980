//! Masks and labels of the pixels of a frame: [`SceneMaps`].
//!
//! Connected components of equal label: [`components`].
//!
//! Morphological opening of a mask, which removes thin margins: [`open_mask`].
//!
//! Erosion of all masks of an image in one pass: [`cores`].

use std::collections::{BTreeMap, BTreeSet};

use ndarray::{CowArray, Ix2};

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

/// A run of one label in a row.
struct LabelRun {
    left: usize,
    right: usize,
    label: u32,
}

/// Returns the component of each pixel. Pixels with equal labels that touch by edges or corners form one component;
/// components are numbered row by row from 1. `to_label` gives the label of a value; pixels with label 0 belong to no
/// component and get 0.
pub(super) fn components<T: Copy + PartialEq>(
    values: &[T],
    [width, height]: [usize; 2],
    to_label: impl Fn(T) -> u32,
) -> Vec<u32> {
    let mut parents: Vec<u32> = Vec::new();
    let mut rows: Vec<Vec<(LabelRun, u32)>> = Vec::with_capacity(height);
    for y in 0..height {
        let row = &values[y * width..][..width];
        let mut found: Vec<(LabelRun, u32)> = Vec::new();
        let above: &[(LabelRun, u32)] = rows.last().map_or(&[], |above| above);
        // The runs of both rows are sorted from left to right. Runs above that end before this one begins are no longer
        // needed.
        let mut first = 0;
        for (left, right) in runs(row) {
            let label = to_label(row[left]);
            if label == 0 {
                continue;
            }
            while above.get(first).is_some_and(|(run, _)| run.right < left) {
                first += 1;
            }
            let mut joined = None;
            for (run, node) in above[first..].iter().take_while(|(run, _)| run.left <= right) {
                if run.label != label {
                    continue;
                }
                joined = Some(match joined {
                    None => *node,
                    Some(other) => join(&mut parents, other, *node),
                });
            }
            let node = joined.unwrap_or_else(|| {
                parents.push(parents.len() as u32);
                parents.len() as u32 - 1
            });
            found.push((LabelRun { left, right, label }, node));
        }
        rows.push(found);
    }
    number_components(&rows, &mut parents, [width, height])
}

/// Joins the trees of two nodes and returns their common root, the older of the two roots.
fn join(parents: &mut [u32], a: u32, b: u32) -> u32 {
    let (a, b) = (root(parents, a), root(parents, b));
    let (old, new) = (a.min(b), a.max(b));
    parents[new as usize] = old;
    old
}

/// Returns the root of a node and shortens the path to it.
fn root(parents: &mut [u32], mut node: u32) -> u32 {
    while parents[node as usize] != node {
        parents[node as usize] = parents[parents[node as usize] as usize];
        node = parents[node as usize];
    }
    node
}

/// Numbers the components row by row from 1 and returns the number of each pixel.
fn number_components(rows: &[Vec<(LabelRun, u32)>], parents: &mut [u32], [width, height]: [usize; 2]) -> Vec<u32> {
    let mut numbers = vec![0; parents.len()];
    let mut next = 1;
    let mut pieces = vec![0; width * height];
    for (y, row) in rows.iter().enumerate() {
        for (run, node) in row {
            let root = root(parents, *node) as usize;
            if numbers[root] == 0 {
                numbers[root] = next;
                next += 1;
            }
            pieces[y * width + run.left..y * width + run.right].fill(numbers[root]);
        }
    }
    pieces
}

/// Opens a mask in place with a square of radius `radius`: only pixels covered by squares that are entirely within the
/// mask remain. Pixels outside the image are not in the mask, so an unlabelled border around the image is also a
/// margin.
fn open_mask(set: &mut [bool], [width, height]: [usize; 2], radius: usize) {
    let whole = 2 * radius + 1;
    let mut streaks = vec![0_usize; width];
    // The centers of such squares, widened by the radius along their rows.
    let mut spread = vec![false; set.len()];
    for y in 0..height {
        let row = &set[y * width..][..width];
        for (left, right) in runs(row) {
            let is_long_enough = row[left] && right - left >= whole;
            let (from, to) = if is_long_enough { (left + radius, right - radius) } else { (right, right) };
            streaks[left..from].fill(0);
            streaks[to..right].fill(0);
            for streak in &mut streaks[from..to] {
                *streak += 1;
            }
        }
        let Some(center) = y.checked_sub(radius) else {
            continue;
        };
        let row = &mut spread[center * width..][..width];
        let mut filled = 0;
        for (x, streak) in streaks.iter().enumerate() {
            if *streak >= whole {
                row[filled.max(x - radius)..=x + radius].fill(true);
                filled = x + radius + 1;
            }
        }
    }
    // Then the same along the columns: `since` is the distance to the last center above, then to the next one below.
    set.fill(false);
    for direction in [Direction::Down, Direction::Up] {
        let mut since = vec![radius + 1; width];
        for i in 0..height {
            let y = if direction == Direction::Down { i } else { height - 1 - i };
            let (centers, row) = (&spread[y * width..][..width], &mut set[y * width..][..width]);
            for ((since, center), pixel) in since.iter_mut().zip(centers).zip(row) {
                *since = if *center { 0 } else { *since + 1 };
                *pixel |= *since <= radius;
            }
        }
    }
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Direction {
    Down,
    Up,
}

/// Calls `visit(y, left, right, mask)`, row by row, for every run of pixels whose square of radius `radius` is within
/// their own mask. Masks continue beyond the edge of the image, because depth has no flying pixels there. Mask 0 is
/// skipped.
///
/// Each run of a row is shortened by the radius. For each column, `streaks` counts the consecutive rows in which the
/// column was inside such a shortened run of the same mask.
pub(super) fn cores(
    masks: &[u32],
    [width, height]: [usize; 2],
    radius: usize,
    mut visit: impl FnMut(usize, usize, usize, u32),
) {
    let whole = 2 * radius as u32 + 1;
    let mut streaks = vec![0_u32; width];
    // Above the first row and below the last row, the masks of these rows continue.
    for y in 0..height + radius {
        if y < height {
            let row = &masks[y * width..][..width];
            let above = (y > 0).then(|| &masks[(y - 1) * width..][..width]);
            for (left, right) in runs(row) {
                let (from, to) = (
                    if left == 0 { 0 } else { left + radius },
                    if right == width { width } else { right.saturating_sub(radius) },
                );
                let (from, to) = (from.min(right), to.max(from.min(right)));
                streaks[left..from].fill(0);
                streaks[to..right].fill(0);
                let streaks = &mut streaks[from..to];
                match above {
                    None => streaks.fill(radius as u32 + 1),
                    Some(above) => {
                        for (streak, above) in streaks.iter_mut().zip(&above[from..to]) {
                            *streak = if *above == row[left] { *streak + 1 } else { 1 };
                        }
                    }
                }
            }
        } else {
            for streak in streaks.iter_mut().filter(|streak| **streak > 0) {
                *streak += 1;
            }
        }
        let Some(center) = y.checked_sub(radius) else {
            continue;
        };
        let row = &masks[center * width..][..width];
        let mut x = 0;
        while x < width {
            if streaks[x] < whole || row[x] == 0 {
                x += 1;
                continue;
            }
            let left = x;
            while x < width && streaks[x] >= whole && row[x] == row[left] {
                x += 1;
            }
            visit(center, left, x, row[left]);
        }
    }
}

/// Runs of equal values of a row, as left and right (exclusive).
pub(super) fn runs<T: PartialEq>(row: &[T]) -> impl Iterator<Item = (usize, usize)> {
    let mut left = 0;
    std::iter::from_fn(move || {
        let run = (left, left + run_length(row.get(left..)?)?);
        left = run.1;
        Some(run)
    })
}

/// Number of equal values at the start; `None` if the list is empty.
fn run_length<T: PartialEq>(values: &[T]) -> Option<usize> {
    /// Number of values compared without a branch, so that the compiler can use SIMD.
    const LANES: usize = 32;
    let first = values.first()?;
    let count_different = |lanes: &[T; LANES]| -> u32 { lanes.iter().map(|value| u32::from(value != first)).sum() };
    let (chunks, _) = values.as_chunks::<LANES>();
    let whole = LANES * chunks.iter().take_while(|lanes| count_different(lanes) == 0).count();
    let rest = values[whole..].iter().take_while(|value| *value == first).count();
    Some(whole + rest)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn reference(labels: &[u32], [width, height]: [usize; 2]) -> Vec<u32> {
        let mut pieces = vec![0; labels.len()];
        let mut next = 0;
        for start in 0..labels.len() {
            if labels[start] == 0 || pieces[start] != 0 {
                continue;
            }
            next += 1;
            let mut open = vec![start];
            pieces[start] = next;
            while let Some(i) = open.pop() {
                let (x, y) = (i % width, i / width);
                for j in y.saturating_sub(1)..=(y + 1).min(height - 1) {
                    for k in x.saturating_sub(1)..=(x + 1).min(width - 1) {
                        let neighbour = j * width + k;
                        if labels[neighbour] == labels[start] && pieces[neighbour] == 0 {
                            pieces[neighbour] = next;
                            open.push(neighbour);
                        }
                    }
                }
            }
        }
        pieces
    }

    proptest! {
        #[test]
        fn components_match_flood_fill(
            (width, height, labels) in (1..12_usize, 1..12_usize).prop_flat_map(|(width, height)| {
                (Just(width), Just(height), prop::collection::vec(0..3_u32, width * height))
            }),
        ) {
            prop_assert_eq!(components(&labels, [width, height], |label| label), reference(&labels, [width, height]));
        }
    }

    fn opening_reference(set: &[bool], [width, height]: [usize; 2], radius: usize) -> Vec<bool> {
        let mut expected = vec![false; set.len()];
        let side = 2 * radius + 1;
        for top in 0..(height + 1).saturating_sub(side) {
            for left in 0..(width + 1).saturating_sub(side) {
                let square = (top..top + side).flat_map(|y| (left..left + side).map(move |x| y * width + x));
                if square.clone().all(|i| set[i]) {
                    square.for_each(|i| expected[i] = true);
                }
            }
        }
        expected
    }

    proptest! {
        #[test]
        fn pixels_covered_by_squares_remain(
            width in 1..16_usize, height in 1..16_usize, radius in 1..4_usize, bits in any::<u128>(), coarse in 1..6_usize,
        ) {
            let mut set: Vec<bool> = (0..width * height)
                .map(|i| {
                    let cell = i % width / coarse * 5 + i / width / coarse * 17;
                    bits >> (cell % 127) & 3 != 0
                })
                .collect();
            let expected = opening_reference(&set, [width, height], radius);
            open_mask(&mut set, [width, height], radius);
            prop_assert_eq!(set, expected);
        }
    }

    /// The core mask of each pixel, computed pixel by pixel.
    fn erosion_reference(masks: &[u32], [width, height]: [usize; 2], radius: usize) -> Vec<u32> {
        (0..width * height)
            .map(|i| {
                let (x, y) = (i % width, i / width);
                let columns = x.saturating_sub(radius)..=(x + radius).min(width - 1);
                let mut rows = y.saturating_sub(radius)..=(y + radius).min(height - 1);
                let is_core = rows.all(|y| columns.clone().all(|x| masks[y * width + x] == masks[i]));
                if is_core { masks[i] } else { 0 }
            })
            .collect()
    }

    proptest! {
        #[test]
        fn cores_match_reference(
            width in 1..14_usize, height in 1..14_usize, radius in 0..4_usize, bits in any::<u64>(), coarse in 1..5_usize,
        ) {
            let masks: Vec<u32> = (0..width * height)
                .map(|i| {
                    let cell = i % width / coarse * 7 + i / width / coarse * 13;
                    (bits >> (cell % 62) & 3) as u32
                })
                .collect();
            let mut found = vec![0; width * height];
            cores(&masks, [width, height], radius, |y, left, right, mask| {
                found[y * width + left..y * width + right].fill(mask);
            });
            prop_assert_eq!(found, erosion_reference(&masks, [width, height], radius));
        }
    }
}
