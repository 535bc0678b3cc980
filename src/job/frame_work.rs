//! The steps from one frame to its images: [`FrameWork`], with their shared settings [`ImageSteps`].

use std::borrow::Cow;
use std::sync::Arc;

use super::bilinear::bilinear;
use super::recipe::Recipe;
use super::scaling::Scaling;
use super::source::{Frames, Source, SourceFrame};
use super::timings::{TimedStep, Timings};
use super::walk::DegradedAt;
use crate::ask::{ImageLimit, Payload, PayloadFormat};
use crate::dataset::Picture;
use crate::error::{Error, Result};
use crate::synthesis::{Exposures, NoiseKey};
use crate::types::{Condition, Degradation, Digest, EnhancerName, FrameId, Rgb};

/// Files, settings and timings that all images share.
#[derive(Clone, Copy)]
pub(crate) struct ImageSteps<'a> {
    pub(crate) frames: &'a dyn Frames,
    pub(crate) recipe: &'a Recipe,
    /// Largest image that the endpoint takes; `None` if all models are built in.
    pub(crate) limit: Option<ImageLimit>,
    pub(crate) timings: &'a Timings,
}

impl ImageSteps<'_> {
    /// The image as it is sent, and the pixels that were encoded.
    pub(crate) fn payload<'p>(&self, image: &'p Rgb) -> Result<(Arc<Payload>, Cow<'p, Rgb>)> {
        let (payload, encoded) = self.timings.time(TimedStep::Encode, || {
            let encoded = self.scaled(image)?;
            let payload = Payload::encode(&encoded, self.recipe.format, None)?;
            Ok((payload, encoded))
        })?;
        Ok((self.checked(payload)?, encoded))
    }

    /// The image in the size sent.
    fn scaled<'p>(&self, image: &'p Rgb) -> Result<Cow<'p, Rgb>> {
        Ok(match self.recipe.scaling {
            Scaling::MaxSide(side) => Payload::scaled(image, Some(side))?,
            Scaling::LongerSide(side) if longer_side(image) != side => {
                Cow::Owned(bilinear(image, side)?)
            }
            Scaling::Never | Scaling::LongerSide(_) => Cow::Borrowed(image),
        })
    }

    fn checked(&self, payload: Payload) -> Result<Arc<Payload>> {
        if let Some(limit) = &self.limit {
            limit.check(payload.facts())?;
        }
        Ok(Arc::new(payload))
    }
}

fn longer_side(image: &Rgb) -> usize {
    image.height().max(image.width())
}

/// A frame in one condition, before enhancement.
pub(crate) enum StagedFrame {
    /// The image as it is sent.
    Ready(Arc<Payload>),
    /// The pixels to enhance, and the enhancer.
    ToEnhance(Rgb, EnhancerName),
}

/// Cached steps of one frame. Each is computed once, when it is first needed.
pub(crate) struct FrameWork<'a> {
    pub(crate) steps: ImageSteps<'a>,
    frame: FrameId,
    key: NoiseKey,
    /// Digest of the file when the plan was made; `None` if any file is accepted.
    planned: Option<Digest>,
    picture: Option<Picture>,
    clean: Option<Arc<Rgb>>,
    /// The clean frame in the size sent.
    clean_as_sent: Option<Arc<Rgb>>,
    exposures: Exposures,
    degraded: Option<(Option<Degradation>, Rgb)>,
}

impl<'a> FrameWork<'a> {
    /// Work on a frame of a planned source. Its file is read when it is needed, and must still have the same digest.
    pub(crate) fn planned(steps: ImageSteps<'a>, source: &Source, frame: &SourceFrame) -> Self {
        let key = steps.recipe.noise(source, &frame.id);
        Self::new(steps, frame.id.clone(), key, Some(frame.digest))
    }

    /// Work on a frame alone, without a check of its digest.
    pub(crate) fn of(steps: ImageSteps<'a>, frame: FrameId) -> Self {
        let key = NoiseKey::new(steps.recipe.seed, &frame);
        Self::new(steps, frame, key, None)
    }

    fn new(steps: ImageSteps<'a>, frame: FrameId, key: NoiseKey, planned: Option<Digest>) -> Self {
        Self {
            steps,
            frame,
            key,
            planned,
            picture: None,
            clean: None,
            clean_as_sent: None,
            exposures: Exposures::default(),
            degraded: None,
        }
    }

    /// The name of the frame.
    pub(crate) fn frame(&self) -> &FrameId {
        &self.frame
    }

    /// The frame in a condition: as it is sent, or as the enhancer takes it.
    pub(crate) fn stage(&mut self, condition: &Condition) -> Result<StagedFrame> {
        if let Some(payload) = self.unchanged_file(condition)? {
            return Ok(StagedFrame::Ready(payload));
        }
        let steps = self.steps;
        let degraded = self.degraded(condition.degradation.as_ref())?;
        match &condition.enhancer {
            None => Ok(StagedFrame::Ready(steps.payload(degraded)?.0)),
            Some(name) => Ok(StagedFrame::ToEnhance(degraded.clone(), name.clone())),
        }
    }

    /// The file itself, if it is a plain PNG that can be sent as it is; else `None`.
    pub(crate) fn unchanged_file(&mut self, condition: &Condition) -> Result<Option<Arc<Payload>>> {
        let Recipe {
            format, scaling, ..
        } = *self.steps.recipe;
        let side = match scaling {
            Scaling::Never => None,
            Scaling::MaxSide(side) => Some(side),
            Scaling::LongerSide(_) => return Ok(None),
        };
        if *condition != Condition::L0 || format != PayloadFormat::Png {
            return Ok(None);
        }
        let Picture::Encoded { bytes, .. } = self.picture()? else {
            return Ok(None);
        };
        let payload = Payload::of_plain_png(bytes, side);
        payload
            .map(|payload| self.steps.checked(payload))
            .transpose()
    }

    /// The frame's file; an error if its digest is not that of the plan.
    pub(crate) fn picture(&mut self) -> Result<&Picture> {
        let (steps, frame, planned) = (self.steps, &self.frame, self.planned);
        once(&mut self.picture, || {
            let read = || steps.frames.picture(frame);
            let picture = steps.timings.time(TimedStep::Decode, read)?;
            if planned.is_none_or(|planned| planned == picture.digest()) {
                return Ok(picture);
            }
            let problem = "the image was changed while the run was under way; put it back, or begin a new run";
            Err(Error::data(frame, problem))
        })
    }

    /// The clean frame: in its own size, or scaled if its light is reduced after scaling.
    pub(crate) fn clean(&mut self) -> Result<&Arc<Rgb>> {
        if self.clean.is_none() {
            let ImageSteps {
                recipe, timings, ..
            } = self.steps;
            let picture = self.picture()?;
            let clean = timings.time(TimedStep::Decode, || picture.decode())?;
            let clean = match (recipe.degraded_at, recipe.scaling) {
                (DegradedAt::Resized, Scaling::LongerSide(side)) if longer_side(&clean) != side => {
                    bilinear(&clean, side)?
                }
                _ => clean,
            };
            self.clean = Some(Arc::new(clean));
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
        let clean = self.clean()?;
        let scaled = match steps.scaled(clean)? {
            Cow::Borrowed(_) => Arc::clone(clean),
            Cow::Owned(scaled) => Arc::new(scaled),
        };
        Ok(Arc::clone(self.clean_as_sent.insert(scaled)))
    }

    /// Whether the file was decoded.
    #[cfg(test)]
    pub(crate) fn is_decoded(&self) -> bool {
        self.clean.is_some()
    }

    /// The frame in one degradation. The last one is cached for the enhancers that follow.
    pub(crate) fn degraded(&mut self, how: Option<&Degradation>) -> Result<&Rgb> {
        self.clean()?;
        let Self {
            steps,
            frame,
            key,
            clean,
            exposures,
            degraded,
            ..
        } = self;
        let Some(clean) = clean else {
            return Err(Error::data(&*frame, "the frame was not read"));
        };
        if degraded
            .as_ref()
            .is_some_and(|(cached, _)| cached.as_ref() != how)
        {
            *degraded = None;
        }
        let (_, image) = once(degraded, || {
            let reading = steps.recipe.readings.of(how)?;
            let degrade = || exposures.degrade(clean, how, key, reading);
            Ok((
                how.cloned(),
                steps.timings.time(TimedStep::Degrade, degrade),
            ))
        })?;
        Ok(image)
    }
}

/// The value in a slot; computed first if the slot is empty.
fn once<T>(slot: &mut Option<T>, compute: impl FnOnce() -> Result<T>) -> Result<&T> {
    let value = match slot.take() {
        Some(value) => value,
        None => compute()?,
    };
    Ok(slot.insert(value))
}
