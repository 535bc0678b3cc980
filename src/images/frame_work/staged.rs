//! One image of a frame: made as far as possible without an enhancer ([`StagedImage`]), and as it is sent ([`MadeImage`]).

use std::sync::Arc;
use std::time::{Duration, Instant};

use super::FrameWork;
use super::pairs::{Resolved, paired};
use crate::error::Result;
use crate::images::image_steps::ImageSteps;
use crate::images::notes::similarity;
use crate::images::stored::{MadeNotes, Needed, Similarity, StoredPlace};
use crate::images::timings::TimedStep;
use crate::picture::Payload;
use crate::types::{Condition, EnhancerName, ExposureFacts, InputNote, PairFacts, Rgb};
use darkqa_enhance::ImageUse;

/// An image as it is sent, with facts about it.
pub(crate) struct MadeImage<'a> {
    pub(crate) payload: Arc<Payload>,
    pub(crate) pixels: PixelsSent,
    /// Similarity to the clean frame; `None` if it was not wanted.
    pub(crate) similarity: Option<Similarity>,
    /// Place in the store; `None` if it is not kept there.
    pub(crate) place: Option<StoredPlace<'a>>,
}

/// The pixels of an image that is sent.
pub(crate) enum PixelsSent {
    /// Encoded now.
    Encoded(Arc<Rgb>),
    /// In the file of the frame, which is sent unchanged.
    OfFile,
    /// In a file of the image store, not decoded.
    Stored,
}

/// An image that is ready, or waits for its enhancer.
pub(crate) enum StagedImage<'a> {
    Ready(MadeImage<'a>),
    /// An image of an enhancer from the store, of which the enhancer is told.
    Stored {
        image: MadeImage<'a>,
        enhancer: EnhancerName,
        notes: MadeNotes,
    },
    ToEnhance {
        degraded: Arc<Rgb>,
        enhancer: EnhancerName,
        finish: Finish<'a>,
    },
}

/// The steps that turn the pixels of an image into a [`MadeImage`]: encode, compare with the clean frame, store.
pub(crate) struct Finish<'a> {
    steps: ImageSteps<'a>,
    /// How the file of the frame was read.
    note: InputNote,
    /// The camera's exposure; `None` for a kind that leaves it open.
    exposure: Option<ExposureFacts>,
    /// How dark the photograph of the frame is; `None` without a darkness of pairs.
    pair: Option<PairFacts>,
    place: Option<StoredPlace<'a>>,
    /// The clean frame in the size sent; `None` if the image is not compared with it.
    clean: Option<Arc<Rgb>>,
    /// Similarity from the store.
    known: Option<Similarity>,
    /// Time that the pixels took.
    pub(crate) took: Duration,
}

impl<'a> FrameWork<'a> {
    /// The frame in a condition: as it is sent, or as the enhancer takes it. Taken from the store if all that is needed is there.
    ///
    /// # Errors
    /// If the frame cannot be read, or the condition cannot be made of it.
    pub(crate) fn stage(
        &mut self,
        condition: &Condition,
        needed: Needed,
    ) -> Result<StagedImage<'a>> {
        let Resolved {
            work,
            condition,
            pair,
        } = self.resolved(condition)?;
        let steps = work.steps;
        let place = work.stored_place(&condition)?;
        if let Some(payload) = work.unchanged_file(&condition)? {
            return Ok(StagedImage::Ready(MadeImage {
                payload: paired(payload, pair),
                pixels: PixelsSent::OfFile,
                similarity: None,
                place,
            }));
        }
        let (note, exposure) = (work.note()?, work.exposure(&condition)?);
        let stored = place.as_ref();
        let stored = stored.and_then(|place| steps.stored_image(place, needed));
        if let Some(stored) = stored {
            let payload = steps.stored_payload(stored.payload, &note, exposure)?;
            let image = MadeImage {
                payload: paired(payload, pair),
                pixels: PixelsSent::Stored,
                similarity: stored.notes.similarity,
                place,
            };
            return Ok(match condition.enhancer {
                None => StagedImage::Ready(image),
                Some(enhancer) => StagedImage::Stored {
                    image,
                    enhancer,
                    notes: stored.notes,
                },
            });
        }
        let started = Instant::now();
        let is_compared = needed == Needed::Similarity;
        let known = place.as_ref().filter(|_| is_compared);
        let known = known.and_then(|place| steps.stored_measures(place));
        let clean = (is_compared && known.is_none()).then(|| work.clean_as_sent());
        let finish = Finish {
            steps,
            note,
            exposure,
            pair,
            place,
            clean: clean.transpose()?,
            known,
            took: Duration::ZERO,
        };
        let degraded = Arc::clone(work.degraded(condition.degradation())?);
        let finish = Finish {
            took: started.elapsed(),
            ..finish
        };
        match condition.enhancer {
            None => finish.image(&degraded, None).map(StagedImage::Ready),
            Some(enhancer) => Ok(StagedImage::ToEnhance {
                degraded,
                enhancer,
                finish,
            }),
        }
    }
}

impl<'a> Finish<'a> {
    /// The image of these pixels, which is also kept in the store. `enhanced` is what the note of its enhancer got from it.
    ///
    /// # Errors
    /// If it cannot be encoded, or is larger than the endpoint takes.
    pub(crate) fn image(
        self,
        pixels: &Arc<Rgb>,
        enhanced: Option<ImageUse>,
    ) -> Result<MadeImage<'a>> {
        let started = Instant::now();
        let (payload, encoded) = self.steps.payload(pixels, &self.note, self.exposure)?;
        let measuring = Instant::now();
        let measured = self.clean.map(|clean| {
            let measure = || similarity([&*encoded, &*clean]);
            self.steps.timings.time(TimedStep::Measure, measure)
        });
        let similarity = self.known.or(measured.transpose()?);
        if let Some(place) = self.place.as_ref().filter(|_| self.known.is_none()) {
            let notes = MadeNotes {
                enhanced,
                similarity,
            };
            let took = if place.keeps_image() {
                self.took + started.elapsed()
            } else {
                measuring.elapsed()
            };
            self.steps.store(place, &payload, &notes, took);
        }
        Ok(MadeImage {
            payload: paired(payload, self.pair),
            pixels: PixelsSent::Encoded(encoded),
            similarity,
            place: self.place,
        })
    }
}
