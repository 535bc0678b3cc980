//! The notes about an image for the report, made with the image: [`ImagePipeline::image_and_notes`].

use std::sync::Arc;
use std::time::Instant;

use super::{ImagePipeline, or_warning};
use crate::error::Result;
use crate::images::frame_work::FrameWork;
use crate::images::frame_work::staged::{MadeImage, PixelsSent};
use crate::images::notes::thumbnail::{ShownObjects, thumbnail};
use crate::images::notes::{ImageNotes, WantedNotes, fidelity};
use crate::images::stored::{Needed, ThumbnailPlace};
use crate::images::timings::TimedStep;
use crate::picture::Payload;
use crate::types::{Condition, FrameId, Rgb, Thumbnail};

impl ImagePipeline<'_> {
    /// A frame in a condition as it is sent, with the notes that are wanted.
    pub(super) fn image_and_notes(
        &mut self,
        work: &mut FrameWork<'_>,
        condition: &Condition,
        (name, shown): (&FrameId, Option<ShownObjects<'_>>),
        wanted: WantedNotes,
    ) -> Result<(Arc<Payload>, ImageNotes)> {
        let needed = if wanted.fidelity {
            Needed::Similarity
        } else {
            Needed::Image
        };
        let image = self.image(work, condition, needed)?;
        let similarity = image.similarity.filter(|_| wanted.fidelity);
        let thumbnail = if wanted.thumbnail {
            small_copy(work, condition, (name, shown), &image)?
        } else {
            None
        };
        let notes = ImageNotes {
            thumbnail,
            fidelity: similarity.map(|found| fidelity(name, condition, &image.payload, found)),
        };
        Ok((image.payload, notes))
    }
}

/// The small copy of an image, from the store if it is there; `None` with a warning if it cannot be made.
///
/// # Errors
/// If the frame cannot be decoded.
fn small_copy(
    work: &mut FrameWork<'_>,
    condition: &Condition,
    (name, shown): (&FrameId, Option<ShownObjects<'_>>),
    image: &MadeImage<'_>,
) -> Result<Option<Thumbnail>> {
    let timings = work.steps.timings;
    let payload = &image.payload;
    // The darkness of a photograph is in no key of the store.
    let place = image.place.as_ref();
    let place = place.filter(|_| payload.facts().pair.is_none());
    let place = place.and_then(|place| place.thumbnail((name, condition), shown));
    let read = |place: &ThumbnailPlace<'_>| place.read(payload.facts().digest);
    let stored = place
        .as_ref()
        .and_then(|place| timings.time(TimedStep::Decode, || read(place)));
    if stored.is_some() {
        return Ok(stored);
    }
    let started = Instant::now();
    let encoded: Option<Arc<Rgb>> = match &image.pixels {
        PixelsSent::Encoded(pixels) => Some(Arc::clone(pixels)),
        PixelsSent::OfFile => Some(Arc::clone(work.resolved(condition)?.work.clean()?)),
        PixelsSent::Stored => None,
    };
    let make = || thumbnail(name, condition, payload, encoded.as_deref(), shown);
    let made = or_warning(name, condition, timings.time(TimedStep::Encode, make));
    if let (Some(place), Some(made)) = (place, &made) {
        place.write(made, started.elapsed().as_millis() as u64);
    }
    Ok(made)
}
