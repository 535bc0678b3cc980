//! The dark frames that an enhancer is tried on before a run: [`dark_frames`], made of [`DarkFrames`].

use std::collections::BTreeSet;

use crate::error::Result;
use crate::images::frame_work::FrameWork;
use crate::images::frames::Source;
use crate::images::image_steps::ImageSteps;
use crate::images::trials::SourcePlan;
use crate::types::{Condition, EnhancerName, Rgb, Severity};
use darkqa_enhance::{DARK, FRAMES, brightness};
use darkqa_light::expose;

/// Exposure drops, in EV, by which frames are darkened if the plan has too few dark ones: that of L3 first.
const DROPS: [Severity; 3] = [Severity::L3, Severity::L2, Severity::L4];

/// The frames of a plan on which an enhancer may be tried, at most [`FRAMES`], spread over its sources.
pub(crate) struct DarkFrames<'a>(Vec<(&'a Source, Vec<Condition>)>);

impl<'a> DarkFrames<'a> {
    /// The frames of a whole run for the enhancer of this name, with the conditions that it enhances in a shard's plan, photographs in the
    /// dark apart. So all shards judge an enhancer alike, and one of them judges it for those that share its store. Without such frames
    /// or conditions, the frames of the plan.
    pub(crate) fn for_whole_run<I>(
        whole: &'a [Source],
        sources: &'a [Source],
        plan: &[SourcePlan<I>],
        name: &EnhancerName,
    ) -> Self {
        let conditions: BTreeSet<Condition> = plan
            .iter()
            .flat_map(SourcePlan::conditions)
            .filter(|condition| {
                condition.enhancer.as_ref() == Some(name) && condition.photograph().is_none()
            })
            .cloned()
            .collect();
        if whole.is_empty() || conditions.is_empty() {
            return Self::new(sources, plan, name);
        }
        let conditions: Vec<Condition> = conditions.into_iter().collect();
        Self(
            whole
                .iter()
                .map(|source| (source, conditions.clone()))
                .collect(),
        )
    }

    /// Frames for the enhancer of this name, with the conditions of the plan that it enhances.
    pub(crate) fn new<I>(
        sources: &'a [Source],
        plan: &[SourcePlan<I>],
        name: &EnhancerName,
    ) -> Self {
        let enhanced = |part: &SourcePlan<I>| -> Vec<Condition> {
            part.conditions()
                .filter(|&condition| condition.enhancer.as_ref() == Some(name))
                .cloned()
                .collect()
        };
        let parts: Vec<(&Source, Vec<Condition>)> = plan
            .iter()
            .map(|part| (&sources[part.source], enhanced(part)))
            .filter(|(_, conditions)| !conditions.is_empty())
            .collect();
        let spread = evenly(parts.len(), FRAMES).into_iter();
        Self(spread.map(|place| parts[place].clone()).collect())
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// The sources, of which the middle frame is taken, with their conditions.
    pub(crate) fn frames(&self) -> &[(&'a Source, Vec<Condition>)] {
        &self.0
    }
}

/// Dark images of these frames, at most [`FRAMES`], in the conditions that the enhancer enhances. Where these are not dark, the frames are
/// darkened by exposure.
///
/// # Errors
/// If a frame cannot be read.
pub(crate) fn dark_frames(steps: ImageSteps<'_>, frames: &DarkFrames<'_>) -> Result<Vec<Rgb>> {
    let mut works: Vec<FrameWork<'_>> = Vec::new();
    let mut conditions = Vec::new();
    for (source, enhanced) in &frames.0 {
        if let Some(frame) = source.middle() {
            works.push(FrameWork::planned(steps, source, frame));
            conditions.push(enhanced);
        }
    }
    let rounds = conditions.iter().map(|conditions| conditions.len()).max();
    let mut found = Vec::new();
    for round in 0..rounds.unwrap_or(0) {
        for (place, (work, conditions)) in works.iter_mut().zip(&conditions).enumerate() {
            // Another condition of each frame, so that all levels and kinds are met.
            let Some(condition) = conditions.get((place + round) % conditions.len().max(1)) else {
                continue;
            };
            if found.len() < FRAMES && round < conditions.len() {
                let resolved = work.resolved(condition)?;
                let image = resolved.work.degraded(resolved.condition.degradation())?;
                if brightness(image) <= DARK {
                    found.push(Rgb::clone(image));
                }
            }
        }
    }
    for drop in DROPS {
        for work in &mut works {
            if found.len() < FRAMES {
                found.push(expose(work.pixels()?, drop));
            }
        }
    }
    Ok(found)
}

/// Images for an enhancer that is tried without a plan: those of `images` that are dark, and darkened ones if there are too few.
pub(crate) fn darkened(images: &[Rgb]) -> Vec<Rgb> {
    let dark = images.iter().filter(|image| brightness(image) <= DARK);
    let darkened = DROPS
        .iter()
        .flat_map(|drop| images.iter().map(|image| expose(image, *drop)));
    dark.cloned().chain(darkened).take(FRAMES).collect()
}

/// At most `most` of `count` places, evenly spread.
pub(crate) fn evenly(count: usize, most: usize) -> Vec<usize> {
    let taken = count.min(most);
    (0..taken)
        .map(|i| (2 * i + 1) * count / (2 * taken))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_are_spread_and_never_repeated() {
        assert!(evenly(0, 6).is_empty());
        assert_eq!(evenly(2, 6), [0, 1]);
        assert_eq!(evenly(12, 6), [1, 3, 5, 7, 9, 11]);
        assert_eq!(evenly(7, 3), [1, 3, 5]);
    }

    #[test]
    fn bright_images_are_darkened_and_dark_ones_stay() {
        let image = |code: u8| Rgb::new(8, 8, vec![code; 192]).unwrap();
        let (dark, bright) = (image(20), image(200));
        let all = darkened(&[bright.clone(), dark.clone()]);
        assert_eq!(all.len(), 6);
        assert_eq!(all[0], dark);
        assert!(all.iter().all(|image| brightness(image) <= DARK));
    }
}
