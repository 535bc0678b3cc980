//! ComputeStats of the paper's Algorithm 1: [`measure`].

use std::collections::BTreeMap;

use super::FrameStatistics;
use super::light::{frame_depth, luma};
use super::reference::LightSamples;
use super::scene::SceneMaps;
use super::shape::MaskShapes;
use crate::colors::Palette;
use crate::rules::Rules;
use darkqa_ground::error::Result;
use darkqa_ground::types::{Digest, Frame, Labels};

/// Measures a frame.
///
/// Counts are whole pixels and lengths whole millimetres. Only the conversion of depth from the optical axis to the ray,
/// `z · √(1 + ((x − cx) / fx)² + ((y − cy) / fy)²)`, uses floating-point numbers. IEEE 754 rounds these operations the same
/// way on every machine.
///
/// # Errors
/// [`darkqa_ground::error::Error::Data`] with the frame if it has no classes at all.
pub fn measure(
    frame: &Frame,
    labels: &Labels,
    rules: &Rules,
    palette: &Palette,
    key: Digest,
) -> Result<FrameStatistics> {
    let rule = &rules.book().measure;
    let scene = SceneMaps::new(frame, labels)?;
    let size = scene.size;
    let shapes = MaskShapes::measure(&scene, rule);
    let (void, effective_void, lower_void) = scene.void(&shapes.joint, rule);
    let mut cores = shapes.cores(frame, &scene, rule, palette);
    let coarse = &rules.book().coarse;
    let samples = LightSamples::from_frame(frame, &scene, rule);
    let (mut classes, mut loose, mut words) = (BTreeMap::new(), BTreeMap::new(), BTreeMap::new());
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
    let mut segments = Vec::new();
    for (mask, shape) in shapes.list.iter().enumerate() {
        let Some(mut segment) = shapes.segment(frame, &scene, coarse, mask as u32 + 1, shape)
        else {
            continue;
        };
        if !segment.word.is_empty() {
            *words.entry(segment.word.clone()).or_insert(0) += segment.area;
        }
        if let Some(core) = cores[mask].take() {
            core.write_to(&mut segment);
            segment.around = samples.around(mask as u32 + 1, segment.bbox);
            segments.push(segment);
        }
    }
    Ok(FrameStatistics {
        frame: frame.id.clone(),
        key,
        scene: frame.scene.clone(),
        size,
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
