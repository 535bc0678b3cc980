//! The darkroom: it makes the images, frame by frame in the order of the plan.
//!
//! Each is loaded, darkened, mended and encoded once for all the questions about it. The channel is bounded, so that
//! memory holds the images in flight, one or two more, and the frame that each core is at.

use std::borrow::Cow;
use std::collections::BTreeSet;
use std::sync::{Arc, Mutex, PoisonError};

use rayon::ThreadPool;
use tokio::sync::mpsc::Sender;

use super::gallery::Gallery;
use super::plan::{Choice, FramePlan, Shot};
use super::recipe::Recipe;
use super::thumbnail::{Wanted, thumbnail};
use super::timings::{Step, Timings};
use super::trial::{Exposed, Slide};
use crate::ask::{Format, ImageLimit, Payload};
use crate::dataset::{Dataset, Picture};
use crate::enhance::Enhancer;
use crate::error::{Error, Result};
use crate::synthesis::{Film, NoiseKey};
use crate::types::{Condition, Degradation, FrameId, ImageFacts, Rgb, Thumbnail};

/// What the thread works with.
pub(super) struct Darkroom<'a> {
    pub(super) dataset: &'a Dataset,
    /// The content of each image as the plan knows it.
    pub(super) pictures: &'a Gallery,
    pub(super) recipe: &'a Recipe,
    pub(super) enhancers: Vec<Enhancer>,
    /// What an image may be; `None` where nobody far away looks at it.
    pub(super) limit: Option<ImageLimit>,
    pub(super) timings: &'a Timings,
}

impl Darkroom<'_> {
    /// Makes the first image of each enhancer, so that one that does not work is found before anything is asked.
    fn rehearse(&mut self, frames: &[FramePlan]) -> Result<()> {
        let shots = frames.iter().flat_map(|plan| {
            let conditions = plan.shots.iter().filter_map(|shot| shot.condition.as_ref());
            conditions.map(|condition| (&plan.frame, condition))
        });
        let mut tried = BTreeSet::new();
        for (frame, condition) in shots {
            if let Some(name) = &condition.enhancer
                && tried.insert(name)
            {
                self.image(&mut Desk::new(frame.clone()), condition)?;
            }
        }
        Ok(())
    }

    /// Makes the images of the frame with the most pixels in every condition without an enhancer, so that one which is too
    /// large for the endpoint is found before anything is paid for; the largest of them.
    pub(super) fn largest(&mut self, frames: &[FramePlan]) -> Result<Option<ImageFacts>> {
        let pixels = |plan: &&FramePlan| {
            let pictured = self.pictures.get(&plan.frame);
            pictured.map_or(0, |pictured| {
                u64::from(pictured.size.0) * u64::from(pictured.size.1)
            })
        };
        let Some(plan) = frames.iter().max_by_key(pixels) else {
            return Ok(None);
        };
        let mut desk = Desk::new(plan.frame.clone());
        let conditions = plan.shots.iter().filter_map(|shot| shot.condition.as_ref());
        let mut largest: Option<ImageFacts> = None;
        for condition in conditions.filter(|condition| condition.enhancer.is_none()) {
            let image = self
                .image(&mut desk, condition)
                .map_err(|e| e.at(format!("frame {} at {condition}", plan.frame)))?;
            let facts = image.facts();
            if largest
                .as_ref()
                .is_none_or(|largest| facts.bytes > largest.bytes)
            {
                largest = Some(facts.clone());
            }
        }
        Ok(largest)
    }

    /// Makes what would stop a run halfway before anything is paid for: [`Self::rehearse`] and, where images leave the machine,
    /// [`Self::largest`], of which it is said where nobody knows whether the endpoint takes it.
    pub(super) fn check(&mut self, frames: &[FramePlan]) -> Result<()> {
        self.rehearse(frames)?;
        if self.limit.is_some() {
            warn_of_large(self.largest(frames)?.as_ref(), self.limit);
        }
        Ok(())
    }

    /// Makes the images of all frames until they are done or nobody waits for them any more.
    ///
    /// Each of `benches`, which has one thread, takes frame after frame. Where there is an enhancer, which has threads of its own and
    /// takes one image at a time, or there are few frames, all `cores` work on one frame, row by row.
    pub(super) fn develop(
        mut self,
        frames: Vec<FramePlan>,
        wanted: &Wanted,
        (cores, benches): (&ThreadPool, &[ThreadPool]),
        out: &Sender<Exposed<Choice>>,
    ) {
        if !self.enhancers.is_empty() || frames.len() < 2 * benches.len() {
            return cores.install(|| self.one_by_one(frames.into_iter(), wanted, out));
        }
        let frames = Mutex::new(frames.into_iter());
        let next = || frames.lock().unwrap_or_else(PoisonError::into_inner).next();
        std::thread::scope(|scope| {
            for bench in benches {
                let mut own = Darkroom {
                    dataset: self.dataset,
                    pictures: self.pictures,
                    recipe: self.recipe,
                    enhancers: Vec::new(),
                    limit: self.limit,
                    timings: self.timings,
                };
                scope.spawn(move || {
                    bench.install(|| own.one_by_one(std::iter::from_fn(next), wanted, out));
                });
            }
        });
    }

    fn one_by_one(
        &mut self,
        frames: impl Iterator<Item = FramePlan>,
        wanted: &Wanted,
        out: &Sender<Exposed<Choice>>,
    ) {
        for FramePlan { frame, shots } in frames {
            let mut desk = Desk::new(frame.clone());
            for Shot { condition, trials } in shots {
                let made = self.expose(&mut desk, condition.as_ref(), wanted);
                let (images, thumbnail, problem) = match made {
                    Ok((image, thumbnail)) => (image, thumbnail, None),
                    Err(problem) => (None, None, Some(problem.to_string())),
                };
                let exposed = Exposed {
                    slide: Slide {
                        condition,
                        images: images.into_iter().collect(),
                    },
                    trials,
                    problem,
                    thumbnail,
                };
                let send = || out.blocking_send(exposed).is_err();
                let gone = self.timings.time(Step::Waiting, send);
                if gone {
                    return;
                }
            }
        }
    }

    /// The image of a shot, and a small copy of it where one is wanted.
    pub(super) fn expose(
        &mut self,
        desk: &mut Desk,
        condition: Option<&Condition>,
        wanted: &Wanted,
    ) -> Result<(Option<Arc<Payload>>, Option<Thumbnail>)> {
        let Some(condition) = condition else {
            return Ok((None, None));
        };
        let frame = desk.frame.clone();
        let (image, encoded) = self.print(desk, condition)?;
        if !wanted.lacks(&frame, condition) {
            return Ok((Some(image), None));
        }
        let timings = self.timings;
        let encoded = match encoded {
            Some(encoded) => encoded,
            None => Cow::Borrowed(timings.time(Step::Decode, || desk.decode())?),
        };
        let copy = || thumbnail(&frame, condition, &image, Some(&*encoded));
        let copy = timings.time(Step::Encode, copy)?;
        Ok((Some(image), Some(copy)))
    }

    pub(super) fn image(&mut self, desk: &mut Desk, condition: &Condition) -> Result<Arc<Payload>> {
        Ok(self.print(desk, condition)?.0)
    }

    /// The image of a condition as it is sent, and the pixels that were encoded; `None` where the frame's own file is sent, which
    /// needs no decoding.
    fn print<'d>(
        &mut self,
        desk: &'d mut Desk,
        condition: &Condition,
    ) -> Result<(Arc<Payload>, Option<Cow<'d, Rgb>>)> {
        let Recipe {
            format, max_side, ..
        } = *self.recipe;
        let timings = self.timings;
        let read = || desk.picture(self.dataset, self.pictures).map(drop);
        timings.time(Step::Decode, read)?;
        let picture = desk.picture(self.dataset, self.pictures)?;
        // The file itself, where it is the very image that would be encoded.
        if *condition == Condition::raw(Degradation::None)
            && format == Format::Png
            && let Picture::Encoded { bytes, .. } = picture
            && let Some(payload) = Payload::of_plain_png(bytes, max_side)
        {
            return Ok((self.within(payload)?, None));
        }
        let pixels = self.pixels(desk, condition)?;
        let (payload, pixels) = timings.time(Step::Encode, || {
            let pixels = match Payload::scaled(&pixels, max_side)? {
                Cow::Owned(scaled) => Cow::Owned(scaled),
                Cow::Borrowed(_) => pixels,
            };
            Ok((Payload::encode(&pixels, format, None)?, pixels))
        })?;
        Ok((self.within(payload)?, Some(pixels)))
    }

    fn within(&self, payload: Payload) -> Result<Arc<Payload>> {
        if let Some(limit) = &self.limit {
            limit.check(payload.facts())?;
        }
        Ok(Arc::new(payload))
    }

    /// The pixels of a frame in a condition.
    pub(super) fn pixels<'d>(
        &mut self,
        desk: &'d mut Desk,
        condition: &Condition,
    ) -> Result<Cow<'d, Rgb>> {
        let timings = self.timings;
        timings.time(Step::Decode, || {
            desk.picture(self.dataset, self.pictures)?;
            desk.decode()
        })?;
        let dark = timings.time(Step::Darken, || {
            desk.dark(self.recipe, condition.degradation)
        })?;
        let Some(name) = &condition.enhancer else {
            return Ok(Cow::Borrowed(dark));
        };
        let mut enhancers = self.enhancers.iter_mut();
        let enhancer = enhancers.find(|enhancer| enhancer.name() == name);
        let enhancer =
            enhancer.ok_or_else(|| Error::data(condition, "this enhancer is not open"))?;
        let mended = timings.time(Step::Enhance, || enhancer.enhance(dark));
        mended.map(Cow::Owned)
    }
}

/// Images from this size on, in bytes, are more than some servers and proxies take.
const LARGE: usize = 5_000_000;

/// Says so where images are large and nobody knows whether the endpoint takes them.
fn warn_of_large(largest: Option<&ImageFacts>, limit: Option<ImageLimit>) {
    if let Some(image) = largest
        && image.bytes > LARGE
        && limit == Some(ImageLimit::UNKNOWN)
    {
        tracing::warn!(
            "images are up to {:.1} MB, {:.1} MB as sent; where the server answers 413, --max-side or --image jpeg:95 makes them smaller",
            image.bytes as f64 / 1e6,
            image.bytes as f64 / 0.75e6
        );
    }
}

/// What lies on the desk while one frame is worked on: each step is done when it is first needed, and once.
pub(super) struct Desk {
    frame: FrameId,
    picture: Option<Picture>,
    clean: Option<Rgb>,
    film: Film,
    dark: Option<(Degradation, Rgb)>,
}

impl Desk {
    pub(super) fn new(frame: FrameId) -> Self {
        Self {
            frame,
            picture: None,
            clean: None,
            film: Film::default(),
            dark: None,
        }
    }

    /// The frame's file; an error where it is not the one that the plan was made with.
    fn picture(&mut self, dataset: &Dataset, planned: &Gallery) -> Result<&Picture> {
        once(&mut self.picture, || {
            let picture = dataset.picture(&self.frame)?;
            let planned = planned.get(&self.frame);
            if planned.map(|planned| planned.digest) == Some(picture.digest()) {
                return Ok(picture);
            }
            let problem = "the image was changed while the run was under way; put it back, or begin a new run";
            Err(Error::data(&self.frame, problem))
        })
    }

    /// The frame as it lies in the data.
    fn decode(&mut self) -> Result<&Rgb> {
        let Self {
            frame,
            picture,
            clean,
            ..
        } = self;
        once(clean, || match picture {
            Some(picture) => picture.decode(),
            None => Err(Error::data(&*frame, "the frame was not read")),
        })
    }

    /// The frame in one degradation; the last one is kept for the enhancers that follow.
    fn dark(&mut self, recipe: &Recipe, degradation: Degradation) -> Result<&Rgb> {
        self.decode()?;
        let Self {
            frame,
            clean,
            film,
            dark,
            ..
        } = self;
        let Some(clean) = clean else {
            return Err(Error::data(&*frame, "the frame was not read"));
        };
        if dark.as_ref().is_some_and(|(made, _)| *made != degradation) {
            *dark = None;
        }
        let (_, image) = once(dark, || {
            let key = NoiseKey::new(recipe.seed, frame);
            let image = film.degrade(clean, degradation, &key, &recipe.synthesis);
            Ok((degradation, image))
        })?;
        Ok(image)
    }
}

/// What is in a slot, made first where it is empty.
fn once<T>(slot: &mut Option<T>, make: impl FnOnce() -> Result<T>) -> Result<&T> {
    let value = match slot.take() {
        Some(value) => value,
        None => make()?,
    };
    Ok(slot.insert(value))
}

#[cfg(test)]
mod tests {
    use std::num::NonZeroU32;

    use super::*;
    use crate::run::gallery::look_at;
    use crate::synthesis::Synthesis;

    /// A folder with one frame as a plain PNG file, and the frame's name.
    fn frame() -> (tempfile::TempDir, Dataset, FrameId) {
        let folder = tempfile::tempdir().unwrap();
        let samples = (0..40 * 60 * 3).map(|i| (i * i % 251) as u8).collect();
        let pixels = Rgb::new(40, 60, samples).unwrap();
        let file = Payload::encode(&pixels, Format::Png, None).unwrap().file();
        std::fs::write(folder.path().join("a.png"), file.unwrap()).unwrap();
        let dataset = Dataset::of_images(folder.path()).unwrap();
        let name = dataset.frames().next().unwrap().clone();
        (folder, dataset, name)
    }

    /// What is sent and kept of the frame, and whether it was decoded.
    fn exposed(
        condition: &str,
        (format, max_side): (&str, Option<u32>),
        wanted: bool,
    ) -> (Arc<Payload>, Option<Thumbnail>, bool) {
        let (_folder, dataset, frame) = frame();
        let pictures = [(frame.clone(), look_at(&dataset, &frame).unwrap())].into();
        let recipe = Recipe {
            seed: 0,
            synthesis: Synthesis::default(),
            format: format.parse().unwrap(),
            max_side: max_side.and_then(NonZeroU32::new),
            enhancers: Vec::new(),
        };
        let mut darkroom = Darkroom {
            dataset: &dataset,
            pictures: &pictures,
            recipe: &recipe,
            enhancers: Vec::new(),
            limit: None,
            timings: &Timings::default(),
        };
        let wanted = Wanted::new(wanted.then_some(&frame), Vec::new());
        let mut desk = Desk::new(frame);
        let condition = condition.parse().unwrap();
        let (image, copy) = darkroom
            .expose(&mut desk, Some(&condition), &wanted)
            .unwrap();
        (image.unwrap(), copy, desk.clean.is_some())
    }

    #[test]
    fn a_file_that_is_sent_as_it_is_is_decoded_for_a_copy_alone() {
        let (sent, copy, decoded) = exposed("L0", ("png", None), false);
        assert!(copy.is_none() && !decoded);
        let (folder, ..) = frame();
        let file = std::fs::read(folder.path().join("a.png")).unwrap();
        assert_eq!(sent.file().unwrap(), file);
        let (sent, copy, decoded) = exposed("L0", ("png", None), true);
        assert!(decoded);
        assert_eq!(copy.unwrap().image, sent.facts().digest);
    }

    #[test]
    fn copies_show_what_was_sent() {
        for condition in ["L0", "L2-ev", "L3-noise"] {
            for how in [("png", None), ("png", Some(50)), ("jpeg:60", Some(50))] {
                let (sent, copy, _) = exposed(condition, how, true);
                let copy = copy.unwrap();
                let of_file = thumbnail(&copy.frame, &copy.condition, &sent, None).unwrap();
                assert_eq!(copy, of_file, "{condition} {how:?}");
            }
        }
    }
}
