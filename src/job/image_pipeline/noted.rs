//! A frame in a condition with the notes about its image: made, or taken from the image store.

use std::sync::Arc;
use std::time::Instant;

use super::{ImagePipeline, or_warning};
use crate::ask::Payload;
use crate::error::Result;
use crate::job::frame_work::FrameWork;
use crate::job::frame_work::pairs::{Resolved, paired};
use crate::job::image_notes::{ImageNotes, WantedNotes, fidelity, similarity};
use crate::job::image_steps::ImageSteps;
use crate::job::stored_images::{MadeNotes, Needed, Similarity, StoredPlace};
use crate::job::thumbnail::{ShownObjects, thumbnail};
use crate::job::timings::TimedStep;
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
    /// The image as it is sent, with the notes that are wanted. `encoded` is what was encoded, if it is known.
    fn noted(
        self,
        steps: ImageSteps<'_>,
        image: Arc<Payload>,
        encoded: Option<&Rgb>,
        similarity: Option<Similarity>,
    ) -> (Arc<Payload>, ImageNotes) {
        let image = paired(image, self.pair);
        let (name, condition) = (self.name, self.condition);
        let small_copy = || {
            let made = thumbnail(name, condition, &image, encoded, self.shown);
            or_warning(name, condition, made)
        };
        let thumbnail = self
            .wanted
            .thumbnail
            .then(|| steps.timings.time(TimedStep::Encode, small_copy))
            .flatten();
        let similarity = similarity.filter(|_| self.wanted.fidelity);
        let fidelity = similarity.map(|found| fidelity(name, condition, &image, found));
        let notes = ImageNotes {
            thumbnail,
            fidelity,
        };
        (image, notes)
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
        if let Some(image) = work.unchanged_file(&made)? {
            // The file is decoded only for its thumbnail.
            let clean = wanted.thumbnail.then(|| work.clean()).transpose()?;
            return Ok(writer.noted(steps, image, clean.map(AsRef::as_ref), None));
        }
        let place = work.stored_place(&made)?;
        let needed = if wanted.fidelity {
            Needed::Similarity
        } else {
            Needed::Image
        };
        let found = place
            .as_ref()
            .and_then(|place| steps.stored_image(place, needed));
        let Some(stored) = found else {
            return self.made_and_noted(work, &made, place, writer);
        };
        let (read, exposure) = (work.note()?, work.exposure(&made)?);
        if let Some(enhancer) = &made.enhancer {
            self.note_stored(&stored.notes, enhancer, [work.frame(), &made])?;
        }
        let image = steps.stored_payload(stored.payload, &read, exposure)?;
        Ok(writer.noted(steps, image, None, stored.notes.similarity))
    }

    /// The same, made now, and kept at its place in the store.
    fn made_and_noted(
        &mut self,
        work: &mut FrameWork<'_>,
        made: &Condition,
        place: Option<StoredPlace<'_>>,
        writer: NoteWriter<'_>,
    ) -> Result<(Arc<Payload>, ImageNotes)> {
        let (steps, read, exposure) = (work.steps, work.note()?, work.exposure(made)?);
        let started = Instant::now();
        let is_wanted = writer.wanted.fidelity;
        let measured = place.as_ref().filter(|_| is_wanted);
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
            steps.store(&place, &image, &notes, since.elapsed())?;
        }
        Ok(writer.noted(steps, image, Some(&encoded), similarity))
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
