//! Measurement of a frame, `ComputeStats` of the paper's Algorithm 1: [`measure`].
//!
//! Shapes of masks, and the segments made from them: [`MaskShapes`].
//!
//! Light of a frame, estimated from its surfaces: [`LightSamples`].
//!
//! A surface that looks grey may be a white one in shade, so colours are judged relative to the brightest surfaces in
//! the same light: the "highest luminance is white" rule of anchoring (Gilchrist et al. 1999, Psychol. Rev. 106:795),
//! which is max-RGB of colour constancy (Land and McCann 1971, J. Opt. Soc. Am. 61:1). A quantile replaces the maximum,
//! because single bright pixels may be glints (Funt and Shi 2010, "The rehabilitation of MaxRGB", CIC 18:256).
//!
//! Colour and depth of the core pixels of a mask, [`MaskCore`], and measurements over all pixels of a frame.

use std::collections::BTreeMap;

use ndarray::{CowArray, Ix2};

use super::scene_maps::{JointCounts, SceneMaps, cores, runs, scaled_length};
use super::{DepthAxis, FrameDepth, FrameStatistics, Segment, SegmentDepth, WordSource, plain_word, ppm};
use crate::colors::{BINS, Palette};
use crate::rules::{CoarseRule, MeasureRule, Rules};
use darkqa_base::error::Result;
use darkqa_base::types::{DepthKind, Digest, Frame, Intrinsics, Labels, Segmentation};

/// Measures a frame. `key` is the digest of the measured files and the thresholds.
///
/// Counts are in whole pixels and lengths in whole millimetres. Only the conversion of depth from the optical axis to
/// the ray, `z · √(1 + ((x − cx) / fx)² + ((y − cy) / fy)²)`, uses floating-point numbers; IEEE 754 rounds these
/// operations the same way on every machine.
///
/// # Errors
/// [`darkqa_base::error::Error::Data`], with the frame, if the frame has no classes at all.
pub fn measure(
    frame: &Frame,
    labels: &Labels,
    rules: &Rules,
    palette: &Palette,
    key: Digest,
) -> Result<FrameStatistics> {
    let thresholds = &rules.book().measure;
    let coarse = &rules.book().coarse;
    let scene = SceneMaps::new(frame, labels)?;
    let shapes = MaskShapes::measure(&scene, thresholds);
    let (void, effective_void, lower_void) = scene.void(&shapes.joint, thresholds);
    let mut cores = shapes.cores(frame, &scene, thresholds, palette);
    let samples = LightSamples::from_frame(frame, &scene, thresholds);

    // Pixels by class: all, outside every segment, and without a specific word.
    let mut classes = BTreeMap::new();
    let mut loose = BTreeMap::new();
    let mut unnamed = BTreeMap::new();
    for (&(mask, id), &count) in &shapes.joint {
        let Some(class) = scene.class(id) else {
            continue;
        };
        *classes.entry(class.to_owned()).or_insert(0) += count;
        if !scene.is_named(frame, mask, id, coarse) {
            *unnamed.entry(class.to_owned()).or_insert(0) += count;
        }
        if mask == 0 {
            *loose.entry(class.to_owned()).or_insert(0) += count;
        }
    }

    let mut words = BTreeMap::new();
    let mut segments = Vec::new();
    for (index, shape) in shapes.list.iter().enumerate() {
        // Mask 0 is for pixels outside every segment.
        let mask = index as u32 + 1;
        let Some(mut segment) = shapes.segment(frame, &scene, coarse, mask, shape) else {
            continue;
        };
        if !segment.word.is_empty() {
            *words.entry(segment.word.clone()).or_insert(0) += segment.area;
        }
        if let Some(core) = cores[index].take() {
            core.write_to(&mut segment);
            segment.around = samples.around(mask, segment.bbox);
            segments.push(segment);
        }
    }

    Ok(FrameStatistics {
        frame: frame.id.clone(),
        key,
        scene: frame.scene.clone(),
        size: scene.size,
        luma: luma(frame),
        light: samples.light(),
        void,
        effective_void,
        lower_void,
        classes,
        loose,
        unnamed,
        words,
        unknown: scene.unknown(&shapes.joint),
        depth: frame_depth(frame),
        segments,
        room: frame.room.clone(),
    })
}

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

/// A pixel of a surface.
struct SurfacePixel {
    position: [usize; 2],
    mask: u32,
    rgb: [u8; 3],
}

/// Pixels of the frame's surfaces on a regular grid, sorted by row. Classes that emit light or show something else are
/// left out.
pub(super) struct LightSamples {
    samples: Vec<SurfacePixel>,
    /// Quantile of the light of the frame, in percent.
    frame_percent: u64,
    /// Quantile of the light around a mask, in percent.
    around_percent: u64,
}

impl LightSamples {
    /// Samples a frame.
    pub(super) fn from_frame(frame: &Frame, scene: &SceneMaps<'_>, rule: &MeasureRule) -> Self {
        let [width, height] = scene.size;
        let step = (height / rule.light_rows).max(1);
        let (pixels, _) = frame.rgb.samples().as_chunks::<3>();
        let mut samples = Vec::new();
        for y in (0..height).step_by(step) {
            scene.each_run_in_row(y, &mut |left, right, mask, id| {
                let is_surface = scene.class(id).is_some_and(|class| !rule.luminous.contains(class));
                if is_surface {
                    let (left, right) = (left - y * width, right - y * width);
                    let columns = (left.next_multiple_of(step)..right).step_by(step);
                    samples.extend(columns.map(|x| SurfacePixel {
                        position: [x, y],
                        mask,
                        rgb: pixels[y * width + x],
                    }));
                }
            });
        }
        Self { samples, frame_percent: rule.light_percent, around_percent: rule.around_percent }
    }

    /// Light of the frame: a high quantile of each channel over all surfaces. White without surfaces.
    pub(super) fn light(&self) -> [u8; 3] {
        [0, 1, 2].map(|channel| {
            let codes = self.samples.iter().map(|sample| sample.rgb[channel]);
            code_quantile(codes, self.frame_percent).unwrap_or(u8::MAX)
        })
    }

    /// Light around a mask: a high quantile of luma over the other surfaces in its bounding box, enlarged by half of
    /// the longer side on each side. `None` without such surfaces.
    pub(super) fn around(&self, mask: u32, [left, top, right, bottom]: [usize; 4]) -> Option<u8> {
        let reach = (right - left).max(bottom - top) / 2;
        let columns = left.saturating_sub(reach)..right + reach;
        let rows = top.saturating_sub(reach)..bottom + reach;
        let first = self.samples.partition_point(|sample| sample.position[1] < rows.start);
        let last = self.samples.partition_point(|sample| sample.position[1] < rows.end);
        let near = self.samples[first..last]
            .iter()
            .filter(|sample| sample.mask != mask && columns.contains(&sample.position[0]));
        code_quantile(near.map(|sample| pixel_luma(sample.rgb)), self.around_percent)
    }
}

/// Quantile of codes; `None` without codes.
fn code_quantile(codes: impl Iterator<Item = u8>, percent: u64) -> Option<u8> {
    let (mut counts, mut count) = ([0_u32; 256], 0);
    for code in codes {
        counts[usize::from(code)] += 1;
        count += 1;
    }
    (count > 0).then(|| quantile(&counts, count, percent))
}

/// Colours and depths of the core pixels of a mask.
pub(super) struct MaskCore {
    pub(super) count: u64,
    colors: [u64; BINS],
    channels: [[u32; 256]; 3],
    bright: u64,
    crushed: u64,
    depths: Option<Vec<u32>>,
}

impl MaskCore {
    /// Creates an empty core, with capacity for the depths of `area` pixels.
    pub(super) fn new(area: u64, frame: &Frame) -> Self {
        Self {
            count: 0,
            colors: [0; BINS],
            channels: [[0; 256]; 3],
            bright: 0,
            crushed: 0,
            depths: frame.depth.as_ref().map(|_| Vec::with_capacity(area as usize)),
        }
    }

    /// Writes the measurements into a segment.
    pub(super) fn write_to(self, segment: &mut Segment) {
        segment.core = self.count;
        segment.colors = self.colors;
        segment.median = self.channels.map(|counts| quantile(&counts, self.count, 50));
        (segment.bright, segment.crushed) = (self.bright, self.crushed);
        segment.depth = self.depths.and_then(depth_quantiles);
    }
}

/// Nearest-rank quantiles of depths; `None` without depths.
fn depth_quantiles(mut depths: Vec<u32>) -> Option<SegmentDepth> {
    if depths.is_empty() {
        return None;
    }
    let count = depths.len() as u64;
    let [near, middle, far] = [10, 50, 90].map(|percent| rank(count, percent) as usize);
    // The values before the median are smaller and those after it larger, so each outer quantile is searched in its
    // half only.
    let (nearer, &mut median, farther) = depths.select_nth_unstable(middle);
    Some(SegmentDepth {
        valid: count,
        p10: if near < middle { *nearer.select_nth_unstable(near).1 } else { median },
        median,
        p90: match far.checked_sub(middle + 1) {
            Some(far) => *farther.select_nth_unstable(far).1,
            None => median,
        },
    })
}

/// Index of a quantile in a sorted list: ⌈percent · count / 100⌉ − 1.
fn rank(count: u64, percent: u64) -> u64 {
    (percent * count).div_ceil(100).saturating_sub(1)
}

/// Quantile of 8-bit values, from their histogram.
pub(super) fn quantile(counts: &[u32; 256], count: u64, percent: u64) -> u8 {
    let rank = rank(count, percent);
    let mut seen = 0;
    let value = counts.iter().position(|count| {
        seen += u64::from(*count);
        seen > rank
    });
    value.unwrap_or(0) as u8
}

/// Image and depth of a frame, prepared for reading runs of pixels.
pub(super) struct PixelLight<'a> {
    frame: &'a Frame,
    rule: &'a MeasureRule,
    palette: &'a Palette,
    depth: Option<CowArray<'a, u32, Ix2>>,
    /// Squares of the slopes of rays, by column and by row; `None` if the depth needs no conversion.
    slopes: Option<[Vec<f64>; 2]>,
}

impl<'a> PixelLight<'a> {
    pub(super) fn new(frame: &'a Frame, rule: &'a MeasureRule, palette: &'a Palette) -> Self {
        let slopes = depth_conversion(frame).map(|camera| {
            [(frame.rgb.width(), camera.fx, camera.cx), (frame.rgb.height(), camera.fy, camera.cy)].map(
                |(length, focal, center)| {
                    (0..length).map(|i| (i as f64 - center) / focal).map(|slope| slope * slope).collect()
                },
            )
        });
        Self { frame, rule, palette, depth: frame.depth.as_ref().map(|depth| depth.as_standard_layout()), slopes }
    }

    /// Adds a run of pixels of a row to a core.
    pub(super) fn add_run(&self, core: &mut MaskCore, y: usize, left: usize, right: usize) {
        let start = y * self.frame.rgb.width();
        let samples = &self.frame.rgb.samples()[(start + left) * 3..(start + right) * 3];
        core.count += (right - left) as u64;
        for &rgb in samples.as_chunks::<3>().0 {
            core.colors[self.palette.bin(rgb)] += 1;
            for (counts, value) in core.channels.iter_mut().zip(rgb) {
                counts[usize::from(value)] += 1;
            }
            let max = rgb[0].max(rgb[1]).max(rgb[2]);
            core.bright += u64::from(max >= self.rule.bright);
            core.crushed += u64::from(max <= self.rule.crushed);
        }
        let depth = self.depth.as_ref().and_then(|depth| depth.as_slice());
        let (Some(depth), Some(depths)) = (depth, &mut core.depths) else {
            return;
        };
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

/// Camera intrinsics, if depth must be converted from the optical axis to the rays.
fn depth_conversion(frame: &Frame) -> Option<Intrinsics> {
    frame.intrinsics.filter(|_| frame.depth_kind == DepthKind::Planar)
}

/// Measures the depth map of a frame; `None` without one.
fn frame_depth(frame: &Frame) -> Option<FrameDepth> {
    const SIZE: usize = 1 << 16;
    let depth = frame.depth.as_ref()?;
    let mut counts = vec![0_u32; SIZE];
    for depth in depth {
        counts[(*depth as usize).min(SIZE - 1)] += 1;
    }
    let holes = u64::from(counts[0]);
    let rank = rank(depth.len() as u64 - holes, 50);
    let mut seen = 0;
    let median = counts.iter().skip(1).position(|count| {
        seen += u64::from(*count);
        seen > rank
    });
    Some(FrameDepth {
        holes,
        median: median.map_or(0, |median| median as u32 + 1),
        along: match (frame.depth_kind, depth_conversion(frame)) {
            (DepthKind::Euclid, _) | (_, Some(_)) => DepthAxis::Ray,
            (DepthKind::Planar, None) => DepthAxis::Axis,
        },
    })
}

/// 10 %, 50 % and 90 % quantiles of luma.
pub(super) fn luma(frame: &Frame) -> [u8; 3] {
    let mut counts = [0; 256];
    let (pixels, _) = frame.rgb.samples().as_chunks::<3>();
    for pixel in pixels {
        counts[usize::from(pixel_luma(*pixel))] += 1;
    }
    [10, 50, 90].map(|percent| quantile(&counts, pixels.len() as u64, percent))
}

/// Luma of a pixel (weights of ITU-R BT.709 in 256ths).
fn pixel_luma([red, green, blue]: [u8; 3]) -> u8 {
    let luma = 54 * u32::from(red) + 183 * u32::from(green) + 19 * u32::from(blue);
    (luma >> 8) as u8
}
