//! Measurement of a frame, `ComputeStats` of the paper's Algorithm 1: [`measure`].

use std::collections::BTreeMap;

use super::FrameStatistics;
use super::light_samples::LightSamples;
use super::mask_core::{frame_depth, luma};
use super::mask_shapes::MaskShapes;
use super::scene_maps::SceneMaps;
use crate::colors::Palette;
use crate::rules::Rules;
use darkqa_base::error::Result;
use darkqa_base::types::{Digest, Frame, Labels};

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
