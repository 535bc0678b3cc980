//! One image of a frame before its enhancer ([`StagedImage`]) and as it is sent ([`PreparedImage`]).

use std::sync::Arc;
use std::time::{Duration, Instant};

use super::FrameWork;
use super::pairs::{Resolved, with_pair_facts};
use crate::engine::images::image_steps::ImageSteps;
use crate::engine::images::notes::similarity;
use crate::engine::images::stored::{Needed, Similarity, StoredNotes, StoredPlace};
use crate::engine::images::timings::TimedStep;
use crate::error::Result;
use crate::pictures::Payload;
use crate::types::{Condition, EnhancerName, ExposureFacts, InputNote, PairFacts, Rgb};
use darkqa_enhance::ImageUse;

/// An image as it is sent, with facts about it.
pub(crate) struct PreparedImage<'a> {
    pub(crate) payload: Arc<Payload>,
    pub(crate) pixels: PixelsSent,
    /// Similarity to the clean frame; `None` if it was not wanted.
    pub(crate) similarity: Option<Similarity>,
    /// Place in the store; `None` if the image is not stored.
    pub(crate) place: Option<StoredPlace<'a>>,
}

/// Where the pixels of a sent image are.
pub(crate) enum PixelsSent {
    /// In memory, because they were just encoded.
    Encoded(Arc<Rgb>),
    /// In the file of the frame, which is sent unchanged.
    InFrameFile,
    /// In the image store, not decoded.
    Stored,
}

/// An image that is ready, or that its enhancer must still process.
pub(crate) enum StagedImage<'a> {
    Ready(PreparedImage<'a>),
    /// An enhanced image from the store. Its notes must still be added to the usage of its enhancer.
    Stored {
        image: PreparedImage<'a>,
        enhancer: EnhancerName,
        notes: StoredNotes,
    },
    ToEnhance {
        degraded: Arc<Rgb>,
        enhancer: EnhancerName,
        finish: ImageFinisher<'a>,
    },
}

/// The steps that turn the pixels of an image into a [`PreparedImage`]: encode, compare with the clean frame, store.
pub(crate) struct ImageFinisher<'a> {
    steps: ImageSteps<'a>,
    /// Changes that reading the frame made besides decoding it.
    note: InputNote,
    /// The camera's exposure; `None` for a kind that leaves it open.
    exposure: Option<ExposureFacts>,
    /// How dark the photograph of the frame is; `None` if the condition has no pair.
    pair: Option<PairFacts>,
    place: Option<StoredPlace<'a>>,
    /// The clean frame in the size sent; `None` if the image is not compared with it.
    clean: Option<Arc<Rgb>>,
    /// Similarity from the store.
    known: Option<Similarity>,
    /// Time spent on the pixels so far.
    pub(crate) took: Duration,
}

impl<'a> FrameWork<'a> {
    /// Prepares the frame in a condition: as it is sent, or as input of its enhancer. Uses the store if it has
    /// everything needed.
    ///
    /// # Errors
    /// If the frame cannot be read, or cannot be shown in the condition.
    pub(crate) fn stage(&mut self, condition: &Condition, needed: Needed) -> Result<StagedImage<'a>> {
        let Resolved { work, condition, pair } = self.resolve(condition)?;
        let steps = work.steps;
        let place = work.stored_place(&condition)?;
        if let Some(payload) = work.unchanged_file(&condition)? {
            return Ok(StagedImage::Ready(PreparedImage {
                payload: with_pair_facts(payload, pair),
                pixels: PixelsSent::InFrameFile,
                similarity: None,
                place,
            }));
        }
        let (note, exposure) = (work.note()?, work.exposure(&condition)?);
        if let Some(stored) = place.as_ref().and_then(|place| steps.stored_image(place, needed)) {
            let payload = steps.stored_payload(stored.payload, &note, exposure)?;
            let image = PreparedImage {
                payload: with_pair_facts(payload, pair),
                pixels: PixelsSent::Stored,
                similarity: stored.notes.similarity,
                place,
            };
            return Ok(match condition.enhancer {
                None => StagedImage::Ready(image),
                Some(enhancer) => StagedImage::Stored { image, enhancer, notes: stored.notes },
            });
        }
        let started = Instant::now();
        let is_compared = needed == Needed::Similarity;
        let known = place.as_ref().filter(|_| is_compared).and_then(|place| steps.stored_similarity(place));
        let clean = (is_compared && known.is_none()).then(|| work.clean_as_sent());
        let finish = ImageFinisher {
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
        let finish = ImageFinisher { took: started.elapsed(), ..finish };
        match condition.enhancer {
            None => finish.image(&degraded, None).map(StagedImage::Ready),
            Some(enhancer) => Ok(StagedImage::ToEnhance { degraded, enhancer, finish }),
        }
    }
}

impl<'a> ImageFinisher<'a> {
    /// Encodes pixels and stores the image. `enhanced` is what the image adds to the usage of its enhancer.
    ///
    /// # Errors
    /// If it cannot be encoded, or is larger than the endpoint accepts.
    pub(crate) fn image(self, pixels: &Arc<Rgb>, enhanced: Option<ImageUse>) -> Result<PreparedImage<'a>> {
        let started = Instant::now();
        let (payload, encoded) = self.steps.payload(pixels, &self.note, self.exposure)?;
        let measuring = Instant::now();
        let measured =
            self.clean.map(|clean| self.steps.timings.time(TimedStep::Measure, || similarity(&encoded, &clean)));
        let similarity = self.known.or(measured.transpose()?);
        if let Some(place) = self.place.as_ref().filter(|_| self.known.is_none()) {
            let notes = StoredNotes { enhanced, similarity };
            let took = if place.keeps_image() { self.took + started.elapsed() } else { measuring.elapsed() };
            self.steps.store(place, &payload, &notes, took);
        }
        Ok(PreparedImage {
            payload: with_pair_facts(payload, self.pair),
            pixels: PixelsSent::Encoded(encoded),
            similarity,
            place: self.place,
        })
    }
}
