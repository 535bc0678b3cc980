//! Settings and steps that all images share: [`ImageSteps`].

use std::borrow::Cow;
use std::sync::Arc;
use std::time::Duration;

use crate::ask::ImageLimit;
use crate::engine::images::frames::Frames;
use crate::engine::images::recipes::Recipe;
use crate::engine::images::stored::{Needed, Similarity, StoredImage, StoredImages, StoredNotes, StoredPlace};
use crate::engine::images::timings::{TimedStep, Timings};
use crate::error::Result;
use crate::pictures::Payload;
use crate::types::{ExposureFacts, InputNote, Rgb};

/// Frame files, recipe, endpoint limit, timings and image store that all images share.
#[derive(Clone, Copy)]
pub(crate) struct ImageSteps<'a> {
    pub(crate) frames: &'a dyn Frames,
    pub(crate) recipe: &'a Recipe,
    /// Largest image that the endpoint accepts; `None` if all models are built in.
    pub(crate) limit: Option<ImageLimit>,
    pub(crate) timings: &'a Timings,
    /// The image store; `None` without one.
    pub(crate) stored: Option<StoredImages<'a>>,
}

impl ImageSteps<'_> {
    /// The same steps without the image store.
    pub(crate) fn without_store(self) -> Self {
        Self { stored: None, ..self }
    }

    /// Reads an image from the store; `None` if it or a needed fact is missing.
    pub(crate) fn stored_image(&self, place: &StoredPlace<'_>, needed: Needed) -> Option<StoredImage> {
        self.timings.time(TimedStep::Decode, || place.read(self.recipe, needed))
    }

    /// Similarity of an image to its clean frame, if the store has it without the image.
    pub(crate) fn stored_similarity(&self, place: &StoredPlace<'_>) -> Option<Similarity> {
        self.timings.time(TimedStep::Decode, || place.similarity())
    }

    /// Adds an image to the store. `took` is the time that it took to make.
    pub(crate) fn store(&self, place: &StoredPlace<'_>, image: &Payload, notes: &StoredNotes, took: Duration) {
        self.timings.time(TimedStep::Encode, || place.write(image, notes, took));
    }

    /// Adds the facts that the store does not keep to an image from it: how its frame was read (`note`), and the
    /// camera's exposure.
    pub(crate) fn stored_payload(
        &self,
        payload: Payload,
        note: &InputNote,
        exposure: Option<ExposureFacts>,
    ) -> Result<Arc<Payload>> {
        let payload = payload.with_orientation(note.orientation);
        self.check_size(payload.with_exposure(exposure))
    }

    /// Scales and encodes an image; returns the payload and the scaled pixels. `note` tells how its frame was read.
    pub(crate) fn payload(
        &self,
        image: &Arc<Rgb>,
        note: &InputNote,
        exposure: Option<ExposureFacts>,
    ) -> Result<(Arc<Payload>, Arc<Rgb>)> {
        let (payload, encoded) = self.timings.time(TimedStep::Encode, || {
            let encoded = self.scaled(image)?;
            let payload = Payload::encode(&encoded, self.recipe.format)?;
            let payload = payload.with_orientation(note.orientation);
            Ok((payload.with_exposure(exposure), encoded))
        })?;
        Ok((self.check_size(payload)?, encoded))
    }

    /// Scales an image to the size sent. An image that already has that size is shared, not copied.
    pub(crate) fn scaled(&self, image: &Arc<Rgb>) -> Result<Arc<Rgb>> {
        Ok(match self.recipe.scaling.scale(image)? {
            Cow::Borrowed(_) => Arc::clone(image),
            Cow::Owned(scaled) => Arc::new(scaled),
        })
    }

    /// # Errors
    /// If the image is larger than the endpoint accepts.
    pub(crate) fn check_size(&self, payload: Payload) -> Result<Arc<Payload>> {
        if let Some(limit) = &self.limit {
            limit.check(payload.facts())?;
        }
        Ok(Arc::new(payload))
    }
}
