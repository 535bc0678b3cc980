//! The darkroom: one thread that makes the images, in the order of the plan.
//!
//! Each is loaded, darkened, mended and encoded once for all the questions about it. The channel is bounded: that is the
//! memory limit.

use std::sync::Arc;

use tokio::sync::mpsc::Sender;

use super::plan::{FramePlan, Shot, Trial};
use super::recipe::Recipe;
use crate::ask::{Format, Payload};
use crate::dataset::{Dataset, Picture};
use crate::enhance::Enhancer;
use crate::error::{Error, Result};
use crate::synthesis::{Negative, NoiseKey, expose};
use crate::types::{Condition, Degradation, FrameId, Rgb};

/// A shot with its image, or with what went wrong while it was made.
#[derive(Debug)]
pub(super) struct Exposed {
    pub(super) condition: Option<Condition>,
    pub(super) trials: Vec<Trial>,
    pub(super) image: Result<Option<Arc<Payload>>>,
}

/// What the thread works with.
pub(super) struct Darkroom<'a> {
    pub(super) dataset: &'a Dataset,
    pub(super) recipe: &'a Recipe,
    pub(super) enhancers: Vec<Enhancer>,
}

impl Darkroom<'_> {
    /// Makes the images of all frames until they are done or nobody waits for them any more.
    pub(super) fn develop(mut self, frames: Vec<FramePlan>, out: &Sender<Exposed>) {
        for FramePlan { frame, shots } in frames {
            let mut desk = Desk::new(frame);
            for Shot { condition, trials } in shots {
                let image = condition
                    .as_ref()
                    .map(|condition| self.image(&mut desk, condition))
                    .transpose();
                if out
                    .blocking_send(Exposed {
                        condition,
                        trials,
                        image,
                    })
                    .is_err()
                {
                    return;
                }
            }
        }
    }

    fn image(&mut self, desk: &mut Desk, condition: &Condition) -> Result<Arc<Payload>> {
        let Recipe {
            format, max_side, ..
        } = *self.recipe;
        if *condition == Condition::raw(Degradation::None) && format == Format::Png {
            // The file itself, where it is the very image that would be encoded.
            if let Picture::Encoded { bytes, .. } = desk.picture(self.dataset)?
                && let Some(payload) = Payload::of_plain_png(bytes, max_side)
            {
                return Ok(Arc::new(payload));
            }
        }
        let dark = desk.dark(self.dataset, self.recipe, condition.degradation)?;
        let payload = match &condition.enhancer {
            None => Payload::encode(dark, format, max_side),
            Some(name) => {
                let enhancer = self
                    .enhancers
                    .iter_mut()
                    .find(|enhancer| enhancer.name() == name);
                let enhancer =
                    enhancer.ok_or_else(|| Error::data(condition, "this enhancer is not open"))?;
                Payload::encode(&enhancer.enhance(dark)?, format, max_side)
            }
        };
        payload.map(Arc::new)
    }
}

/// What lies on the desk while one frame is worked on: each step is done when it is first needed, and once.
struct Desk {
    frame: FrameId,
    picture: Option<Picture>,
    clean: Option<Rgb>,
    negative: Option<Negative>,
    dark: Option<(Degradation, Rgb)>,
}

impl Desk {
    fn new(frame: FrameId) -> Self {
        Self {
            frame,
            picture: None,
            clean: None,
            negative: None,
            dark: None,
        }
    }

    fn picture(&mut self, dataset: &Dataset) -> Result<&Picture> {
        once(&mut self.picture, || dataset.picture(&self.frame))
    }

    /// The frame in one degradation; the last one is kept for the enhancers that follow.
    fn dark(
        &mut self,
        dataset: &Dataset,
        recipe: &Recipe,
        degradation: Degradation,
    ) -> Result<&Rgb> {
        if self.clean.is_none() {
            self.clean = Some(self.picture(dataset)?.decode()?);
        }
        let Self {
            frame,
            clean: Some(clean),
            negative,
            dark,
            ..
        } = self
        else {
            return Err(Error::data(&self.frame, "the frame was not decoded"));
        };
        if dark.as_ref().is_some_and(|(made, _)| *made != degradation) {
            *dark = None;
        }
        let (_, image) = once(dark, || {
            let image = match degradation {
                Degradation::None => clean.clone(),
                Degradation::Exposure(level) => expose(clean, level),
                Degradation::Sensor(level) => {
                    let key = NoiseKey::new(recipe.seed, frame);
                    once(negative, || Ok(Negative::new(clean, &key, &recipe.camera)))?
                        .develop(level)
                }
            };
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
