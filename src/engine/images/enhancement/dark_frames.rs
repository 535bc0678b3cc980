//! The dark frames on which an enhancer is probed before a run: [`DarkFrames`] selects them, [`dark_frames`] makes
//! them.

use std::collections::BTreeSet;

use crate::images::frame_work::FrameWork;
use crate::images::frames::Source;
use crate::images::timings::ImageSteps;
use crate::images::trials::SourcePlan;
use darkqa_base::error::Result;
use darkqa_base::types::{Condition, EnhancerName, Rgb, Severity};
use darkqa_enhance::{DARK, FRAMES, brightness, shows_nothing};
use darkqa_light::expose;

/// Exposure drops that darken frames if the plan has too few dark ones; L3 is used first.
const DROPS: [Severity; 3] = [Severity::L3, Severity::L2, Severity::L4];

/// Sources whose middle frames an enhancer is probed on, with the conditions to use. From a plan: at most [`FRAMES`],
/// evenly spaced.
pub(crate) struct DarkFrames<'a>(Vec<(&'a Source, Vec<Condition>)>);

impl<'a> DarkFrames<'a> {
    /// All sources of a run (`whole`), with the conditions that the enhancer of this name enhances in a shard's plan,
    /// except photographs in the dark. So all shards probe an enhancer on the same frames, and those that share a store
    /// probe it once. Without such sources or conditions, the sources of the plan are used.
    pub(crate) fn for_whole_run<I>(
        whole: &'a [Source],
        sources: &'a [Source],
        plan: &[SourcePlan<I>],
        name: &EnhancerName,
    ) -> Self {
        let conditions: BTreeSet<Condition> = plan
            .iter()
            .flat_map(SourcePlan::conditions)
            .filter(|condition| condition.enhancer.as_ref() == Some(name) && condition.photograph().is_none())
            .cloned()
            .collect();
        if whole.is_empty() || conditions.is_empty() {
            return Self::new(sources, plan, name);
        }
        let conditions: Vec<Condition> = conditions.into_iter().collect();
        Self(whole.iter().map(|source| (source, conditions.clone())).collect())
    }

    /// Sources of a plan, with the conditions that the enhancer of this name enhances.
    pub(crate) fn new<I>(sources: &'a [Source], plan: &[SourcePlan<I>], name: &EnhancerName) -> Self {
        let parts: Vec<(&Source, Vec<Condition>)> = plan
            .iter()
            .map(|part| {
                let enhanced: Vec<Condition> =
                    part.conditions().filter(|condition| condition.enhancer.as_ref() == Some(name)).cloned().collect();
                (&sources[part.source], enhanced)
            })
            .filter(|(_, conditions)| !conditions.is_empty())
            .collect();
        Self(evenly_spaced_indices(parts.len(), FRAMES).into_iter().map(|index| parts[index].clone()).collect())
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// The sources, whose middle frames are used, with their conditions.
    pub(crate) fn frames(&self) -> &[(&'a Source, Vec<Condition>)] {
        &self.0
    }
}

/// Makes up to [`FRAMES`] dark images of these frames in their conditions. If too few are dark, frames are darkened by
/// an exposure drop.
///
/// # Errors
/// If a frame cannot be read.
pub(crate) fn dark_frames(steps: ImageSteps<'_>, frames: &DarkFrames<'_>) -> Result<Vec<Rgb>> {
    let mut works: Vec<FrameWork<'_>> = Vec::new();
    let mut conditions = Vec::new();
    for (source, enhanced) in &frames.0 {
        if let Some(frame) = source.middle() {
            works.push(FrameWork::for_source(steps, source, frame));
            conditions.push(enhanced);
        }
    }
    let rounds = conditions.iter().map(|conditions| conditions.len()).max().unwrap_or(0);
    let mut found = Vec::new();
    for round in 0..rounds {
        for (index, (work, conditions)) in works.iter_mut().zip(&conditions).enumerate() {
            // Each frame starts with another condition, so that all levels and kinds are covered.
            let Some(condition) = conditions.get((index + round) % conditions.len().max(1)) else {
                continue;
            };
            if found.len() < FRAMES && round < conditions.len() {
                let resolved = work.resolve(condition)?;
                let image = resolved.work.degraded(resolved.condition.degradation())?;
                if brightness(image) <= DARK && !shows_nothing(image) {
                    found.push(Rgb::clone(image));
                }
            }
        }
    }
    for drop in DROPS {
        for work in &mut works {
            if found.len() < FRAMES {
                let image = expose(work.pixels()?, drop);
                if !shows_nothing(&image) {
                    found.push(image);
                }
            }
        }
    }
    Ok(found)
}

/// Up to [`FRAMES`] images to probe an enhancer without a plan: the dark ones of `images`, then darkened copies. Images
/// that show nothing are left out.
pub fn dark_or_darkened(images: &[Rgb]) -> Vec<Rgb> {
    let dark = images.iter().filter(|image| brightness(image) <= DARK);
    let darkened = DROPS.iter().flat_map(|drop| images.iter().map(|image| expose(image, *drop)));
    dark.cloned().chain(darkened).filter(|image| !shows_nothing(image)).take(FRAMES).collect()
}

/// Up to `max` evenly spaced indices below `count`.
pub fn evenly_spaced_indices(count: usize, max: usize) -> Vec<usize> {
    let taken = count.min(max);
    (0..taken).map(|i| (2 * i + 1) * count / (2 * taken)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn indices_are_spread_and_never_repeated() {
        assert!(evenly_spaced_indices(0, 6).is_empty());
        assert_eq!(evenly_spaced_indices(2, 6), [0, 1]);
        assert_eq!(evenly_spaced_indices(12, 6), [1, 3, 5, 7, 9, 11]);
        assert_eq!(evenly_spaced_indices(7, 3), [1, 3, 5]);
    }

    #[test]
    fn bright_images_are_darkened_and_dark_ones_stay() {
        let [dark, bright] = [20, 200].map(|code| {
            let samples = (0..192).map(|place| code + place / 24 * 5);
            Rgb::new(8, 8, samples.collect()).unwrap()
        });
        let all = dark_or_darkened(&[Rgb::black(8, 8), bright.clone(), dark.clone()]);
        assert_eq!(all.len(), 6);
        assert_eq!(all[0], dark);
        assert!(all.iter().all(|image| brightness(image) <= DARK));
    }
}
