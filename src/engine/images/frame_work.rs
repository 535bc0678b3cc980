//! Cached steps from one frame to its images: [`FrameWork`].
//!
//! Conditions of pairs of a frame and its photograph in the dark: the photograph itself, or a degradation that is as
//! dark ([`Resolved`]).
//!
//! One image of a frame before its enhancer ([`StagedImage`]) and as it is sent ([`PreparedImage`]).

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::{Duration, Instant};

use super::frames::matching_degradation;
use super::notes::similarity;
use super::stored::{Needed, Similarity, StoredNotes};
use super::timings::ImageSteps;
use crate::images::frames::{DegradeStage, Source, SourceFrame, SourcePhotograph};
use crate::images::recipes::Recipe;
use crate::images::stored::StoredPlace;
use crate::images::timings::TimedStep;
use darkqa_base::error::{Error, Result};
use darkqa_base::types::{
    Condition, Degradation, Digest, EnhancerName, ExposureFacts, FrameId, InputNote, PairDark, PairFacts, PhotoName,
    Pixels, Rgb, Treatment,
};
use darkqa_data::Picture;
use darkqa_enhance::ImageUse;
use darkqa_light::{AppliedDegradation, Exposures, FrameView, NoiseKey};
use darkqa_pictures::{Payload, PayloadFormat, Scaling, bilinear};

/// Cached steps of one frame (file, clean pixels, degraded image). Each is computed on first use.
pub struct FrameWork<'a> {
    pub steps: ImageSteps<'a>,
    frame: FrameId,
    /// Source of the frame, which may share its camera state.
    source: FrameId,
    /// Digest of the file when the plan was made; `None` if any file is accepted.
    planned_digest: Option<Digest>,
    /// Name of the source and its frame, for the store keys; `None` without a store or a plan.
    origin: Option<Box<(FrameId, SourceFrame)>>,
    /// Width and height of the file, in pixels.
    size: Option<(u32, u32)>,
    picture: Option<Picture>,
    pixels: Option<Pixels>,
    /// The clean frame as 8-bit codes.
    clean: Option<Arc<Rgb>>,
    /// The clean frame in the size sent.
    clean_as_sent: Option<Arc<Rgb>>,
    exposures: Exposures,
    degraded: Option<(Degradation, Arc<Rgb>)>,
    /// Photographs of the scene in the dark.
    photographs: Vec<SourcePhotograph>,
    /// Cached steps of these photographs, by name.
    photograph_works: BTreeMap<PhotoName, Box<Self>>,
    /// If these are the steps of a photograph: the name of its frame and its own; else `None`.
    photograph: Option<(FrameId, PhotoName)>,
}

impl<'a> FrameWork<'a> {
    /// The steps of a frame of a planned source. The file is read on first use, and must still have the same digest.
    pub fn for_source(steps: ImageSteps<'a>, source: &Source, frame: &SourceFrame) -> Self {
        Self {
            origin: steps.stored.map(|_| Box::new((source.name.clone(), frame.clone()))),
            size: Some(frame.size),
            photographs: frame.photographs.clone(),
            ..Self::new(steps, frame.id.clone(), source.name.clone(), Some(frame.digest))
        }
    }

    /// The steps of a frame without a plan; the digest of its file is not checked.
    pub fn for_frame(steps: ImageSteps<'a>, frame: FrameId) -> Self {
        Self::new(steps, frame.clone(), frame, None)
    }

    fn new(steps: ImageSteps<'a>, frame: FrameId, source: FrameId, planned_digest: Option<Digest>) -> Self {
        Self {
            steps,
            frame,
            source,
            planned_digest,
            origin: None,
            size: None,
            picture: None,
            pixels: None,
            clean: None,
            clean_as_sent: None,
            exposures: Exposures::default(),
            degraded: None,
            photographs: Vec::new(),
            photograph_works: BTreeMap::new(),
            photograph: None,
        }
    }

    /// Width and height of the file, in pixels; `None` for an unplanned frame that was not read yet.
    pub fn size(&self) -> Option<[u32; 2]> {
        self.size.map(|(width, height)| [width, height])
    }

    /// The name of the frame.
    pub fn frame(&self) -> &FrameId {
        &self.frame
    }

    /// The place in the store of this frame in a condition; `None` without a store, and for photographs in the dark.
    ///
    /// # Errors
    /// If the frame cannot be shown in the condition.
    pub fn stored_place(&self, condition: &Condition) -> Result<Option<StoredPlace<'a>>> {
        let (Some(stored), Some(origin)) = (self.steps.stored, &self.origin) else {
            return Ok(None);
        };
        let (source, frame) = &**origin;
        let place = stored.place(self.steps.recipe, source, frame, condition)?;
        Ok(Some(place))
    }

    /// Changes that reading the file makes besides decoding it.
    pub fn note(&mut self) -> Result<InputNote> {
        self.picture().map(Picture::note)
    }

    /// The file of the frame, if it is a plain PNG that can be sent unchanged; else `None`.
    pub fn unchanged_file(&mut self, condition: &Condition) -> Result<Option<Arc<Payload>>> {
        let Recipe { format, scaling, .. } = *self.steps.recipe;
        if *condition != Condition::L0 || format != PayloadFormat::Png || matches!(scaling, Scaling::LongerSide(_)) {
            return Ok(None);
        }
        let Picture::Encoded(file) = self.picture()? else {
            return Ok(None);
        };
        file.plain_png()
            .filter(|payload| {
                let (width, height) = payload.size();
                scaling.size(width as u32, height as u32) == payload.size()
            })
            .map(|payload| self.steps.check_size(payload))
            .transpose()
    }

    /// The file of the frame, not decoded.
    ///
    /// # Errors
    /// If it cannot be read, or its digest is not that of the plan.
    pub fn picture(&mut self) -> Result<&Picture> {
        let (steps, frame, planned_digest) = (self.steps, &self.frame, self.planned_digest);
        let photograph = self.photograph.as_ref();
        get_or_try_insert(&mut self.picture, || {
            let picture = steps.timings.time(TimedStep::Decode, || match photograph {
                None => steps.frames.picture(frame),
                Some((of, name)) => steps.frames.photograph(of, name),
            })?;
            if planned_digest.is_none_or(|planned| planned == picture.digest()) {
                return Ok(picture);
            }
            let problem = "the image was changed during the run; restore it, or begin a new run";
            Err(Error::data(frame, problem))
        })
    }

    /// The pixels of the clean frame in the bit depth of its file. They are scaled already if frames are degraded after
    /// scaling.
    ///
    /// # Errors
    /// If the file is broken, or a frame of more than 8 bits would be degraded after scaling.
    pub fn pixels(&mut self) -> Result<&Pixels> {
        if self.pixels.is_none() {
            let ImageSteps { recipe, timings, .. } = self.steps;
            let picture = self.picture()?;
            let pixels = timings.time(TimedStep::Decode, || picture.pixels())?;
            let pixels = match (recipe.degraded_at, recipe.scaling) {
                (DegradeStage::Resized, Scaling::LongerSide(side)) => {
                    resize(pixels, side).map_err(|problem| Error::data(&self.frame, problem))?
                }
                _ => pixels,
            };
            self.pixels = Some(pixels);
        }
        get_or_try_insert(&mut self.pixels, || Err(Error::data(&self.frame, "the frame was not read")))
    }

    /// The clean frame as 8-bit codes, in the size of [`Self::pixels`].
    pub fn clean(&mut self) -> Result<&Arc<Rgb>> {
        if self.clean.is_none() {
            self.clean = Some(self.pixels()?.codes());
        }
        get_or_try_insert(&mut self.clean, || Err(Error::data(&self.frame, "the frame was not read")))
    }

    /// The clean frame in the size sent.
    pub fn clean_as_sent(&mut self) -> Result<Arc<Rgb>> {
        if let Some(clean) = &self.clean_as_sent {
            return Ok(Arc::clone(clean));
        }
        let steps = self.steps;
        let scaled = steps.scaled(self.clean()?)?;
        Ok(Arc::clone(self.clean_as_sent.insert(scaled)))
    }

    /// The key of the noise of a degradation of this frame.
    fn noise_key(&self, how: &Degradation) -> NoiseKey {
        self.steps.recipe.noise_key(&self.source, &self.frame, how.draw())
    }

    /// The parameters of a degradation for this frame.
    pub fn apply(&mut self, how: &Degradation) -> Result<AppliedDegradation> {
        let recipe = self.steps.recipe;
        let key = self.noise_key(how);
        let view = if how.kind().has_motion() { self.view()? } else { FrameView::default() };
        recipe.kinds.apply(how, view, &key).map_err(|e| Error::data(format_args!("{} at {how}", self.frame), e))
    }

    /// The camera's exposure in a condition; `None` for a kind that leaves it open.
    pub fn exposure(&mut self, condition: &Condition) -> Result<Option<ExposureFacts>> {
        let how = condition.degradation().filter(|how| how.kind().has_motion());
        let applied = how.map(|how| self.apply(how)).transpose()?;
        Ok(applied.and_then(|applied| applied.exposure()))
    }

    /// Width and focal length of the frame as the camera saw it.
    fn view(&mut self) -> Result<FrameView> {
        let steps = self.steps;
        let size = match self.size {
            Some(size) => size,
            None => self.picture()?.check()?,
        };
        self.size = Some(size);
        Ok(steps.recipe.view(size, steps.frames.focal(&self.frame)))
    }

    /// True if the file was decoded.
    #[cfg(test)]
    pub(crate) fn is_decoded(&self) -> bool {
        self.pixels.is_some()
    }

    /// The degraded frame, or the clean one without a degradation. The last degraded frame is cached, because several
    /// enhancers use it.
    pub fn degraded(&mut self, how: Option<&Degradation>) -> Result<&Arc<Rgb>> {
        let Some(how) = how else {
            return self.clean();
        };
        let applied = self.apply(how)?;
        self.pixels()?;
        let key = self.noise_key(how);
        let Self { steps, frame, pixels, exposures, degraded, .. } = self;
        if degraded.as_ref().is_some_and(|(cached, _)| cached != how) {
            *degraded = None;
        }
        let (_, image) = get_or_try_insert(degraded, || {
            let pixels = pixels.as_ref().ok_or_else(|| Error::data(&*frame, "the frame was not read"))?;
            let image = steps.timings.time(TimedStep::Degrade, || exposures.degrade(pixels.into(), &applied, &key));
            Ok((how.clone(), Arc::new(image)))
        })?;
        Ok(image)
    }
}

/// Scales a frame of 8 bits to a longer side of `side` pixels.
fn resize(pixels: Pixels, side: usize) -> Result<Pixels, String> {
    if pixels.height().max(pixels.width()) == side {
        return Ok(pixels);
    }
    let Pixels::Codes8(codes) = &pixels else {
        let problem =
            "the frame has more than 8 bits, and --degrade resized scales frames of 8 bits; take --degrade native";
        return Err(problem.to_owned());
    };
    let resized = bilinear(codes, side).map_err(|e| e.to_string())?;
    Ok(Pixels::Codes8(Arc::new(resized)))
}

/// The value in a slot, which is computed first if the slot is empty.
fn get_or_try_insert<T>(slot: &mut Option<T>, compute: impl FnOnce() -> Result<T>) -> Result<&T> {
    let value = match slot.take() {
        Some(value) => value,
        None => compute()?,
    };
    Ok(slot.insert(value))
}

/// A condition of one frame after pairs are replaced: a photograph becomes an untouched frame, and a synthetic image as
/// dark as the photograph becomes a degradation with the exposure drop of that photograph. So all rules for untouched
/// and degraded frames apply.
pub struct Resolved<'w, 'a> {
    /// The steps of the frame, or of its photograph.
    pub work: &'w mut FrameWork<'a>,
    /// The condition of `work`: untouched or degraded.
    pub condition: Condition,
    /// How dark the photograph is; `None` if the condition has no pair.
    pub pair: Option<PairFacts>,
}

impl<'a> FrameWork<'a> {
    /// Replaces the pair in a condition of this frame.
    ///
    /// # Errors
    /// If the frame has no such photograph, or its exposure drop is unknown or cannot be synthesised.
    pub fn resolve(&mut self, condition: &Condition) -> Result<Resolved<'_, 'a>> {
        match &condition.treatment {
            Treatment::Untouched | Treatment::Degraded(_) => {
                Ok(Resolved { work: self, condition: condition.clone(), pair: None })
            }
            Treatment::Paired(PairDark::Match(kind, reading)) => {
                let (how, facts) =
                    matching_degradation(&self.photographs, *kind, reading.as_ref()).ok_or_else(|| {
                        let problem = "no photograph in the dark with a known exposure drop";
                        Error::data(&self.frame, problem)
                    })?;
                Ok(Resolved {
                    work: self,
                    condition: with_treatment(condition, Treatment::Degraded(how)),
                    pair: Some(facts),
                })
            }
            Treatment::Paired(PairDark::Photograph(name)) => {
                let pair = Some(self.pair_facts(name)?);
                Ok(Resolved {
                    work: self.photograph_work(name)?,
                    condition: with_treatment(condition, Treatment::Untouched),
                    pair,
                })
            }
        }
    }

    /// How dark a photograph is; measured on first use.
    fn pair_facts(&mut self, name: &PhotoName) -> Result<PairFacts> {
        let index = self.photograph_index(name)?;
        if let Some(facts) = self.photographs[index].facts {
            return Ok(facts);
        }
        let normal = Arc::clone(self.clean()?);
        let low = Arc::clone(self.photograph_work(name)?.clean()?);
        let photo = &mut self.photographs[index];
        let facts = self.steps.timings.time(TimedStep::Measure, || photo.measure(&normal, &low));
        photo.facts = Some(facts);
        Ok(facts)
    }

    /// The steps of a photograph of the frame. They have no noise, because a photograph is not degraded.
    fn photograph_work(&mut self, name: &PhotoName) -> Result<&mut Self> {
        let planned = self.photographs[self.photograph_index(name)?].digest;
        let (steps, of, source) = (self.steps, &self.frame, &self.source);
        Ok(self.photograph_works.entry(name.clone()).or_insert_with(|| {
            let label = FrameId(format!("{of} ({name})"));
            Box::new(Self {
                photograph: Some((of.clone(), name.clone())),
                ..Self::new(steps, label, source.clone(), Some(planned))
            })
        }))
    }

    fn photograph_index(&self, name: &PhotoName) -> Result<usize> {
        self.photographs
            .iter()
            .position(|photo| photo.name == *name)
            .ok_or_else(|| Error::data(&self.frame, format_args!("no photograph {name} of this frame")))
    }
}

/// The same condition with another treatment.
fn with_treatment(condition: &Condition, treatment: Treatment) -> Condition {
    Condition { treatment, ..condition.clone() }
}

/// Adds the facts about a pair to an image of it.
fn with_pair_facts(payload: Arc<Payload>, pair: Option<PairFacts>) -> Arc<Payload> {
    match pair {
        None => payload,
        pair => Arc::new(Arc::unwrap_or_clone(payload).with_pair(pair)),
    }
}

/// An image as it is sent, with facts about it.
pub struct PreparedImage<'a> {
    pub payload: Arc<Payload>,
    pub pixels: PixelsSent,
    /// Similarity to the clean frame; `None` if it was not wanted.
    pub similarity: Option<Similarity>,
    /// Place in the store; `None` if the image is not stored.
    pub place: Option<StoredPlace<'a>>,
}

/// Where the pixels of a sent image are.
pub enum PixelsSent {
    /// In memory, because they were just encoded.
    Encoded(Arc<Rgb>),
    /// In the file of the frame, which is sent unchanged.
    InFrameFile,
    /// In the image store, not decoded.
    Stored,
}

/// An image that is ready, or that its enhancer must still process.
pub enum StagedImage<'a> {
    Ready(PreparedImage<'a>),
    /// An enhanced image from the store. Its notes must still be added to the usage of its enhancer.
    Stored {
        image: PreparedImage<'a>,
        enhancer: EnhancerName,
        notes: StoredNotes,
    },
    ToEnhance {
        degraded: Arc<Rgb>,
        enhancer: EnhancerName,
        finish: ImageFinisher<'a>,
    },
}

/// The steps that turn the pixels of an image into a [`PreparedImage`]: encode, compare with the clean frame, store.
pub struct ImageFinisher<'a> {
    steps: ImageSteps<'a>,
    /// Changes that reading the frame made besides decoding it.
    note: InputNote,
    /// The camera's exposure; `None` for a kind that leaves it open.
    exposure: Option<ExposureFacts>,
    /// How dark the photograph of the frame is; `None` if the condition has no pair.
    pair: Option<PairFacts>,
    place: Option<StoredPlace<'a>>,
    /// The clean frame in the size sent; `None` if the image is not compared with it.
    clean: Option<Arc<Rgb>>,
    /// Similarity from the store.
    known: Option<Similarity>,
    /// Time spent on the pixels so far.
    pub took: Duration,
}

impl<'a> FrameWork<'a> {
    /// Prepares the frame in a condition: as it is sent, or as input of its enhancer. Uses the store if it has
    /// everything needed.
    ///
    /// # Errors
    /// If the frame cannot be read, or cannot be shown in the condition.
    pub fn stage(&mut self, condition: &Condition, needed: Needed) -> Result<StagedImage<'a>> {
        let Resolved { work, condition, pair } = self.resolve(condition)?;
        let steps = work.steps;
        let place = work.stored_place(&condition)?;
        if let Some(payload) = work.unchanged_file(&condition)? {
            return Ok(StagedImage::Ready(PreparedImage {
                payload: with_pair_facts(payload, pair),
                pixels: PixelsSent::InFrameFile,
                similarity: None,
                place,
            }));
        }
        let (note, exposure) = (work.note()?, work.exposure(&condition)?);
        if let Some(stored) = place.as_ref().and_then(|place| steps.stored_image(place, needed)) {
            let payload = steps.stored_payload(stored.payload, &note, exposure)?;
            let image = PreparedImage {
                payload: with_pair_facts(payload, pair),
                pixels: PixelsSent::Stored,
                similarity: stored.notes.similarity,
                place,
            };
            return Ok(match condition.enhancer {
                None => StagedImage::Ready(image),
                Some(enhancer) => StagedImage::Stored { image, enhancer, notes: stored.notes },
            });
        }
        let started = Instant::now();
        let is_compared = needed == Needed::Similarity;
        let known = place.as_ref().filter(|_| is_compared).and_then(|place| steps.stored_similarity(place));
        let clean = (is_compared && known.is_none()).then(|| work.clean_as_sent());
        let finish = ImageFinisher {
            steps,
            note,
            exposure,
            pair,
            place,
            clean: clean.transpose()?,
            known,
            took: Duration::ZERO,
        };
        let degraded = Arc::clone(work.degraded(condition.degradation())?);
        let finish = ImageFinisher { took: started.elapsed(), ..finish };
        match condition.enhancer {
            None => finish.image(&degraded, None).map(StagedImage::Ready),
            Some(enhancer) => Ok(StagedImage::ToEnhance { degraded, enhancer, finish }),
        }
    }
}

impl<'a> ImageFinisher<'a> {
    /// Encodes pixels and stores the image. `enhanced` is what the image adds to the usage of its enhancer.
    ///
    /// # Errors
    /// If it cannot be encoded, or is larger than the endpoint accepts.
    pub fn image(self, pixels: &Arc<Rgb>, enhanced: Option<ImageUse>) -> Result<PreparedImage<'a>> {
        let started = Instant::now();
        let (payload, encoded) = self.steps.payload(pixels, &self.note, self.exposure)?;
        let measuring = Instant::now();
        let measured =
            self.clean.map(|clean| self.steps.timings.time(TimedStep::Measure, || similarity(&encoded, &clean)));
        let similarity = self.known.or(measured.transpose()?);
        if let Some(place) = self.place.as_ref().filter(|_| self.known.is_none()) {
            let notes = StoredNotes { enhanced, similarity };
            let took = if place.keeps_image() { self.took + started.elapsed() } else { measuring.elapsed() };
            self.steps.store(place, &payload, &notes, took);
        }
        Ok(PreparedImage {
            payload: with_pair_facts(payload, self.pair),
            pixels: PixelsSent::Encoded(encoded),
            similarity,
            place: self.place,
        })
    }
}
