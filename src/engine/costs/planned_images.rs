//! Estimates of the images that remain to be made and sent, from a sample: [`PlannedImages`], [`SampledImages`].

use std::collections::BTreeMap;
use std::time::Instant;

use crate::engine::experiment::Experiment;
use crate::engine::image_cache::ImageSet;
use crate::engine::images::frame_work::FrameWork;
use crate::engine::images::frames::Source;
use crate::engine::images::image_pipeline::ImagePipeline;
use crate::engine::images::stored::Needed;
use crate::engine::images::trials::Plan;
use crate::error::Result;
use crate::types::{Condition, ImageFacts};

/// Number of sources whose images are made to measure their size. Images with enhancers are made for the first of them
/// only.
const SAMPLED_SOURCES: usize = 3;

/// Bytes of a request besides its images and its text.
const REQUEST_BYTES: f64 = 300.0;

/// Bytes of base64 text for each byte of an image.
const BASE64: f64 = 4.0 / 3.0;

/// Numbers, bytes and times of the remaining images and requests, estimated from a sample of images.
pub(crate) struct PlannedImages {
    /// Number of images to be made.
    pub(crate) made: usize,
    /// Number of images in all requests.
    pub(crate) sent: usize,
    /// Bytes of all requests.
    pub(crate) bytes: f64,
    /// Bytes of the largest request.
    pub(crate) largest_request: f64,
    /// Time to make all images on this machine, in seconds.
    pub(crate) seconds: f64,
    /// The images that an image store would contain; `None` without a store.
    pub(crate) set: Option<ImageSet>,
}

impl PlannedImages {
    /// Estimates the images of the remaining trials in these plans, one plan for each phase.
    pub(crate) fn new<E: Experiment>(experiment: &E, plans: &[Plan<E::Item>], sample: &SampledImages) -> Self {
        let mut all = Self {
            made: 0,
            sent: 0,
            bytes: 0.0,
            largest_request: 0.0,
            seconds: 0.0,
            set: experiment.settings().images.image_set(),
        };
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        for (phase, plan) in plans.iter().enumerate() {
            let models = experiment.models(phase);
            for (place, group) in plan.groups() {
                let source = &experiment.sources()[place];
                let condition = group.condition.as_ref();
                let mean = condition.and_then(|condition| sample.mean(condition));
                let shown = condition.map_or(0, |_| source.order.len());
                let shown_bytes = mean.map_or(0.0, |mean| mean.bytes * BASE64 * shown as f64);
                let trials = group.trials.iter();
                for trial in trials.filter(|trial| models[trial.model].model.is_remote()) {
                    let text = trial.prompt.parts().concat().len() as f64;
                    let request = shown_bytes + text + REQUEST_BYTES;
                    all.bytes += request;
                    all.sent += shown;
                    all.largest_request = all.largest_request.max(request);
                }
                if let Some(condition) = condition {
                    all.add_made(condition, source, mean, cores);
                }
            }
        }
        all
    }

    /// Adds the images of a source in a condition.
    fn add_made(&mut self, condition: &Condition, source: &Source, mean: Option<ImageMeans>, cores: usize) {
        let frames = source.frames.len();
        self.made += frames;
        if let Some(set) = &mut self.set {
            let bytes = mean.map_or(0.0, |mean| mean.bytes);
            set.add(condition.enhancer.is_some(), bytes * frames as f64);
        }
        // The frames of a walk are made in parallel, one per core. For a single frame, all cores work together.
        let in_parallel = if frames > 1 { cores } else { 1 };
        self.seconds += mean.map_or(0.0, |mean| mean.seconds * frames as f64 / in_parallel as f64);
    }
}

/// Mean size in bytes and mean time in seconds of an image.
#[derive(Debug, Clone, Copy)]
struct ImageMeans {
    bytes: f64,
    seconds: f64,
}

/// Images that were made to measure their size and time.
#[derive(Default)]
pub(crate) struct SampledImages {
    /// Sizes of all sampled images.
    pub(crate) images: Vec<ImageFacts>,
    /// Sum of bytes, sum of seconds and number of images, by condition.
    sums: BTreeMap<Condition, (f64, f64, usize)>,
}

impl SampledImages {
    /// Makes the images of the middle frame of a few sources spread over the plan.
    pub(crate) fn make<E: Experiment>(
        experiment: &E,
        plan: &Plan<E::Item>,
        pipeline: &mut ImagePipeline<'_>,
    ) -> Result<Self> {
        let mut sample = Self::default();
        let sources = experiment.sources();
        let shown: Vec<_> = plan
            .sources
            .iter()
            .filter_map(|part| {
                let source = &sources[part.source];
                Some((part, source, source.middle()?))
            })
            .collect();
        let step = shown.len().div_ceil(SAMPLED_SOURCES).max(1);
        for (i, (part, source, frame)) in shown.into_iter().step_by(step).enumerate() {
            let mut work = FrameWork::for_source(pipeline.steps.without_store(), source, frame);
            let conditions = part.conditions();
            for condition in conditions.filter(|condition| i == 0 || condition.enhancer.is_none()) {
                let started = Instant::now();
                let image = pipeline.image(&mut work, condition, Needed::Image)?;
                let facts = image.payload.facts();
                let (bytes, seconds, n) = sample.sums.entry(condition.clone()).or_default();
                *bytes += facts.bytes as f64;
                *seconds += started.elapsed().as_secs_f64();
                *n += 1;
                sample.images.push(facts.clone());
            }
        }
        Ok(sample)
    }

    fn mean(&self, condition: &Condition) -> Option<ImageMeans> {
        let (bytes, seconds, n) = self.sums.get(condition)?;
        Some(ImageMeans { bytes: bytes / *n as f64, seconds: seconds / *n as f64 })
    }
}
