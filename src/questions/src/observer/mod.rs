//! A model observer: which answers can still be read from given pixels by one who knows the frame, [`ObservedFrame`] and
//! [`Observation`].
//!
//! It is a signal-known-exactly, location-known observer (Barrett and Myers, *Foundations of Image Science*, 2004, chapter 13;
//! Barrett, Yao, Rolland and Myers, "Model observers for assessment of image quality", PNAS 90:9758, 1993; Rose, J. Opt. Soc.
//! Am. 38:196, 1948; Burgess, J. Opt. Soc. Am. A 16:633, 1999). It is given the masks, classes and depth of a frame and its
//! untouched pixels. It is not given the degradation, the enhancer or the answer. For each thing it tests the hypothesis that
//! the received pixels show this thing:
//!
//! 1. The channel (`channel`): an increasing curve for each colour channel from untouched to received codes, and the noise that
//!    is left. So a global tone curve or gain changes nothing, and what an enhancer invents counts as noise.
//! 2. Light and noise by the place (`local`): if most of the image agrees with one curve, the gain of the light and the noise are
//!    those of each tile. So uneven light changes little, and what covers a part of the image changes nothing elsewhere.
//! 3. The outline (`cells`, `outlines`): in each piece of outline, at three scales, the contrast is compared with the predicted
//!    one. A thing is seen if at least half of the pieces at one scale are confirmed.
//! 4. The answer (`answers`): by the rules, from the seen things alone. If nothing that is seen bears on a question, there is
//!    no answer, and the caller guesses.
//!
//! Conclusion: this share of the answers can still be found by a viewer who knows frame, place and appearance, and only has to confirm each
//! object piece by piece. It does not follow:
//!
//! - that a model could do this: to know the signal exactly is far more than a viewer knows;
//! - a bound: the covariance is diagonal with two measured factors, half of an outline is a rule, and one who uses the inside
//!   of things, or knows rooms, may do better;
//! - that an enhancer destroyed evidence where the line is lower: sharpening and halos are no function of the untouched code and
//!   of smooth light, and count as noise.
//!
//! Changed geometry is another image: a shift by four pixels at 640×480 is enough. `controls` spoils images in ways that leave
//! nothing to see; the answers must then be guesses.

mod answers;
mod cells;
mod channel;
mod color_posterior;
pub mod controls;
mod local;
mod outlines;
pub(crate) mod question_topic;
pub mod resample;
#[cfg(test)]
mod tests;
mod tiles;

use std::collections::BTreeMap;
use std::sync::Arc;

use super::colors::Palette;
use super::rules::Rules;
use super::statistics::scene_maps::SceneMaps;
use super::statistics::{FrameStatistics, measure};
use darkqa_ground::error::Result;
use darkqa_ground::types::{Digest, Frame, Labels, Rgb};

use cells::{Cells, TILE};
use color_posterior::{ColorPosterior, Light};
use outlines::{MIN_CONFIRMED, Outline, outlines, patch_sums};
pub use question_topic::is_in_rulebook;
use resample::area_mean;
use tiles::Tiles;

/// Version of the observer's method; it enters the digest of the model.
pub const VERSION: u32 = 3;

/// The observer's knowledge of a frame: its untouched pixels, and the place of every segment.
#[derive(Debug)]
pub struct ObservedFrame {
    untouched: Rgb,
    cells: Cells,
    tiles: Tiles,
    /// Number of each mask in the map of segments.
    numbers: Vec<u32>,
    statistics: Arc<FrameStatistics>,
}

impl ObservedFrame {
    /// Prepares an untouched frame for observation.
    ///
    /// # Errors
    /// If the frame has no classes.
    pub fn new(frame: &Frame, labels: &Labels, rules: &Rules, palette: &Palette) -> Result<Self> {
        let key = Digest::from_bytes(frame.id.0.as_bytes());
        let statistics = measure(frame, labels, rules, palette, key)?;
        let scene = SceneMaps::new(frame, labels)?;
        let cells = Cells::from_masks(&scene.masks, scene.size);
        Ok(Self {
            untouched: frame.rgb.clone(),
            tiles: Tiles::new(&frame.rgb, TILE * cells.side),
            cells,
            numbers: scene.numbers,
            statistics: Arc::new(statistics),
        })
    }

    /// Observes a degraded or enhanced image of the frame. An image of another size is resampled to that of the masks.
    #[must_use]
    pub fn observe(&self, image: &Rgb) -> Observation {
        self.observe_with(image, MIN_CONFIRMED)
    }

    /// The same with another share of the elements that must be confirmed for a thing to be seen.
    #[must_use]
    pub fn observe_with(&self, image: &Rgb, min_confirmed: f64) -> Observation {
        let image = area_mean(image, [self.untouched.width(), self.untouched.height()]);
        let untouched = self.untouched.samples();
        let fit = local::fit(&self.tiles, &self.tiles.sums(untouched, image.samples()));
        let sums = patch_sums(&self.cells, untouched, &fit, &image);
        let outlines = outlines(&self.cells, &sums, &fit.tiles);
        // The rules know the segments that are not tiny.
        let segments = &self.statistics.segments;
        let masks: BTreeMap<u32, usize> = self.numbers.iter().copied().zip(1..).collect();
        let outlines: BTreeMap<u32, Outline> = segments
            .iter()
            .filter_map(|segment| {
                let outline = outlines.get(*masks.get(&segment.id)?)?;
                Some((segment.id, *outline))
            })
            .collect();
        let seen = outlines
            .iter()
            .filter(|(_, outline)| outline.confirmed >= min_confirmed);
        let light = Light::new(&self.cells, &self.tiles, &sums, &fit);
        let colors: BTreeMap<u32, Option<ColorPosterior>> = seen
            .map(|(id, _)| (*id, light.shade(masks[id] as u32)))
            .collect();
        Observation {
            explained: fit.explained,
            statistics: self.seen_only(&colors),
            frame: Arc::clone(&self.statistics),
            outlines,
            colors,
        }
    }

    /// The statistics of the frame, with the seen segments only.
    fn seen_only(&self, seen: &BTreeMap<u32, Option<ColorPosterior>>) -> FrameStatistics {
        let mut statistics = (*self.statistics).clone();
        statistics
            .segments
            .retain(|segment| seen.contains_key(&segment.id));
        let (mut classes, mut words) = (BTreeMap::new(), BTreeMap::new());
        for segment in &statistics.segments {
            *classes.entry(segment.class.clone()).or_insert(0) += segment.area;
            if !segment.word.is_empty() {
                *words.entry(segment.word.clone()).or_insert(0) += segment.area;
            }
        }
        (statistics.classes, statistics.words) = (classes, words);
        statistics.loose.clear();
        statistics
    }
}

/// The observer's findings in one image of a frame.
#[derive(Debug, Clone)]
pub struct Observation {
    /// Share of the image's variance that the untouched frame explains (R²), from 0 to 1.
    explained: f64,
    /// Statistics of the frame, with the seen segments only.
    statistics: FrameStatistics,
    /// Statistics of the whole frame.
    frame: Arc<FrameStatistics>,
    /// Outline of each segment, by its number.
    outlines: BTreeMap<u32, Outline>,
    /// Colour of each seen segment, by its number.
    colors: BTreeMap<u32, Option<ColorPosterior>>,
}

impl Observation {
    /// The share of the image's variance that the untouched frame explains (R²), from 0 to 1.
    #[must_use]
    pub fn explained_variance(&self) -> f64 {
        self.explained
    }

    /// The number of things of the frame: segments that are not tiny.
    #[must_use]
    pub fn thing_count(&self) -> usize {
        self.frame.segments.len()
    }

    /// The number of things that are seen.
    #[must_use]
    pub fn seen_count(&self) -> usize {
        self.statistics.segments.len()
    }

    /// The number of things that are detected by their whole outline. This does not decide answers.
    #[must_use]
    pub fn detected_count(&self) -> usize {
        self.outlines
            .values()
            .filter(|outline| outline.is_detected())
            .count()
    }

    /// Whether the segment of this number is seen.
    #[must_use]
    pub fn is_seen(&self, segment: u32) -> bool {
        self.colors.contains_key(&segment)
    }

    /// The segments of the frame that are not tiny, each with its number and class.
    pub fn segments(&self) -> impl Iterator<Item = (u32, &str)> {
        self.frame
            .segments
            .iter()
            .map(|segment| (segment.id, &*segment.class))
    }

    /// For each thing by its number, the share of its outline that is confirmed, from 0 to 1, and the z of the whole outline.
    pub fn outlines(&self) -> impl Iterator<Item = (u32, f64, f64)> {
        self.outlines
            .iter()
            .map(|(id, outline)| (*id, outline.confirmed, outline.z))
    }
}
