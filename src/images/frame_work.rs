//! The steps from one frame to its images: [`FrameWork`].

pub(crate) mod pairs;
pub(crate) mod staged;

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::dataset::Picture;
use crate::error::{Error, Result};
use crate::images::frames::{DegradeStage, Source, SourceFrame, SourcePhotograph};
use crate::images::image_steps::ImageSteps;
use crate::images::recipes::Recipe;
use crate::images::stored::StoredPlace;
use crate::images::timings::TimedStep;
use crate::picture::Scaling;
use crate::picture::bilinear;
use crate::picture::{Payload, PayloadFormat};
use crate::types::{
    Condition, Degradation, Digest, ExposureFacts, FrameId, InputNote, PhotoName, Pixels, Rgb,
};
use darkqa_light::{AppliedDegradation, Exposures, FrameView, NoiseKey};

/// Cached steps of one frame. Each is computed once, when it is first needed.
pub(crate) struct FrameWork<'a> {
    pub(crate) steps: ImageSteps<'a>,
    frame: FrameId,
    key: NoiseKey,
    /// Digest of the file when the plan was made; `None` if any file is accepted.
    planned: Option<Digest>,
    /// Name of the source, and the frame, for the store; `None` without a store or a plan.
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
    /// Work on these photographs, by name.
    dark: BTreeMap<PhotoName, Box<Self>>,
    /// The frame and the photograph of it that this is work on; `None` for work on the frame itself.
    photograph: Option<(FrameId, PhotoName)>,
}

impl<'a> FrameWork<'a> {
    /// Work on a frame of a planned source. Its file is read when it is needed, and must still have the same digest.
    pub(crate) fn planned(steps: ImageSteps<'a>, source: &Source, frame: &SourceFrame) -> Self {
        let key = steps.recipe.noise(&source.name, &frame.id);
        let origin = || Box::new((source.name.clone(), frame.clone()));
        Self {
            origin: steps.stored.map(|_| origin()),
            size: Some(frame.size),
            photographs: frame.photographs.clone(),
            ..Self::new(steps, frame.id.clone(), key, Some(frame.digest))
        }
    }

    /// Work on a frame alone, without a check of its digest.
    pub(crate) fn alone(steps: ImageSteps<'a>, frame: FrameId) -> Self {
        let key = NoiseKey::new(steps.recipe.seed, &frame);
        Self::new(steps, frame, key, None)
    }

    fn new(steps: ImageSteps<'a>, frame: FrameId, key: NoiseKey, planned: Option<Digest>) -> Self {
        Self {
            steps,
            frame,
            key,
            planned,
            origin: None,
            size: None,
            picture: None,
            pixels: None,
            clean: None,
            clean_as_sent: None,
            exposures: Exposures::default(),
            degraded: None,
            photographs: Vec::new(),
            dark: BTreeMap::new(),
            photograph: None,
        }
    }

    /// Width and height of the file, in pixels; `None` before it is read, if it was not planned.
    pub(crate) fn size(&self) -> Option<[u32; 2]> {
        self.size.map(|(width, height)| [width, height])
    }

    /// The name of the frame.
    pub(crate) fn frame(&self) -> &FrameId {
        &self.frame
    }

    /// The place of the frame in a condition in the store; `None` without a store, and for photographs in the dark.
    ///
    /// # Errors
    /// If the condition cannot be made of this frame.
    pub(crate) fn stored_place(&self, condition: &Condition) -> Result<Option<StoredPlace<'a>>> {
        let (Some(stored), Some(origin)) = (self.steps.stored, &self.origin) else {
            return Ok(None);
        };
        let (source, frame) = &**origin;
        let place = stored.place(self.steps.recipe, (source, frame), condition)?;
        Ok(Some(place))
    }

    /// How the file of the frame is read.
    pub(crate) fn note(&mut self) -> Result<InputNote> {
        self.picture().map(Picture::note)
    }

    /// The file itself, if it is a plain PNG that can be sent as it is; else `None`.
    pub(crate) fn unchanged_file(&mut self, condition: &Condition) -> Result<Option<Arc<Payload>>> {
        let Recipe {
            format, scaling, ..
        } = *self.steps.recipe;
        if *condition != Condition::L0
            || format != PayloadFormat::Png
            || matches!(scaling, Scaling::LongerSide(_))
        {
            return Ok(None);
        }
        let Picture::Encoded(file) = self.picture()? else {
            return Ok(None);
        };
        let payload = Payload::from_plain_png(file.bytes());
        payload
            .filter(|payload| {
                let (width, height) = payload.size();
                scaling.size((width as u32, height as u32)) == payload.size()
            })
            .map(|payload| self.steps.checked(payload))
            .transpose()
    }

    /// The frame's file; an error if its digest is not that of the plan.
    pub(crate) fn picture(&mut self) -> Result<&Picture> {
        let (steps, frame, planned) = (self.steps, &self.frame, self.planned);
        let photograph = self.photograph.as_ref();
        once(&mut self.picture, || {
            let read = || match photograph {
                None => steps.frames.picture(frame),
                Some((of, name)) => steps.frames.photograph(of, name),
            };
            let picture = steps.timings.time(TimedStep::Decode, read)?;
            if planned.is_none_or(|planned| planned == picture.digest()) {
                return Ok(picture);
            }
            let problem = "the image was changed during the run; restore it, or begin a new run";
            Err(Error::data(frame, problem))
        })
    }

    /// The pixels of the clean frame in the depth of its file: in its own size, or scaled if its light is reduced after scaling.
    ///
    /// # Errors
    /// If the file is broken, or a frame of more than 8 bits is to be scaled before its light is reduced.
    pub(crate) fn pixels(&mut self) -> Result<&Pixels> {
        if self.pixels.is_none() {
            let ImageSteps {
                recipe, timings, ..
            } = self.steps;
            let picture = self.picture()?;
            let pixels = timings.time(TimedStep::Decode, || picture.pixels())?;
            let pixels = match (recipe.degraded_at, recipe.scaling) {
                (DegradeStage::Resized, Scaling::LongerSide(side)) => {
                    resized(pixels, side).map_err(|problem| Error::data(&self.frame, problem))?
                }
                _ => pixels,
            };
            self.pixels = Some(pixels);
        }
        once(&mut self.pixels, || {
            Err(Error::data(&self.frame, "the frame was not read"))
        })
    }

    /// The clean frame as 8-bit codes, of the size of [`Self::pixels`].
    pub(crate) fn clean(&mut self) -> Result<&Arc<Rgb>> {
        if self.clean.is_none() {
            self.clean = Some(self.pixels()?.codes());
        }
        once(&mut self.clean, || {
            Err(Error::data(&self.frame, "the frame was not read"))
        })
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

    /// Applies a degradation to this frame.
    pub(crate) fn applied(&mut self, how: &Degradation) -> Result<AppliedDegradation> {
        let recipe = self.steps.recipe;
        let view = if how.kind().has_motion() {
            self.view()?
        } else {
            FrameView::default()
        };
        let applied = recipe.kinds.apply(how, view, &self.key);
        applied.map_err(|e| Error::data(format_args!("{} at {how}", self.frame), e))
    }

    /// The camera's exposure in a condition; `None` for a kind that leaves it open.
    pub(crate) fn exposure(&mut self, condition: &Condition) -> Result<Option<ExposureFacts>> {
        let how = condition.degradation();
        let how = how.filter(|how| how.kind().has_motion());
        let applied = how.map(|how| self.applied(how)).transpose()?;
        Ok(applied.and_then(|applied| applied.exposure()))
    }

    /// The clean frame as the camera saw it.
    fn view(&mut self) -> Result<FrameView> {
        let steps = self.steps;
        let size = match self.size {
            Some(size) => size,
            None => self.picture()?.check()?,
        };
        self.size = Some(size);
        Ok(steps.recipe.view(size, steps.frames.focal(&self.frame)))
    }

    /// Whether the file was decoded.
    #[cfg(test)]
    pub(crate) fn is_decoded(&self) -> bool {
        self.pixels.is_some()
    }

    /// The frame in one degradation, or clean. The last one is cached for the enhancers that follow.
    pub(crate) fn degraded(&mut self, how: Option<&Degradation>) -> Result<&Arc<Rgb>> {
        let Some(how) = how else {
            return self.clean();
        };
        let applied = self.applied(how)?;
        self.pixels()?;
        let Self {
            steps,
            frame,
            key,
            pixels,
            exposures,
            degraded,
            ..
        } = self;
        if degraded.as_ref().is_some_and(|(cached, _)| cached != how) {
            *degraded = None;
        }
        let (_, image) = once(degraded, || {
            let pixels = pixels.as_ref();
            let pixels = pixels.ok_or_else(|| Error::data(&*frame, "the frame was not read"))?;
            let degrade = || exposures.degrade(pixels.into(), &applied, key);
            let image = steps.timings.time(TimedStep::Degrade, degrade);
            Ok((how.clone(), Arc::new(image)))
        })?;
        Ok(image)
    }
}

/// A frame with this longer side.
fn resized(pixels: Pixels, side: usize) -> Result<Pixels, String> {
    if pixels.height().max(pixels.width()) == side {
        return Ok(pixels);
    }
    let Pixels::Codes8(codes) = &pixels else {
        let problem = "the frame has more than 8 bits, and --degrade resized scales frames of 8 bits; take --degrade native";
        return Err(problem.to_owned());
    };
    let resized = bilinear(codes, side).map_err(|e| e.to_string())?;
    Ok(Pixels::Codes8(Arc::new(resized)))
}

/// The value in a slot; computed first if the slot is empty.
fn once<T>(slot: &mut Option<T>, compute: impl FnOnce() -> Result<T>) -> Result<&T> {
    let value = match slot.take() {
        Some(value) => value,
        None => compute()?,
    };
    Ok(slot.insert(value))
}
