//! The notes about an image for the report, made with the image: [`ImagePipeline::image_and_notes`].

use std::sync::Arc;
use std::time::Instant;

use super::{ImagePipeline, ok_or_warn};
use crate::engine::images::frame_work::FrameWork;
use crate::engine::images::frame_work::staged::{PixelsSent, PreparedImage};
use crate::engine::images::notes::thumbnail::{ShownObjects, thumbnail};
use crate::engine::images::notes::{ImageNotes, WantedNotes, fidelity};
use crate::engine::images::stored::Needed;
use crate::engine::images::timings::TimedStep;
use crate::error::Result;
use crate::pictures::Payload;
use crate::types::{Condition, FrameId, Rgb, Thumbnail};

impl ImagePipeline<'_> {
    /// Makes the image of a frame in a condition as it is sent, with the wanted notes. `objects` are cropped for the
    /// thumbnail.
    pub(super) fn image_and_notes(
        &mut self,
        work: &mut FrameWork<'_>,
        condition: &Condition,
        name: &FrameId,
        objects: Option<ShownObjects<'_>>,
        wanted: WantedNotes,
    ) -> Result<(Arc<Payload>, ImageNotes)> {
        let needed = if wanted.fidelity { Needed::Similarity } else { Needed::Image };
        let image = self.image(work, condition, needed)?;
        let similarity = image.similarity.filter(|_| wanted.fidelity);
        let thumbnail =
            if wanted.thumbnail { stored_or_new_thumbnail(work, condition, name, objects, &image)? } else { None };
        let notes = ImageNotes {
            thumbnail,
            fidelity: similarity.map(|found| fidelity(name, condition, &image.payload, found)),
        };
        Ok((image.payload, notes))
    }
}

/// The thumbnail of an image, from the store if possible; `None` with a warning if it cannot be made.
///
/// # Errors
/// If the frame cannot be decoded.
fn stored_or_new_thumbnail(
    work: &mut FrameWork<'_>,
    condition: &Condition,
    name: &FrameId,
    objects: Option<ShownObjects<'_>>,
    image: &PreparedImage<'_>,
) -> Result<Option<Thumbnail>> {
    let timings = work.steps.timings;
    let payload = &image.payload;
    // A store key does not contain how dark a photograph is, and the gain of the crops depends on that.
    let place = image
        .place
        .as_ref()
        .filter(|_| payload.facts().pair.is_none())
        .and_then(|place| place.thumbnail(name, condition, objects));
    let stored =
        place.as_ref().and_then(|place| timings.time(TimedStep::Decode, || place.read(payload.facts().digest)));
    if stored.is_some() {
        return Ok(stored);
    }
    let started = Instant::now();
    let encoded: Option<Arc<Rgb>> = match &image.pixels {
        PixelsSent::Encoded(pixels) => Some(Arc::clone(pixels)),
        PixelsSent::InFrameFile => Some(Arc::clone(work.resolve(condition)?.work.clean()?)),
        PixelsSent::Stored => None,
    };
    let made = timings.time(TimedStep::Encode, || thumbnail(name, condition, payload, encoded.as_deref(), objects));
    let made = ok_or_warn(name, condition, made);
    if let (Some(place), Some(made)) = (place, &made) {
        place.write(made, started.elapsed().as_millis() as u64);
    }
    Ok(made)
}
