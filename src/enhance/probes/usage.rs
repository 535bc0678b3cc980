//! Record of an enhancer's convention and counts in a run, shared by all threads ([`Usage`]), and the reaction to
//! implausible images ([`Implausible`]).
//!
//! Burnt-out images, in which most pixels are white although those of the degraded image differ: [`burnt_out`].

use std::collections::{BTreeMap, HashSet};
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};

use serde::{Deserialize, Serialize};

use super::plausible::{DARK, Gravity, MeasuredFlaw, UnclampedImage, brightness, judge, shows_nothing};
use crate::conventions::LUMA;
use darkqa_base::error::{Error, Result};
use darkqa_base::types::manifests::{ConventionLine, ELSEWHERE, EnhancerLatency, EnhancerNote, FlawedImage};
use darkqa_base::types::{Digest, Rgb, SizeLog};

/// Minimum number of dark images for a verdict on the enhancer; chosen as the number of frames of the probe.
const MIN_JUDGED: usize = super::probe::FRAMES;

/// Index in place of a twin's for images that were read from a store.
const STORED_TWIN: usize = usize::MAX;

/// Reaction to a model with implausible images.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Implausible {
    /// Refuse the model.
    #[default]
    Refused,
    /// Use the model (`--allow bad-enhancer`).
    Used,
    /// Do not judge images, because they belong to a finished run.
    NotLookedFor,
}

/// Judgement of one enhanced image.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub(super) enum Judgement {
    /// Not judged, because the degraded image is bright, where good models fail the rules, or because it shows nothing.
    #[default]
    Bright,
    /// Flaw of the enhanced image, if any; the degraded image is dark.
    Dark(Option<MeasuredFlaw>),
}

impl Judgement {
    /// Compares the enhanced image with the degraded one.
    pub(super) fn on([degraded, made]: [&Rgb; 2]) -> Self {
        if brightness(degraded) > DARK || shows_nothing(degraded) {
            Self::Bright
        } else {
            Self::Dark(judge(&UnclampedImage::downscaled(degraded), &UnclampedImage::downscaled(made)))
        }
    }
}

/// Contribution of one image to the enhancer's usage record; stored with the image.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct ImageUse {
    pub(super) seen: Judgement,
    /// Percentage of white pixels, if the image is burnt out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) white: Option<u8>,
    /// How the size of the image was handled.
    pub(super) sizes: SizeLog,
}

impl ImageUse {
    /// Records an image of a frame and condition (`place`) from another run or process, as if the enhancer in the file
    /// `model` made it now.
    ///
    /// # Errors
    /// If most of its images of dark frames so far are implausible.
    pub fn record(
        &self,
        usage: &Usage,
        model: &Path,
        place: [&dyn ToString; 2],
        implausible: Implausible,
    ) -> Result<()> {
        usage.add_sizes_of_stored(&self.sizes);
        self.count_burnt_out(usage, place, implausible);
        self.seen.record(usage, model, place, implausible)
    }
}

impl ImageUse {
    /// Counts the image of a frame and condition (`place`) if it is burnt out, unless images are not judged.
    pub(super) fn count_burnt_out(&self, usage: &Usage, place: [&dyn ToString; 2], implausible: Implausible) {
        if let Some(white) = self.white
            && implausible != Implausible::NotLookedFor
        {
            usage.count_burnt_out(white, place);
        }
    }

    /// Contribution of an image that another program enhanced.
    #[must_use]
    pub fn for_external([degraded, made]: [&Rgb; 2]) -> Self {
        Self {
            seen: Judgement::on([degraded, made]),
            white: white_percent([degraded, made]),
            sizes: SizeLog::default(),
        }
    }

    /// Records an image of a frame and condition (`place`) that another program enhanced.
    ///
    /// # Errors
    /// If most images of dark frames so far are implausible; the message names the folder.
    pub fn record_external(
        &self,
        usage: &Usage,
        folder: &Path,
        place: [&dyn ToString; 2],
        implausible: Implausible,
    ) -> Result<()> {
        self.count_burnt_out(usage, place, implausible);
        let judged = usage.judge(&self.seen, place, implausible);
        judged.map_err(|problem| {
            let remedy = "check that each has the name of its own dark image; --allow bad-enhancer uses them anyway";
            Error::data(folder.display(), format_args!("{problem}; {remedy}"))
        })
    }
}

/// Percentage of white pixels of an enhanced image that is burnt out; `None` if it is not.
pub(super) fn white_percent(images: [&Rgb; 2]) -> Option<u8> {
    burnt_out(images).map(|share| (100.0 * share).round() as u8)
}

impl Judgement {
    /// Counts the judgement of the image of a frame and condition (`place`), unless images are not judged.
    ///
    /// # Errors
    /// If most images of dark frames so far are implausible.
    pub(super) fn record(
        &self,
        usage: &Usage,
        model: &Path,
        place: [&dyn ToString; 2],
        implausible: Implausible,
    ) -> Result<()> {
        let judged = usage.judge(self, place, implausible);
        judged.map_err(|problem| Error::EnhancerEnded {
            path: model.to_owned(),
            problem: format!("{problem}. {}", doctor_advice(model)),
        })
    }
}

/// Sentence with the options for an enhancer whose images are implausible.
pub(super) fn doctor_advice(model: &Path) -> String {
    format!(
        "`darkqa-eval enhance doctor {} IMAGES… --out DIR` tries each value range and colour order; --allow bad-enhancer uses it anyway",
        model.display()
    )
}

/// Shared handle to the usage record of an enhancer, which is updated with each image.
#[derive(Debug, Clone, Default)]
pub struct Usage(Arc<Mutex<UsageState>>);

#[derive(Debug, Default)]
struct UsageState {
    note: EnhancerNote,
    /// Number of images whose flaw is impossible.
    impossible: usize,
    /// Digests of the frames and conditions whose images were judged.
    judged: HashSet<Digest>,
    /// Digests of the frames and conditions whose images are burnt out.
    burnt_out: HashSet<Digest>,
    /// Size adaptations by twin.
    sizes: BTreeMap<usize, SizeLog>,
}

impl Usage {
    /// A usage record for images that another program enhanced.
    #[must_use]
    pub fn for_external() -> Self {
        let usage = Self::default();
        usage.update(|note| {
            note.convention.push(ConventionLine {
                key: ELSEWHERE.to_owned(),
                value: "not by this program".to_owned(),
                source: "--enhanced".to_owned(),
            });
        });
        usage
    }

    /// Copy of the record's present state.
    pub fn note(&self) -> EnhancerNote {
        self.with(|state| state.note.clone())
    }

    /// Sets the times for an image.
    pub fn set_latency(&self, latency: Vec<EnhancerLatency>) {
        self.update(|note| note.latency = latency);
    }

    /// Sets the counts of whole, padded and tiled images of a twin.
    pub(crate) fn set_sizes(&self, twin: usize, log: &SizeLog) {
        self.change_sizes(twin, |sizes| sizes.clone_from(log));
    }

    fn change_sizes(&self, twin: usize, change: impl FnOnce(&mut SizeLog)) {
        self.with(|state| {
            change(state.sizes.entry(twin).or_default());
            let mut all = SizeLog::default();
            state.sizes.values().for_each(|log| all.add(log));
            state.note.sizes = all.summary();
            state.note.resized = all.resized + all.reduced > 0;
            state.note.size_counts = all;
        });
    }

    /// Adds the counts of an image that was read from a store.
    pub(super) fn add_sizes_of_stored(&self, log: &SizeLog) {
        self.change_sizes(STORED_TWIN, |sizes| sizes.add(log));
    }

    /// Resets the counts of stored images.
    pub(crate) fn reset_stored_counts(&self) {
        self.set_sizes(STORED_TWIN, &SizeLog::default());
    }

    /// Changes the record.
    pub(crate) fn update(&self, change: impl FnOnce(&mut EnhancerNote)) {
        self.with(|state| change(&mut state.note));
    }

    /// Counts a burnt-out image with its percentage of white pixels. An image of the same frame and condition counts
    /// once.
    fn count_burnt_out(&self, white: u8, [frame, condition]: [&dyn ToString; 2]) {
        let place = [frame, condition].map(ToString::to_string);
        let key = Digest::from_parts(place.iter().map(String::as_bytes));
        self.with(|state| {
            if state.burnt_out.insert(key) {
                let [frame, condition] = place;
                state.note.count_burnt_out(frame, condition, white);
            }
        });
    }

    /// Counts the judgement of an image. An image of the same frame and condition counts once.
    ///
    /// # Errors
    /// A message, if more than half of at least six images are implausible and such images are refused.
    pub(super) fn judge(
        &self,
        seen: &Judgement,
        [frame, condition]: [&dyn ToString; 2],
        implausible: Implausible,
    ) -> Result<(), String> {
        let &Judgement::Dark(verdict) = seen else {
            return Ok(());
        };
        if implausible == Implausible::NotLookedFor {
            return Ok(());
        }
        let place = [frame, condition].map(ToString::to_string);
        let key = Digest::from_parts(place.iter().map(String::as_bytes));
        if !self.with(|state| state.judged.insert(key)) {
            return Ok(());
        }
        let [frame, condition] = place;
        let flawed = verdict.map(|verdict| FlawedImage { frame, condition, flaw: verdict.flaw });
        self.with(|state| {
            state.note.judged.count(flawed);
            let impossible = verdict.filter(|verdict| verdict.gravity == Gravity::Impossible);
            state.impossible += usize::from(impossible.is_some());
            let judged = state.note.judged.images;
            match (impossible, implausible) {
                (Some(example), Implausible::Refused) if judged >= MIN_JUDGED && 2 * state.impossible > judged => {
                    Err(format!(
                        "{} of its {judged} images of dark frames are implausible; they {example}",
                        state.impossible
                    ))
                }
                _ => Ok(()),
            }
        })
    }

    fn with<T>(&self, use_state: impl FnOnce(&mut UsageState) -> T) -> T {
        use_state(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

/// Least luma of a white pixel, in codes (chosen: 255 with a rounding error).
const WHITE: f64 = 254.0;

/// Least share of white pixels in a burnt-out image; chosen.
const MIN_WHITE: f64 = 0.5;

/// Least share of pixels that are white but were clearly darker than the brightest ones; chosen. A white page is white
/// again when it is enhanced, and has no detail to lose.
const MIN_LOST: f64 = 0.25;

/// Ratio to the brightest pixels of the degraded image below which a pixel is clearly darker, in codes; chosen above
/// usual noise.
const DARKER: f64 = 0.8;

/// Share of the pixels that count as the brightest.
const BRIGHTEST_SHARE: f64 = 0.01;

/// Share of the white pixels of an enhanced image that is burnt out; `None` if it is not. The images have the same
/// size.
#[must_use]
pub fn burnt_out([degraded, enhanced]: [&Rgb; 2]) -> Option<f64> {
    let pixels = enhanced.samples().len() / 3;
    let is_white: Vec<bool> = lumas(enhanced).map(|luma| luma >= WHITE).collect();
    let white = is_white.iter().filter(|is_white| **is_white).count();
    let share = white as f64 / pixels.max(1) as f64;
    if share < MIN_WHITE {
        return None;
    }
    let before: Vec<f64> = lumas(degraded).collect();
    let rank = (before.len() as f64 * (1.0 - BRIGHTEST_SHARE)) as usize;
    let mut sorted = before.clone();
    let (_, brightest, _) = sorted.select_nth_unstable_by(rank.min(pixels - 1), f64::total_cmp);
    let limit = DARKER * *brightest;
    let lost = before.iter().zip(&is_white).filter(|(luma, is_white)| **is_white && **luma < limit).count();
    (lost as f64 >= MIN_LOST * pixels as f64).then_some(share)
}

/// Luma of each pixel, in codes.
fn lumas(image: &Rgb) -> impl Iterator<Item = f64> {
    image
        .samples()
        .as_chunks::<3>()
        .0
        .iter()
        .map(|pixel| pixel.iter().zip(LUMA).map(|(code, weight)| weight * f64::from(*code)).sum())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An image of squares of different brightness, multiplied by `gain`.
    fn squares(gain: f32) -> Rgb {
        let samples = (0..96 * 96).flat_map(|place| {
            let light = (place / 12 % 8 * 5 + place / 1152 * 3) as f32;
            [gain * light; 3].map(|code| code as u8)
        });
        Rgb::new(96, 96, samples.collect()).unwrap()
    }

    fn judged(usage: &Usage, frame: usize, made: &Rgb, how: Implausible) -> Result<(), String> {
        usage.judge(&Judgement::on([&squares(1.0), made]), [&frame, &"L3+ev+m"], how)
    }

    #[test]
    fn an_enhancer_ends_when_most_of_its_images_are_impossible() {
        let usage = Usage::default();
        let (good, flat) = (squares(3.0), Rgb::black(96, 96));
        for frame in 0..3 {
            judged(&usage, frame, &good, Implausible::Refused).unwrap();
        }
        for frame in 3..6 {
            judged(&usage, frame, &flat, Implausible::Refused).unwrap();
        }
        let problem = judged(&usage, 6, &flat, Implausible::Refused).unwrap_err();
        assert!(problem.starts_with("4 of its 7 images"), "{problem}");
        judged(&usage, 7, &flat, Implausible::Used).unwrap();
        assert_eq!(usage.note().judged.flaws(), 5);
    }

    #[test]
    fn an_image_that_is_made_again_counts_once() {
        let usage = Usage::default();
        let flat = Rgb::black(96, 96);
        for frame in [0, 1, 0, 1, 1] {
            judged(&usage, frame, &flat, Implausible::Used).unwrap();
        }
        let again = Judgement::on([&squares(1.0), &flat]);
        usage.judge(&again, [&0, &"L4+ev+m"], Implausible::Used).unwrap();
        let judged = usage.note().judged;
        assert_eq!((judged.images, judged.flaws()), (3, 3));
        assert_eq!(judged.examples.len(), 3);
    }

    #[test]
    fn burnt_out_images_count_once_by_condition() {
        let usage = Usage::default();
        let white = Rgb::new(96, 96, vec![255; 96 * 96 * 3]).unwrap();
        let burnt = ImageUse::for_external([&squares(2.0), &white]);
        let good = ImageUse::for_external([&squares(2.0), &squares(4.0)]);
        assert_eq!(good.white, None);
        for (used, frame, how) in [
            (&burnt, 1, Implausible::Used),
            (&burnt, 0, Implausible::Refused),
            (&burnt, 1, Implausible::Used),
            (&good, 2, Implausible::Used),
            (&burnt, 3, Implausible::NotLookedFor),
        ] {
            used.record(&usage, Path::new("m.onnx"), [&frame, &"L1+ev+m"], how).unwrap();
        }
        let note = usage.note();
        let found = &note.burnt_out["L1+ev+m"];
        assert_eq!((found.images, found.percents, &*found.example), (2, 200, "0"));
        let stored = serde_json::to_value(&good).unwrap();
        assert_eq!(stored.get("white"), None);
    }

    #[test]
    fn black_frames_are_not_judged() {
        let black = Rgb::black(96, 96);
        assert_eq!(Judgement::on([&black, &black]), Judgement::Bright);
        let dark = Judgement::on([&squares(1.0), &black]);
        assert!(matches!(dark, Judgement::Dark(Some(_))), "{dark:?}");
    }

    #[test]
    fn bright_frames_are_not_judged() {
        let usage = Usage::default();
        let bright = squares(6.0);
        let made = Rgb::black(96, 96);
        let seen = Judgement::on([&bright, &made]);
        assert_eq!(seen, Judgement::Bright);
        usage.judge(&seen, [&"frame", &"L0"], Implausible::Refused).unwrap();
        assert_eq!(usage.note().judged.images, 0);
    }

    /// A grey image of 100 × 100 pixels by the number of the pixel.
    fn grey(code: impl Fn(usize) -> u8) -> Rgb {
        let samples = (0..10_000).flat_map(|pixel| [code(pixel); 3]).collect();
        Rgb::new(100, 100, samples).unwrap()
    }

    #[test]
    fn a_white_image_of_a_scene_is_burnt_out() {
        let scene = grey(|pixel| (20 + pixel % 100) as u8);
        let white = grey(|pixel| if pixel % 100 < 3 { 200 } else { 255 });
        let share = burnt_out([&scene, &white]).unwrap();
        assert!((share - 0.97).abs() < 1e-9, "{share}");
    }

    #[test]
    fn a_good_image_is_not_burnt_out() {
        let scene = grey(|pixel| (20 + pixel % 100) as u8);
        let good = grey(|pixel| (2 * (20 + pixel % 100)) as u8);
        assert_eq!(burnt_out([&scene, &good]), None);
        // A third of the pixels is clipped.
        let bright = grey(|pixel| (3 * (20 + pixel % 100)).min(255) as u8);
        assert_eq!(burnt_out([&scene, &bright]), None);
        assert_eq!(burnt_out([&scene, &Rgb::black(100, 100)]), None);
    }

    /// Noise of 10 % around the code of white, with a few words in black.
    #[test]
    fn a_white_page_is_not_burnt_out() {
        let dark = grey(|pixel| if pixel % 10 == 0 { 10 } else { (122 + pixel * 7 % 28) as u8 });
        let page = grey(|pixel| if pixel % 10 == 0 { 20 } else { 255 });
        assert_eq!(burnt_out([&dark, &page]), None);
    }
}
