//! Model observer: finds the answers that can still be read from an image if the frame is known, [`ObservedFrame`] and
//! [`Observation`].
//!
//! The observer is signal-known-exactly and location-known (Barrett and Myers, *Foundations of Image Science*, 2004,
//! chapter 13; Barrett, Yao, Rolland and Myers, "Model observers for assessment of image quality", PNAS 90:9758, 1993;
//! Rose, J. Opt. Soc. Am. 38:196, 1948; Burgess, J. Opt. Soc. Am. A 16:633, 1999). It knows the masks, classes, depth
//! and untouched pixels of a frame, but not the degradation, the enhancer or the answer. For each object it tests the
//! hypothesis that the received pixels show this object:
//!
//! 1. Channel (`channel`): fits an increasing curve from untouched to received codes for each colour channel; the
//!    residual is noise. A global tone curve or gain therefore changes nothing, and content that an enhancer invents
//!    counts as noise.
//! 2. Local light and noise (`local`): if most of the image agrees with one curve, the gain of the light and the noise
//!    are estimated for each tile. Uneven light therefore changes little, and an occluder changes nothing elsewhere.
//! 3. Outline (`cells`, `outlines`): compares the contrast of each element of the outline with the predicted one, at
//!    three scales. An object is seen if at least half of the elements at one scale are confirmed.
//! 4. Answer (`answers`): follows from the seen objects by the rules. Without a seen object that decides a question,
//!    there is no answer, and the caller guesses.
//!
//! The result is the share of answers that a viewer who knows frame, position and appearance could still find by
//! confirming each object piece by piece. It does not imply:
//!
//! - that a model could do this: an exactly known signal is far more than a viewer knows;
//! - an upper bound: the covariance is diagonal with two measured factors, half of an outline is a chosen threshold,
//!   and a viewer who uses the interior of objects or knows rooms may do better;
//! - that an enhancer destroyed evidence if its result is lower: sharpening and halos are not a function of the
//!   untouched code and smooth light, so they count as noise.
//!
//! Changed geometry counts as another image: a shift by four pixels at 640×480 is enough. `controls` makes images
//! without any evidence; the answers must then be guesses.

pub(crate) mod answers;
mod cells;
mod color_posterior;
pub mod controls;
mod local;
#[cfg(test)]
mod tests;
pub mod tiles;

use std::collections::BTreeMap;
use std::sync::Arc;

use super::colors::Palette;
use super::rules::Rules;
use super::statistics::scene_maps::SceneMaps;
use super::statistics::{FrameStatistics, measure};
use cells::{Cells, MIN_CONFIRMED, Outline, TILE, outlines, patch_sums};
use color_posterior::{ColorPosterior, LightEstimate};
use darkqa_base::error::Result;
use darkqa_base::types::{Digest, Frame, Labels, Rgb};
use tiles::{Tiles, area_mean};

pub use answers::is_in_rulebook;

/// Version of the observer's method; it enters the digest of the model.
pub const VERSION: u32 = 3;

/// The observer's knowledge of a frame: untouched pixels and the mask of every segment.
#[derive(Debug)]
pub struct ObservedFrame {
    untouched: Rgb,
    cells: Cells,
    tiles: Tiles,
    /// Number of each mask in the segment map.
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

    /// Observes a degraded or enhanced image of the frame. An image of another size is resampled to the size of the
    /// masks.
    #[must_use]
    pub fn observe(&self, image: &Rgb) -> Observation {
        self.observe_with(image, MIN_CONFIRMED)
    }

    /// Observes an image with another minimum share of confirmed elements for a seen object.
    #[must_use]
    pub fn observe_with(&self, image: &Rgb, min_confirmed: f64) -> Observation {
        let image = area_mean(image, [self.untouched.width(), self.untouched.height()]);
        let untouched = self.untouched.samples();
        let fit = local::fit(&self.tiles, &self.tiles.sums(untouched, image.samples()));
        let sums = patch_sums(&self.cells, untouched, &fit, &image);
        let outlines = outlines(&self.cells, &sums, &fit.tiles);
        // Tiny segments are not part of the statistics.
        let segments = &self.statistics.segments;
        let masks: BTreeMap<u32, usize> = self.numbers.iter().copied().zip(1..).collect();
        let outlines: BTreeMap<u32, Outline> = segments
            .iter()
            .filter_map(|segment| {
                let outline = outlines.get(*masks.get(&segment.id)?)?;
                Some((segment.id, *outline))
            })
            .collect();
        let light = LightEstimate::new(&self.cells, &self.tiles, &sums, &fit);
        let colors: BTreeMap<u32, Option<ColorPosterior>> = outlines
            .iter()
            .filter(|(_, outline)| outline.confirmed >= min_confirmed)
            .map(|(id, _)| (*id, light.color(masks[id] as u32)))
            .collect();
        Observation {
            explained: fit.explained,
            statistics: self.seen_only(&colors),
            frame: Arc::clone(&self.statistics),
            outlines,
            colors,
        }
    }

    /// Statistics of the frame, with the seen segments only.
    fn seen_only(&self, seen: &BTreeMap<u32, Option<ColorPosterior>>) -> FrameStatistics {
        let mut statistics = (*self.statistics).clone();
        statistics.segments.retain(|segment| seen.contains_key(&segment.id));
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
    /// Colour of each seen segment, by its number; `None` if too little of the segment is visible.
    colors: BTreeMap<u32, Option<ColorPosterior>>,
}

impl Observation {
    /// Share of the image's variance that the untouched frame explains (R²), from 0 to 1.
    #[must_use]
    pub fn explained_variance(&self) -> f64 {
        self.explained
    }

    /// Number of objects in the frame: segments that are not tiny.
    #[must_use]
    pub fn thing_count(&self) -> usize {
        self.frame.segments.len()
    }

    /// Number of objects that are seen.
    #[must_use]
    pub fn seen_count(&self) -> usize {
        self.statistics.segments.len()
    }

    /// Number of objects that are detected by their whole outline. It does not affect the answers.
    #[must_use]
    pub fn detected_count(&self) -> usize {
        self.outlines.values().filter(|outline| outline.is_detected()).count()
    }

    /// True if the segment of this number is seen.
    #[must_use]
    pub fn is_seen(&self, segment: u32) -> bool {
        self.colors.contains_key(&segment)
    }

    /// Number and class of each segment of the frame that is not tiny.
    pub fn segments(&self) -> impl Iterator<Item = (u32, &str)> {
        self.frame.segments.iter().map(|segment| (segment.id, &*segment.class))
    }

    /// Number of each object, confirmed share of its outline from 0 to 1, and z of the whole outline.
    pub fn outlines(&self) -> impl Iterator<Item = (u32, f64, f64)> {
        self.outlines.iter().map(|(id, outline)| (*id, outline.confirmed, outline.z))
    }
}
