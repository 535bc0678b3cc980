//! Time of each step of a run: [`Timings`].
//!
//! Settings and steps that all images share: [`ImageSteps`].

use std::borrow::Cow;
use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use super::frames::Frames;
use super::recipes::Recipe;
use super::stored::{Needed, Similarity, StoredImage, StoredImages, StoredNotes, StoredPlace};
use darkqa_ask::{HeldBack, ImageLimit};
use darkqa_base::error::Result;
use darkqa_base::types::manifests::PngForm;
use darkqa_base::types::{ExposureFacts, InputNote, Rgb};
use darkqa_pictures::Payload;

/// A step of the image pipeline, or a state of the request queue.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TimedStep {
    /// Reading and decoding of a file.
    Decode,
    /// Reduction of light and addition of noise.
    Degrade,
    /// Enhancement by a model.
    Enhance,
    /// Scaling and encoding of an image.
    Encode,
    /// Comparison of an image with its clean frame.
    Measure,
    /// Images are ready and wait for a free request.
    Waiting,
    /// No request is in flight, because no image is ready.
    Idle,
    /// The maximum number of requests is in flight.
    Full,
}

impl TimedStep {
    const ALL: [(Self, &str); 8] = [
        (Self::Decode, "decode"),
        (Self::Degrade, "degrade"),
        (Self::Enhance, "enhance"),
        (Self::Encode, "encode"),
        (Self::Measure, "measure"),
        (Self::Waiting, "waiting"),
        (Self::Idle, "idle"),
        (Self::Full, "full"),
    ];
}

/// Time of each step, summed over threads.
#[derive(Debug, Default)]
pub struct Timings {
    nanoseconds: [AtomicU64; TimedStep::ALL.len()],
}

impl Timings {
    /// Runs `action` and adds its time to a step.
    pub fn time<T>(&self, step: TimedStep, action: impl FnOnce() -> T) -> T {
        let started = Instant::now();
        let result = action();
        self.add(step, started.elapsed());
        result
    }

    pub fn add(&self, step: TimedStep, time: Duration) {
        self.nanoseconds[step as usize].fetch_add(time.as_nanos() as u64, Ordering::Relaxed);
    }

    fn seconds(&self, step: TimedStep) -> f64 {
        self.nanoseconds[step as usize].load(Ordering::Relaxed) as f64 / 1e9
    }

    /// One line with the time of each step and the bottleneck of a run that took this time on `threads` threads.
    /// `held_back` is the time for which requests had to wait for their turn. `has_endpoint` is false if every model is
    /// built in.
    pub fn summary(&self, took: Duration, threads: usize, held_back: HeldBack, has_endpoint: bool) -> String {
        TimingsText { timings: self, took: took.as_secs_f64(), threads, held_back, has_endpoint }.to_string()
    }
}

struct TimingsText<'a> {
    timings: &'a Timings,
    /// Duration of the run, in seconds.
    took: f64,
    threads: usize,
    held_back: HeldBack,
    has_endpoint: bool,
}

impl fmt::Display for TimingsText<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { timings, took, threads, held_back, has_endpoint } = *self;
        let image_steps =
            [TimedStep::Decode, TimedStep::Degrade, TimedStep::Enhance, TimedStep::Encode, TimedStep::Measure];
        let busy: f64 = image_steps.iter().map(|step| timings.seconds(*step)).sum();
        write!(f, "timings: {took:.1} s; images:")?;
        for (step, name) in TimedStep::ALL {
            if image_steps.contains(&step) {
                write!(f, " {name} {:.1} s,", timings.seconds(step))?;
            }
        }
        let (idle, full) = (timings.seconds(TimedStep::Idle), timings.seconds(TimedStep::Full));
        write!(
            f,
            " {:.0} % of {threads} threads; they waited {:.1} s for requests; requests: none in flight {idle:.1} s, as many as allowed \
             {full:.1} s; ",
            100.0 * busy / (took * threads as f64).max(1e-9),
            timings.seconds(TimedStep::Waiting)
        )?;
        let (cause, wait) = held_back.main_cause();
        let wait = wait.as_secs_f64();
        if wait > idle && wait > took / 4.0 {
            return write!(f, "held back {wait:.1} s: {cause}");
        }
        let slowest = image_steps.into_iter().max_by(|a, b| timings.seconds(*a).total_cmp(&timings.seconds(*b)));
        f.write_str(match slowest {
            _ if full > idle && full > took / 4.0 && !has_endpoint => {
                "the built-in models limit the speed: more cores would help"
            }
            _ if full > idle && full > took / 4.0 => {
                "the endpoint limits the speed: more --concurrency, or a faster endpoint, would help"
            }
            _ if idle < took / 4.0 => "nothing limits the speed much",
            Some(TimedStep::Enhance) => {
                "making images limits the speed, enhancement most: more cores, --shard over machines or --llie-options max-side would help"
            }
            Some(TimedStep::Encode) => {
                "making images limits the speed, encoding most: more cores, --shard over machines, or smaller images (--image max-side=N, --image \
                 jpeg:95) would help"
            }
            _ => "making images limits the speed: more cores or --shard over machines would help",
        })
    }
}

/// Frame files, recipe, endpoint limit, timings and image store that all images share.
#[derive(Clone, Copy)]
pub struct ImageSteps<'a> {
    pub frames: &'a dyn Frames,
    pub recipe: &'a Recipe,
    /// Largest image that the endpoint accepts; `None` if all models are built in.
    pub limit: Option<ImageLimit>,
    pub timings: &'a Timings,
    /// The form of PNG files.
    pub png: PngForm,
    /// The image store; `None` without one.
    pub stored: Option<StoredImages<'a>>,
}

impl ImageSteps<'_> {
    /// The same steps without the image store.
    #[must_use]
    pub fn without_store(self) -> Self {
        Self { stored: None, ..self }
    }

    /// Reads an image from the store; `None` if it or a needed fact is missing.
    pub fn stored_image(&self, place: &StoredPlace<'_>, needed: Needed) -> Option<StoredImage> {
        self.timings.time(TimedStep::Decode, || place.read(self.recipe, needed))
    }

    /// Similarity of an image to its clean frame, if the store has it without the image.
    pub fn stored_similarity(&self, place: &StoredPlace<'_>) -> Option<Similarity> {
        self.timings.time(TimedStep::Decode, || place.similarity())
    }

    /// Adds an image to the store. `took` is the time that it took to make.
    pub fn store(&self, place: &StoredPlace<'_>, image: &Payload, notes: &StoredNotes, took: Duration) {
        self.timings.time(TimedStep::Encode, || place.write(image, notes, took));
    }

    /// Adds the facts that the store does not keep to an image from it: how its frame was read (`note`), and the
    /// camera's exposure.
    pub fn stored_payload(
        &self,
        payload: Payload,
        note: &InputNote,
        exposure: Option<ExposureFacts>,
    ) -> Result<Arc<Payload>> {
        let payload = payload.with_orientation(note.orientation);
        self.check_size(payload.with_exposure(exposure))
    }

    /// Scales and encodes an image; returns the payload and the scaled pixels. `note` tells how its frame was read.
    pub fn payload(
        &self,
        image: &Arc<Rgb>,
        note: &InputNote,
        exposure: Option<ExposureFacts>,
    ) -> Result<(Arc<Payload>, Arc<Rgb>)> {
        let (payload, encoded) = self.timings.time(TimedStep::Encode, || {
            let encoded = self.scaled(image)?;
            let payload = Payload::encode_as(&encoded, self.recipe.format, self.png)?;
            let payload = payload.with_orientation(note.orientation);
            Ok((payload.with_exposure(exposure), encoded))
        })?;
        Ok((self.check_size(payload)?, encoded))
    }

    /// Scales an image to the size sent. An image that already has that size is shared, not copied.
    pub fn scaled(&self, image: &Arc<Rgb>) -> Result<Arc<Rgb>> {
        Ok(match self.recipe.scaling.scale(image)? {
            Cow::Borrowed(_) => Arc::clone(image),
            Cow::Owned(scaled) => Arc::new(scaled),
        })
    }

    /// # Errors
    /// If the image is larger than the endpoint accepts.
    pub fn check_size(&self, payload: Payload) -> Result<Arc<Payload>> {
        if let Some(limit) = &self.limit {
            limit.check(payload.facts())?;
        }
        Ok(Arc::new(payload))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use darkqa_ask::PaceCause;

    /// The summary of a run of 10 s on 2 threads, with these seconds per step.
    fn summary(steps: &[(TimedStep, u64)]) -> String {
        let timings = Timings::default();
        for (step, seconds) in steps {
            timings.add(*step, Duration::from_secs(*seconds));
        }
        timings.summary(Duration::from_secs(10), 2, HeldBack::default(), true)
    }

    #[test]
    fn the_summary_names_limits_that_hold_requests_back() {
        let line = |cause, seconds| {
            let timings = Timings::default();
            timings.add(TimedStep::Full, Duration::from_secs(8));
            let mut held_back = HeldBack::default();
            held_back.add(cause, Duration::from_secs(seconds));
            timings.summary(Duration::from_secs(10), 2, held_back, true)
        };
        let stated = line(PaceCause::ReportedLimits, 5);
        assert!(stated.contains("held back 5.0 s: the limits per minute that the endpoint states"), "{stated}");
        assert!(line(PaceCause::Refusals, 5).contains("turns requests away"));
        assert!(line(PaceCause::Quota, 5).contains("--rpm or --tpm limits the speed"));
        let short = line(PaceCause::Quota, 1);
        assert!(short.contains("the endpoint limits the speed"), "{short}");
    }

    #[test]
    fn built_in_models_are_no_endpoint() {
        let timings = Timings::default();
        timings.add(TimedStep::Full, Duration::from_secs(9));
        let line = timings.summary(Duration::from_secs(10), 2, HeldBack::default(), false);
        assert!(line.ends_with("the built-in models limit the speed: more cores would help"), "{line}");
    }

    #[test]
    fn the_summary_names_the_bottleneck() {
        let line = summary(&[(TimedStep::Encode, 12), (TimedStep::Decode, 6), (TimedStep::Idle, 9)]);
        assert!(line.contains("decode 6.0 s") && line.contains("90 % of 2 threads"), "{line}");
        assert!(line.contains("encoding most"), "{line}");
        assert!(summary(&[(TimedStep::Full, 9)]).contains("the endpoint limits the speed"));
        assert!(summary(&[(TimedStep::Enhance, 9), (TimedStep::Idle, 5)]).contains("enhancement most"));
        assert!(summary(&[(TimedStep::Encode, 1), (TimedStep::Idle, 1)]).contains("nothing limits the speed much"));
    }
}
