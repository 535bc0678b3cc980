//! Shapes of masks, and the segments made from them: [`MaskShapes`].

use std::collections::BTreeMap;

use super::erosion::{cores, runs};
use super::mask_core::{MaskCore, PixelLight};
use super::scene_maps::{JointCounts, SceneMaps, scaled_length};
use super::{Segment, WordSource, plain_word, ppm};
use crate::colors::{BINS, Palette};
use crate::rules::{CoarseRule, MeasureRule};
use darkqa_base::types::{Frame, Segmentation};

/// Shape of a mask: area, bounding box and rim.
#[derive(Clone)]
pub(super) struct MaskShape {
    area: u64,
    bbox: [usize; 4],
    rim: u64,
    rim_on_border: u64,
}

impl MaskShape {
    const NONE: Self = Self { area: 0, bbox: [usize::MAX, usize::MAX, 0, 0], rim: 0, rim_on_border: 0 };

    /// Adds a run of pixels of a row.
    fn add(&mut self, row: usize, left: usize, right: usize) {
        self.area += (right - left) as u64;
        let [first, top, last, bottom] = self.bbox;
        self.bbox = [first.min(left), top.min(row), last.max(right), bottom.max(row + 1)];
    }
}

/// Number of rim pixels of a run between the columns `from` and `to`: the ends of the run, and pixels with another mask
/// above or below.
fn count_rim(mask: u32, [from, to]: [usize; 2], [left, right]: [usize; 2], rows: [Option<&[u32]>; 2]) -> u64 {
    if from >= to {
        return 0;
    }
    let [Some(above), Some(below)] = rows else {
        return (to - from) as u64;
    };
    let count: u32 = above[from..to]
        .iter()
        .zip(&below[from..to])
        .map(|(above, below)| u32::from(*above != mask) | u32::from(*below != mask))
        .sum();
    let last = (right - left > 1).then(|| right - 1);
    let ends = std::iter::once(left)
        .chain(last)
        .filter(|x| (from..to).contains(x) && above[*x] == mask && below[*x] == mask)
        .count();
    u64::from(count) + ends as u64
}

/// Shapes of all masks of a frame.
pub(super) struct MaskShapes {
    pub(super) list: Vec<MaskShape>,
    /// Number of pixels by mask and label.
    pub(super) joint: JointCounts,
}

impl MaskShapes {
    /// Measures the shapes of all masks.
    pub(super) fn measure(scene: &SceneMaps<'_>, rule: &MeasureRule) -> Self {
        let [width, height] = scene.size;
        let mut shapes = Self { list: vec![MaskShape::NONE; scene.numbers.len()], joint: JointCounts::new() };
        for y in 0..height {
            scene.each_run_in_row(y, &mut |left, right, mask, id| {
                *shapes.joint.entry((mask, id)).or_insert(0) += (right - left) as u64;
            });
            let row = &scene.masks[y * width..][..width];
            let rows = [y.checked_sub(1), (y + 1 < height).then_some(y + 1)];
            let [above, below] = rows.map(|y| y.map(|y| &scene.masks[y * width..][..width]));
            let is_border_row = y < rule.border_px || y + rule.border_px >= height;
            for (left, right) in runs(row) {
                let mask = row[left];
                let Some(index) = mask.checked_sub(1) else {
                    continue;
                };
                let shape = &mut shapes.list[index as usize];
                shape.add(y, left, right);
                let rim = |from: usize, to: usize| {
                    let (from, to) = (from.max(left), to.min(right));
                    count_rim(mask, [from, to], [left, right], [above, below])
                };
                shape.rim += rim(left, right);
                shape.rim_on_border += if is_border_row {
                    rim(left, right)
                } else {
                    let inner = width.saturating_sub(rule.border_px).max(rule.border_px);
                    rim(0, rule.border_px) + rim(inner, width)
                };
            }
        }
        shapes
    }

    /// Creates the segment of a mask, still without depth and colour; `None` if no pixel has a class.
    pub(super) fn segment(
        &self,
        frame: &Frame,
        scene: &SceneMaps<'_>,
        coarse: &CoarseRule,
        mask: u32,
        shape: &MaskShape,
    ) -> Option<Segment> {
        let labels = self.joint.range((mask, 0)..=(mask, u32::MAX));
        let mut classes: BTreeMap<&str, u64> = BTreeMap::new();
        for (&(_, id), &count) in labels.clone() {
            if let Some(class) = scene.class(id) {
                *classes.entry(class).or_insert(0) += count;
            }
        }
        // If several classes are equally common, the first by name counts.
        let (&class, &pure) = classes.iter().rev().max_by_key(|(_, count)| **count)?;
        let number = scene.numbers[mask as usize - 1];
        let own = match (&frame.segments, frame.segmentation) {
            (Some(_), Segmentation::Instances) => frame.names.get(&number),
            _ => None,
        };
        let word = own.map_or_else(
            || {
                labels
                    .filter(|((_, id), _)| scene.class(*id) == Some(class))
                    .rev()
                    .max_by_key(|(_, count)| **count)
                    .map_or("", |((_, id), _)| scene.word(*id))
            },
            |name| &name.name,
        );
        let (word, place) = plain_word(word);
        let source = if own.is_some() && coarse.is_name(&word) {
            WordSource::Name
        } else if own.is_none() && coarse.identifies_object(&scene.labels.space, &word) {
            WordSource::Label
        } else {
            WordSource::Coarse
        };
        Some(Segment {
            id: number,
            class: class.to_owned(),
            word,
            source,
            place,
            region: own.and_then(|name| name.region),
            parts: scene.parts.get(mask as usize - 1).copied().unwrap_or(0),
            area: shape.area,
            pure,
            bbox: shape.bbox,
            rim: shape.rim,
            rim_on_border: shape.rim_on_border,
            core: 0,
            depth: None,
            colors: [0; BINS],
            median: [0; 3],
            around: None,
            bright: 0,
            crushed: 0,
        })
    }

    /// Depth and colour of each mask; `None` for tiny masks.
    pub(super) fn cores(
        &self,
        frame: &Frame,
        scene: &SceneMaps<'_>,
        rule: &MeasureRule,
        palette: &Palette,
    ) -> Vec<Option<MaskCore>> {
        let pixels = scene.masks.len() as u64;
        let mut found: Vec<Option<MaskCore>> = self
            .list
            .iter()
            .map(|shape| {
                let is_large = ppm(shape.area, pixels) >= rule.detail_ppm;
                is_large.then(|| MaskCore::new(shape.area, frame))
            })
            .collect();
        let light = PixelLight::new(frame, rule, palette);
        let radius = scaled_length(scene.size[1], rule.erosion_per_height);
        cores(&scene.masks, scene.size, radius, |y, left, right, mask| {
            if let Some(core) = &mut found[mask as usize - 1] {
                light.add_run(core, y, left, right);
            }
        });
        let width = scene.size[0];
        for ((mask, shape), core) in (1..).zip(&self.list).zip(&mut found) {
            let Some(core) = core.as_mut().filter(|core| core.count == 0) else {
                continue;
            };
            let [left, top, right, bottom] = shape.bbox;
            for y in top..bottom {
                let row = &scene.masks[y * width + left..y * width + right];
                for (from, to) in runs(row).filter(|(from, _)| row[*from] == mask) {
                    light.add_run(core, y, left + from, left + to);
                }
            }
        }
        found
    }
}
