//! A frame in a condition with the notes about its image: made, or taken from the image store.

use std::sync::Arc;
use std::time::Instant;

use super::{ImagePipeline, or_warning};
use crate::error::Result;
use crate::job::frame_work::FrameWork;
use crate::job::frame_work::pairs::{Resolved, paired};
use crate::job::image_notes::{ImageNotes, WantedNotes, fidelity, similarity};
use crate::job::image_steps::ImageSteps;
use crate::job::stored_images::{MadeNotes, Needed, Similarity, StoredPlace};
use crate::job::stored_thumbnails::ThumbnailPlace;
use crate::job::thumbnail::{ShownObjects, thumbnail};
use crate::job::timings::TimedStep;
use crate::picture::Payload;
use crate::types::{Condition, EnhancerName, FrameId, PairFacts, Rgb};

/// What an image is called and shows, for the notes about it.
#[derive(Clone, Copy)]
struct NoteWriter<'n> {
    name: &'n FrameId,
    condition: &'n Condition,
    shown: Option<ShownObjects<'n>>,
    wanted: WantedNotes,
    /// How dark the photograph of the frame is; `None` without a darkness of pairs.
    pair: Option<PairFacts>,
}

impl NoteWriter<'_> {
    /// The place of the small copy in the store; `None` without a store, if none is wanted, and in the darkness of a pair.
    fn thumbnail_place<'a>(&self, place: Option<&StoredPlace<'a>>) -> Option<ThumbnailPlace<'a>> {
        let place = place.filter(|_| self.wanted.thumbnail && self.pair.is_none());
        place?.thumbnail((self.name, self.condition), self.shown)
    }

    /// The image as it is sent, with the notes that are wanted. `encoded` gives what was encoded, if it is known; it is needed only if the
    /// store has no small copy.
    fn noted<P: AsRef<Rgb>>(
        self,
        steps: ImageSteps<'_>,
        image: Arc<Payload>,
        (place, similarity): (Option<&StoredPlace<'_>>, Option<Similarity>),
        encoded: impl FnOnce() -> Result<Option<P>>,
    ) -> Result<(Arc<Payload>, ImageNotes)> {
        let image = paired(image, self.pair);
        let (name, condition) = (self.name, self.condition);
        let kept = self.thumbnail_place(place);
        let read = |place: &ThumbnailPlace<'_>| place.read(image.facts().digest);
        let known = kept.as_ref();
        let mut small =
            known.and_then(|place| steps.timings.time(TimedStep::Decode, || read(place)));
        if small.is_none() && self.wanted.thumbnail {
            let (started, encoded) = (Instant::now(), encoded()?);
            let encoded = encoded.as_ref().map(AsRef::as_ref);
            let make = || thumbnail(name, condition, &image, encoded, self.shown);
            let made = steps.timings.time(TimedStep::Encode, make);
            small = or_warning(name, condition, made);
            if let (Some(place), Some(made)) = (kept, &small) {
                place.write(made, started.elapsed().as_millis() as u64);
            }
        }
        let similarity = similarity.filter(|_| self.wanted.fidelity);
        let fidelity = similarity.map(|found| fidelity(name, condition, &image, found));
        let notes = ImageNotes {
            thumbnail: small,
            fidelity,
        };
        Ok((image, notes))
    }
}

impl ImagePipeline<'_> {
    /// A frame in a condition as it is sent, with the notes that are wanted.
    pub(super) fn image_and_notes(
        &mut self,
        work: &mut FrameWork<'_>,
        condition: &Condition,
        (name, shown): (&FrameId, Option<ShownObjects<'_>>),
        wanted: WantedNotes,
    ) -> Result<(Arc<Payload>, ImageNotes)> {
        let Resolved {
            work,
            condition: made,
            pair,
        } = work.resolved(condition)?;
        let steps = work.steps;
        let writer = NoteWriter {
            name,
            condition,
            shown,
            wanted,
            pair,
        };
        let place = work.stored_place(&made)?;
        if let Some(image) = work.unchanged_file(&made)? {
            // The file is decoded only for its thumbnail.
            let clean = || work.clean().cloned().map(Some);
            return writer.noted(steps, image, (place.as_ref(), None), clean);
        }
        let needed = if wanted.fidelity {
            Needed::Similarity
        } else {
            Needed::Image
        };
        let found = place
            .as_ref()
            .and_then(|place| steps.stored_image(place, needed));
        let Some(stored) = found else {
            return self.made_and_noted(work, &made, place.as_ref(), writer);
        };
        let (read, exposure) = (work.note()?, work.exposure(&made)?);
        if let Some(enhancer) = &made.enhancer {
            self.note_stored(&stored.notes, enhancer, [work.frame(), &made])?;
        }
        let image = steps.stored_payload(stored.payload, &read, exposure)?;
        let known = (place.as_ref(), stored.notes.similarity);
        writer.noted(steps, image, known, || Ok(None::<Arc<Rgb>>))
    }

    /// The same, made now, and kept at its place in the store.
    fn made_and_noted(
        &mut self,
        work: &mut FrameWork<'_>,
        made: &Condition,
        place: Option<&StoredPlace<'_>>,
        writer: NoteWriter<'_>,
    ) -> Result<(Arc<Payload>, ImageNotes)> {
        let (steps, read, exposure) = (work.steps, work.note()?, work.exposure(made)?);
        let started = Instant::now();
        let is_wanted = writer.wanted.fidelity;
        let measured = place.filter(|_| is_wanted);
        let measured = measured.and_then(|place| steps.stored_measures(place));
        let is_missing = is_wanted && measured.is_none();
        let clean = is_missing.then(|| work.clean_as_sent()).transpose()?;
        let (pixels, enhanced) = self.pixels_noted(work, made)?;
        let (image, encoded) = steps.payload(&pixels, &read, exposure)?;
        let measuring = Instant::now();
        let measure = |clean: Arc<Rgb>| {
            let measure = || similarity([&*encoded, &*clean]);
            steps.timings.time(TimedStep::Measure, measure)
        };
        let similarity = match measured {
            Some(known) => Some(known),
            None => clean.map(measure).transpose()?,
        };
        if let Some(place) = place.filter(|_| measured.is_none()) {
            let notes = MadeNotes {
                enhanced,
                similarity,
            };
            let since = if place.keeps_image() {
                started
            } else {
                measuring
            };
            steps.store(place, &image, &notes, since.elapsed());
        }
        writer.noted(steps, image, (place, similarity), || Ok(Some(&encoded)))
    }

    /// Notes an image of the store as its enhancer would.
    pub(super) fn note_stored(
        &mut self,
        notes: &MadeNotes,
        name: &EnhancerName,
        place: [&dyn ToString; 2],
    ) -> Result<()> {
        let implausible = self.implausible;
        let Some(used) = &notes.enhanced else {
            return Ok(());
        };
        match self.resting(name) {
            Some(resting) => used.note_in(resting.usage(), resting.path(), place, implausible),
            None => self.enhancer(name)?.note_stored(used, place, implausible),
        }
    }
}
