//! ComputeStats of the paper's Algorithm 1: [`measure`].

use std::collections::BTreeMap;

use super::components::components;
use super::opening::opened;
use super::rim::{cores, runs};
use super::{Along, FrameDepth, FrameStatistics, Segment, SegmentDepth, plain_word};
use crate::error::{Error, Result};
use crate::questions::colors::{BINS, Palette};
use crate::questions::rules::{Measure, Rules};
use crate::types::{DepthKind, Digest, Frame, Intrinsics, Labels, Segmentation};

/// Measures a frame.
///
/// All counts are of whole pixels, and all lengths whole millimetres. The one use of floating-point numbers is the way from
/// the depth along the axis to that along the ray, `z · √(1 + ((x − cx) / fx)² + ((y − cy) / fy)²)`, whose operations IEEE 754
/// rounds alike on every machine.
///
/// # Errors
/// [`Error::Data`] with the frame where it has no classes at all.
pub fn measure(
    frame: &Frame,
    labels: &Labels,
    rules: &Rules,
    palette: &Palette,
    key: Digest,
) -> Result<FrameStatistics> {
    let rule = &rules.book().measure;
    let scene = Scene::of(frame, labels)?;
    let size = scene.size;
    let shapes = scene.shapes(rule);
    let (void, effective_void, lower_void) = scene.void(rule);
    let mut cores = shapes.cores(frame, &scene, rule, palette);
    let (mut classes, mut loose, mut words) = (BTreeMap::new(), BTreeMap::new(), BTreeMap::new());
    for (&(mask, id), &count) in &shapes.joint {
        let Some(class) = scene.class(id) else {
            continue;
        };
        *classes.entry(class.to_owned()).or_insert(0) += count;
        if mask == 0 {
            *loose.entry(class.to_owned()).or_insert(0) += count;
        }
    }
    let mut segments = Vec::new();
    for (mask, shape) in shapes.list.iter().enumerate() {
        let Some(mut segment) = shapes.segment(frame, &scene, mask as u32 + 1, shape) else {
            continue;
        };
        if !segment.word.is_empty() {
            *words.entry(segment.word.clone()).or_insert(0) += segment.area;
        }
        if let Some(core) = cores[mask].take() {
            core.tell(&mut segment);
            segments.push(segment);
        }
    }
    Ok(FrameStatistics {
        frame: frame.id.clone(),
        key,
        scene: frame.scene.clone(),
        size,
        luma: luma(frame),
        void,
        effective_void,
        lower_void,
        classes,
        loose,
        words,
        unknown: scene.unknown(),
        depth: frame_depth(frame),
        segments,
        room: frame.room.clone(),
    })
}

/// A number of the semantic map that stands for nothing.
const VOID: u32 = u32::MAX;

/// The maps of a frame, as numbers.
struct Scene<'a> {
    size: [usize; 2],
    labels: &'a Labels,
    /// The label of each pixel; [`VOID`] for none.
    ids: Vec<u32>,
    /// The mask of each pixel, from 1; 0 for none.
    masks: Vec<u32>,
    /// The number of each mask in the map.
    numbers: Vec<u32>,
    /// How many parts each mask is made of, where it is.
    parts: Vec<usize>,
    /// The class of a number above those of a semantic map: that of a segment by its name alone.
    named: BTreeMap<u32, String>,
}

/// Where the numbers of classes begin that a segment has by its name alone.
const NAMED: u32 = 1 << 16;

impl<'a> Scene<'a> {
    fn of(frame: &Frame, labels: &'a Labels) -> Result<Self> {
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
        let mut parts = vec![std::collections::BTreeSet::new(); count as usize];
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
        self.parts = parts.iter().map(std::collections::BTreeSet::len).collect();
        self.masks = pieces;
        self.numbers = (1..=count).collect();
    }

    /// Visits every run of pixels of one mask and one label, row by row.
    fn each_run(&self, mut visit: impl FnMut(usize, usize, u32, u32)) {
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
    fn class(&self, id: u32) -> Option<&str> {
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
    fn word(&self, id: u32) -> &str {
        let label = u16::try_from(id)
            .ok()
            .and_then(|id| self.labels.labels.get(&id));
        label.map_or("", |label| &label.name)
    }

    /// Pixels of numbers that the label space has not.
    fn unknown(&self) -> BTreeMap<u16, u64> {
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
    fn void(&self, rule: &Measure) -> (u64, u64, u64) {
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

    fn shapes(&self, rule: &Measure) -> Shapes {
        let [width, height] = self.size;
        let mut shapes = Shapes {
            list: vec![Shape::NONE; self.numbers.len()],
            joint: BTreeMap::new(),
        };
        self.each_run(|left, right, mask, id| {
            *shapes.joint.entry((mask, id)).or_insert(0) += (right - left) as u64;
        });
        for y in 0..height {
            let row = &self.masks[y * width..][..width];
            let rows = [y.checked_sub(1), (y + 1 < height).then_some(y + 1)];
            let [above, below] = rows.map(|y| y.map(|y| &self.masks[y * width..][..width]));
            let outer_row = y < rule.border_px || y + rule.border_px >= height;
            for (left, right) in runs(row) {
                let mask = row[left];
                let Some(index) = mask.checked_sub(1) else {
                    continue;
                };
                let shape = &mut shapes.list[index as usize];
                shape.take(y, left, right);
                for x in left..right {
                    let end = x == left || x + 1 == right;
                    let differs = |row: Option<&[u32]>| row.is_none_or(|row| row[x] != mask);
                    if end || differs(above) || differs(below) {
                        shape.rim += 1;
                        let outer = outer_row || x < rule.border_px || x + rule.border_px >= width;
                        shape.rim_on_border += u64::from(outer);
                    }
                }
            }
        }
        shapes
    }
}

/// What is measured of the mask alone.
#[derive(Clone)]
struct Shape {
    area: u64,
    bbox: [usize; 4],
    rim: u64,
    rim_on_border: u64,
}

impl Shape {
    const NONE: Self = Self {
        area: 0,
        bbox: [usize::MAX, usize::MAX, 0, 0],
        rim: 0,
        rim_on_border: 0,
    };

    /// Takes a run of a row.
    fn take(&mut self, row: usize, left: usize, right: usize) {
        self.area += (right - left) as u64;
        let [least, top, most, bottom] = self.bbox;
        self.bbox = [
            least.min(left),
            top.min(row),
            most.max(right),
            bottom.max(row + 1),
        ];
    }
}

/// All masks.
struct Shapes {
    list: Vec<Shape>,
    /// Pixels by mask and label.
    joint: BTreeMap<(u32, u32), u64>,
}

impl Shapes {
    /// What a mask is, before its depth and its colour; `None` where it has no class.
    fn segment(
        &self,
        frame: &Frame,
        scene: &Scene<'_>,
        mask: u32,
        shape: &Shape,
    ) -> Option<Segment> {
        let labels = self.joint.range((mask, 0)..=(mask, u32::MAX));
        let mut classes: BTreeMap<&str, u64> = BTreeMap::new();
        for (&(_, id), &count) in labels.clone() {
            if let Some(class) = scene.class(id) {
                *classes.entry(class).or_insert(0) += count;
            }
        }
        // Of classes as common as each other, the first.
        let (&class, &pure) = classes.iter().rev().max_by_key(|(_, count)| **count)?;
        let number = scene.numbers[mask as usize - 1];
        let own = match (&frame.segments, frame.segmentation) {
            (Some(_), Segmentation::Instances) => frame.names.get(&number),
            _ => None,
        };
        let word = own.map_or_else(
            || {
                let of_class = labels.filter(|((_, id), _)| scene.class(*id) == Some(class));
                let commonest = of_class.rev().max_by_key(|(_, count)| **count);
                commonest.map_or("", |((_, id), _)| scene.word(*id))
            },
            |name| &name.name,
        );
        let (word, stands) = plain_word(word);
        Some(Segment {
            id: number,
            class: class.to_owned(),
            word,
            stands,
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
            bright: 0,
            crushed: 0,
        })
    }

    /// Depth and colour of the masks that are not tiny.
    fn cores(
        &self,
        frame: &Frame,
        scene: &Scene<'_>,
        rule: &Measure,
        palette: &Palette,
    ) -> Vec<Option<Core>> {
        let pixels = scene.ids.len() as u64;
        let large = |shape: &Shape| super::ppm(shape.area, pixels) >= rule.detail_ppm;
        let mut found: Vec<Option<Core>> = self
            .list
            .iter()
            .map(|shape| large(shape).then(Core::default))
            .collect();
        let light = Light::of(frame, rule, palette);
        let radius = rounded(scene.size[1], rule.erosion_per_height);
        cores(&scene.masks, scene.size, radius, |y, left, right, mask| {
            if let Some(core) = &mut found[mask as usize - 1] {
                light.fall(core, y, left, right);
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
                    light.fall(core, y, left + from, left + to);
                }
            }
        }
        found
    }
}

/// Depth and colour of the pixels of a mask.
struct Core {
    count: u64,
    colors: [u64; BINS],
    channels: [[u32; 256]; 3],
    bright: u64,
    crushed: u64,
    depths: Option<Vec<u32>>,
}

impl Default for Core {
    fn default() -> Self {
        Self {
            count: 0,
            colors: [0; BINS],
            channels: [[0; 256]; 3],
            bright: 0,
            crushed: 0,
            depths: None,
        }
    }
}

impl Core {
    fn tell(self, segment: &mut Segment) {
        segment.core = self.count;
        segment.colors = self.colors;
        segment.median = self
            .channels
            .map(|counts| quantile(&counts, self.count, 50));
        (segment.bright, segment.crushed) = (self.bright, self.crushed);
        segment.depth = self.depths.and_then(depths);
    }
}

/// The nearest-rank quantiles of depths.
fn depths(mut depths: Vec<u32>) -> Option<SegmentDepth> {
    if depths.is_empty() {
        return None;
    }
    let count = depths.len();
    let mut ranked = |percent| {
        let (_, depth, _) = depths.select_nth_unstable(rank(count as u64, percent) as usize);
        *depth
    };
    Some(SegmentDepth {
        valid: count as u64,
        p10: ranked(10),
        median: ranked(50),
        p90: ranked(90),
    })
}

/// The index of a quantile among so many in order: ⌈percent · count / 100⌉ − 1.
fn rank(count: u64, percent: u64) -> u64 {
    (percent * count).div_ceil(100).saturating_sub(1)
}

/// A quantile of 8-bit values by their counts.
fn quantile(counts: &[u32; 256], count: u64, percent: u64) -> u8 {
    let rank = rank(count, percent);
    let mut seen = 0;
    let value = counts.iter().position(|count| {
        seen += u64::from(*count);
        seen > rank
    });
    value.unwrap_or(0) as u8
}

/// The image and its depth, as a mask's pixels see them.
struct Light<'a> {
    frame: &'a Frame,
    rule: &'a Measure,
    palette: &'a Palette,
    depth: Option<&'a [u32]>,
    /// The squares of the slopes of rays by column and by row.
    slopes: Option<[Vec<f64>; 2]>,
}

impl<'a> Light<'a> {
    fn of(frame: &'a Frame, rule: &'a Measure, palette: &'a Palette) -> Self {
        let slopes = rays(frame).map(|camera| {
            let square = |length: usize, focal: f64, center: f64| -> Vec<f64> {
                (0..length)
                    .map(|i| (i as f64 - center) / focal)
                    .map(|slope| slope * slope)
                    .collect()
            };
            [
                square(frame.rgb.width(), camera.fx, camera.cx),
                square(frame.rgb.height(), camera.fy, camera.cy),
            ]
        });
        Self {
            frame,
            rule,
            palette,
            depth: frame.depth.as_ref().and_then(|depth| depth.as_slice()),
            slopes,
        }
    }

    /// Adds a run of a row to a mask.
    fn fall(&self, core: &mut Core, y: usize, left: usize, right: usize) {
        let start = y * self.frame.rgb.width();
        let samples = &self.frame.rgb.samples()[(start + left) * 3..(start + right) * 3];
        core.count += (right - left) as u64;
        for &rgb in samples.as_chunks::<3>().0 {
            core.colors[self.palette.bin(rgb)] += 1;
            for (counts, value) in core.channels.iter_mut().zip(rgb) {
                counts[usize::from(value)] += 1;
            }
            let most = rgb[0].max(rgb[1]).max(rgb[2]);
            core.bright += u64::from(most >= self.rule.bright);
            core.crushed += u64::from(most <= self.rule.crushed);
        }
        let Some(depth) = self.depth else {
            return;
        };
        let depths = core.depths.get_or_insert_default();
        let row = &depth[start + left..start + right];
        let valid = |depth: &u32| (1..=self.rule.most_depth_mm).contains(depth);
        match &self.slopes {
            None => depths.extend(row.iter().copied().filter(valid)),
            Some([columns, rows]) => {
                let steep = 1.0 + rows[y];
                let along = row
                    .iter()
                    .zip(&columns[left..right])
                    .map(|(z, slope)| (f64::from(*z) * (steep + slope).sqrt() + 0.5) as u32);
                depths.extend(along.filter(valid));
            }
        }
    }
}

/// The camera, where depth is to be turned from the axis to the rays.
fn rays(frame: &Frame) -> Option<Intrinsics> {
    frame
        .intrinsics
        .filter(|_| frame.depth_kind == DepthKind::Planar)
}

fn frame_depth(frame: &Frame) -> Option<FrameDepth> {
    const MOST: usize = 1 << 16;
    let depth = frame.depth.as_ref()?;
    let mut counts = vec![0_u64; MOST];
    for depth in depth {
        counts[(*depth as usize).min(MOST - 1)] += 1;
    }
    let holes = counts[0];
    let rank = rank(depth.len() as u64 - holes, 50);
    let mut seen = 0;
    let median = counts.iter().skip(1).position(|count| {
        seen += count;
        seen > rank
    });
    Some(FrameDepth {
        holes,
        median: median.map_or(0, |median| median as u32 + 1),
        along: match (frame.depth_kind, rays(frame)) {
            (DepthKind::Euclid, _) | (_, Some(_)) => Along::Ray,
            (DepthKind::Planar, None) => Along::Axis,
        },
    })
}

/// The 10 %, 50 % and 90 % quantiles of luma, which has the weights of ITU-R BT.709 in 256ths.
fn luma(frame: &Frame) -> [u8; 3] {
    let mut counts = [0; 256];
    let (pixels, _) = frame.rgb.samples().as_chunks::<3>();
    for &[red, green, blue] in pixels {
        let luma = 54 * u32::from(red) + 183 * u32::from(green) + 19 * u32::from(blue);
        counts[(luma >> 8) as usize] += 1;
    }
    [10, 50, 90].map(|percent| quantile(&counts, pixels.len() as u64, percent))
}

/// A length in pixels that goes with the height: at least 1, to the nearest.
fn rounded(height: usize, per_height: usize) -> usize {
    ((2 * height + per_height) / (2 * per_height)).max(1)
}
