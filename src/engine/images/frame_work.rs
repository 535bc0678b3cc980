//! Cached steps from one frame to its images: [`FrameWork`].

pub(crate) mod pairs;
pub(crate) mod staged;

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::data::Picture;
use crate::engine::images::frames::{DegradeStage, Source, SourceFrame, SourcePhotograph};
use crate::engine::images::image_steps::ImageSteps;
use crate::engine::images::recipes::Recipe;
use crate::engine::images::stored::StoredPlace;
use crate::engine::images::timings::TimedStep;
use crate::error::{Error, Result};
use crate::pictures::Scaling;
use crate::pictures::bilinear;
use crate::pictures::{Payload, PayloadFormat};
use crate::types::{Condition, Degradation, Digest, ExposureFacts, FrameId, InputNote, PhotoName, Pixels, Rgb};
use darkqa_light::{AppliedDegradation, Exposures, FrameView, NoiseKey};

/// Cached steps of one frame (file, clean pixels, degraded image). Each is computed on first use.
pub(crate) struct FrameWork<'a> {
    pub(crate) steps: ImageSteps<'a>,
    frame: FrameId,
    key: NoiseKey,
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
    pub(crate) fn for_source(steps: ImageSteps<'a>, source: &Source, frame: &SourceFrame) -> Self {
        let key = steps.recipe.noise_key(&source.name, &frame.id);
        Self {
            origin: steps.stored.map(|_| Box::new((source.name.clone(), frame.clone()))),
            size: Some(frame.size),
            photographs: frame.photographs.clone(),
            ..Self::new(steps, frame.id.clone(), key, Some(frame.digest))
        }
    }

    /// The steps of a frame without a plan; the digest of its file is not checked.
    pub(crate) fn for_frame(steps: ImageSteps<'a>, frame: FrameId) -> Self {
        let key = NoiseKey::new(steps.recipe.seed, &frame);
        Self::new(steps, frame, key, None)
    }

    fn new(steps: ImageSteps<'a>, frame: FrameId, key: NoiseKey, planned_digest: Option<Digest>) -> Self {
        Self {
            steps,
            frame,
            key,
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
    pub(crate) fn size(&self) -> Option<[u32; 2]> {
        self.size.map(|(width, height)| [width, height])
    }

    /// The name of the frame.
    pub(crate) fn frame(&self) -> &FrameId {
        &self.frame
    }

    /// The place in the store of this frame in a condition; `None` without a store, and for photographs in the dark.
    ///
    /// # Errors
    /// If the frame cannot be shown in the condition.
    pub(crate) fn stored_place(&self, condition: &Condition) -> Result<Option<StoredPlace<'a>>> {
        let (Some(stored), Some(origin)) = (self.steps.stored, &self.origin) else {
            return Ok(None);
        };
        let (source, frame) = &**origin;
        let place = stored.place(self.steps.recipe, source, frame, condition)?;
        Ok(Some(place))
    }

    /// Changes that reading the file makes besides decoding it.
    pub(crate) fn note(&mut self) -> Result<InputNote> {
        self.picture().map(Picture::note)
    }

    /// The file of the frame, if it is a plain PNG that can be sent unchanged; else `None`.
    pub(crate) fn unchanged_file(&mut self, condition: &Condition) -> Result<Option<Arc<Payload>>> {
        let Recipe { format, scaling, .. } = *self.steps.recipe;
        if *condition != Condition::L0 || format != PayloadFormat::Png || matches!(scaling, Scaling::LongerSide(_)) {
            return Ok(None);
        }
        let Picture::Encoded(file) = self.picture()? else {
            return Ok(None);
        };
        Payload::from_plain_png(file.bytes())
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
    pub(crate) fn picture(&mut self) -> Result<&Picture> {
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
    pub(crate) fn pixels(&mut self) -> Result<&Pixels> {
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
    pub(crate) fn clean(&mut self) -> Result<&Arc<Rgb>> {
        if self.clean.is_none() {
            self.clean = Some(self.pixels()?.codes());
        }
        get_or_try_insert(&mut self.clean, || Err(Error::data(&self.frame, "the frame was not read")))
    }

    /// The clean frame in the size sent.
    pub(crate) fn clean_as_sent(&mut self) -> Result<Arc<Rgb>> {
        if let Some(clean) = &self.clean_as_sent {
            return Ok(Arc::clone(clean));
        }
        let steps = self.steps;
        let scaled = steps.scaled(self.clean()?)?;
        Ok(Arc::clone(self.clean_as_sent.insert(scaled)))
    }

    /// The parameters of a degradation for this frame.
    pub(crate) fn apply(&mut self, how: &Degradation) -> Result<AppliedDegradation> {
        let recipe = self.steps.recipe;
        let view = if how.kind().has_motion() { self.view()? } else { FrameView::default() };
        recipe.kinds.apply(how, view, &self.key).map_err(|e| Error::data(format_args!("{} at {how}", self.frame), e))
    }

    /// The camera's exposure in a condition; `None` for a kind that leaves it open.
    pub(crate) fn exposure(&mut self, condition: &Condition) -> Result<Option<ExposureFacts>> {
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
    pub(crate) fn degraded(&mut self, how: Option<&Degradation>) -> Result<&Arc<Rgb>> {
        let Some(how) = how else {
            return self.clean();
        };
        let applied = self.apply(how)?;
        self.pixels()?;
        let Self { steps, frame, key, pixels, exposures, degraded, .. } = self;
        if degraded.as_ref().is_some_and(|(cached, _)| cached != how) {
            *degraded = None;
        }
        let (_, image) = get_or_try_insert(degraded, || {
            let pixels = pixels.as_ref().ok_or_else(|| Error::data(&*frame, "the frame was not read"))?;
            let image = steps.timings.time(TimedStep::Degrade, || exposures.degrade(pixels.into(), &applied, key));
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
