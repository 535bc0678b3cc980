//! Files, settings and timings that all images share: [`ImageSteps`].

use std::borrow::Cow;
use std::sync::Arc;
use std::time::Duration;

use crate::ask::ImageLimit;
use crate::error::Result;
use crate::images::frames::Frames;
use crate::images::recipes::Recipe;
use crate::images::stored::{
    MadeNotes, Needed, Similarity, StoredImage, StoredImages, StoredPlace,
};
use crate::images::timings::{TimedStep, Timings};
use crate::picture::Payload;
use crate::types::{ExposureFacts, InputNote, Rgb};

/// Files, settings and timings that all images share.
#[derive(Clone, Copy)]
pub(crate) struct ImageSteps<'a> {
    pub(crate) frames: &'a dyn Frames,
    pub(crate) recipe: &'a Recipe,
    /// Largest image that the endpoint takes; `None` if all models are built in.
    pub(crate) limit: Option<ImageLimit>,
    pub(crate) timings: &'a Timings,
    /// The image store; `None` without one.
    pub(crate) stored: Option<StoredImages<'a>>,
}

impl ImageSteps<'_> {
    /// The same steps without the image store.
    pub(crate) fn without_store(self) -> Self {
        Self {
            stored: None,
            ..self
        }
    }

    /// The image of a place in the store, if it is there with all that is needed.
    pub(crate) fn stored_image(
        &self,
        place: &StoredPlace<'_>,
        needed: Needed,
    ) -> Option<StoredImage> {
        let read = || place.read(self.recipe, needed);
        self.timings.time(TimedStep::Decode, read)
    }

    /// How similar the image of a place is to its clean frame, if the store keeps that without the image.
    pub(crate) fn stored_measures(&self, place: &StoredPlace<'_>) -> Option<Similarity> {
        self.timings.time(TimedStep::Decode, || place.measures())
    }

    /// Adds an image that took this time to make to the store.
    pub(crate) fn store(
        &self,
        place: &StoredPlace<'_>,
        image: &Payload,
        notes: &MadeNotes,
        took: Duration,
    ) {
        let write = || place.write(image, notes, took);
        self.timings.time(TimedStep::Encode, write);
    }

    /// An image from the store as it is sent, with what the camera did. `note` states how the file of its frame was read.
    pub(crate) fn stored_payload(
        &self,
        payload: Payload,
        note: &InputNote,
        exposure: Option<ExposureFacts>,
    ) -> Result<Arc<Payload>> {
        let payload = payload.turned_by(note.orientation);
        self.checked(payload.exposed_by(exposure))
    }

    /// The image as it is sent, with what the camera did, and the pixels that were encoded. `note` states how the file of its frame was
    /// read.
    pub(crate) fn payload(
        &self,
        image: &Arc<Rgb>,
        note: &InputNote,
        exposure: Option<ExposureFacts>,
    ) -> Result<(Arc<Payload>, Arc<Rgb>)> {
        let (payload, encoded) = self.timings.time(TimedStep::Encode, || {
            let encoded = self.scaled(image)?;
            let payload = Payload::encode(&encoded, self.recipe.format)?;
            let payload = payload.turned_by(note.orientation);
            Ok((payload.exposed_by(exposure), encoded))
        })?;
        Ok((self.checked(payload)?, encoded))
    }

    /// The image in the size sent; shared, not copied, if that is its own.
    pub(crate) fn scaled(&self, image: &Arc<Rgb>) -> Result<Arc<Rgb>> {
        Ok(match self.recipe.scaling.scale(image)? {
            Cow::Borrowed(_) => Arc::clone(image),
            Cow::Owned(scaled) => Arc::new(scaled),
        })
    }

    pub(crate) fn checked(&self, payload: Payload) -> Result<Arc<Payload>> {
        if let Some(limit) = &self.limit {
            limit.check(payload.facts())?;
        }
        Ok(Arc::new(payload))
    }
}
