//! Preparation before the first question: test images, probes of the enhancers, and a set of enhancers for each worker.

use std::collections::BTreeSet;
use std::num::NonZeroUsize;

use super::{ImagePipeline, has_frames_for_all_workers};
use crate::ask::ImageLimit;
use crate::engine::images::enhancement::{dark_or_darkened, evenly_spaced_indices};
use crate::engine::images::frame_work::FrameWork;
use crate::engine::images::frames::Source;
use crate::engine::images::stored::Needed;
use crate::engine::images::trials::SourcePlan;
use crate::engine::images::workers::Workers;
use crate::error::Result;
use crate::types::{ImageFacts, Rgb};
use darkqa_enhance::{Enhancer, FRAMES, sets_in_memory};

/// Size in bytes above which some servers and proxies refuse an image.
const LARGE_IMAGE: usize = 5_000_000;

impl ImagePipeline<'_> {
    /// Makes a few images before anything is paid for, to find errors that would stop a run later: the first image of
    /// each enhancer and, for an endpoint, the images of the largest frame without an enhancer. Warns if these are
    /// large and the endpoint's limit is unknown.
    pub(crate) fn check<I>(&mut self, sources: &[Source], plan: &[SourcePlan<I>]) -> Result<()> {
        self.try_enhancers(sources, plan)?;
        // Test images do not count as images of the run.
        self.enhancers.iter_mut().for_each(Enhancer::reset_counts);
        if let Some(limit) = self.steps.limit {
            warn_about_large_images(self.check_largest_image(sources, plan)?.as_ref(), limit);
        }
        Ok(())
    }

    /// Makes the first image of each open enhancer, so that a broken one is found before anything is asked.
    fn try_enhancers<I>(&mut self, sources: &[Source], plan: &[SourcePlan<I>]) -> Result<()> {
        let mut tried = BTreeSet::new();
        for part in plan {
            let source = &sources[part.source];
            let Some(frame) = source.middle() else {
                continue;
            };
            for condition in part.conditions() {
                if let Some(name) = &condition.enhancer
                    && self.lazy_enhancer(name).is_none()
                    && tried.insert(name)
                {
                    let steps = self.steps.without_store();
                    let mut work = FrameWork::for_source(steps, source, frame);
                    self.image(&mut work, condition, Needed::Image)?;
                }
            }
        }
        Ok(())
    }

    /// Probes each enhancer without a plan, on a few frames of these sources; bright frames are darkened first.
    pub(crate) fn probe_sources(&mut self, sources: &[Source]) -> Result<()> {
        if self.enhancers.is_empty() {
            return Ok(());
        }
        let mut frames: Vec<Rgb> = Vec::new();
        for index in evenly_spaced_indices(sources.len(), FRAMES) {
            let source = &sources[index];
            if let Some(frame) = source.middle() {
                let mut work = FrameWork::for_source(self.steps, source, frame);
                frames.push(Rgb::clone(work.clean()?));
            }
        }
        let dark = dark_or_darkened(&frames);
        if dark.is_empty() {
            return Ok(());
        }
        for enhancer in &mut self.enhancers {
            enhancer.probe(&dark, self.implausible)?;
        }
        Ok(())
    }

    /// Checks that the endpoint accepts the images of the frame with the most pixels in the conditions without an
    /// enhancer, and returns the facts of the largest one; `None` without frames.
    ///
    /// # Errors
    /// If an image cannot be made, or is too large for the endpoint.
    pub(crate) fn check_largest_image<I>(
        &mut self,
        sources: &[Source],
        plan: &[SourcePlan<I>],
    ) -> Result<Option<ImageFacts>> {
        let frames = plan.iter().flat_map(|part| {
            let source = &sources[part.source];
            source.frames.iter().map(move |frame| (part, source, frame))
        });
        if let Some(limit) = self.steps.limit {
            let shown = plan
                .iter()
                .filter(|part| part.conditions().next().is_some())
                .map(|part| sources[part.source].order.len());
            limit.check_request(shown.max().unwrap_or(0), None)?;
        }
        let Some((part, source, frame)) =
            frames.max_by_key(|(.., frame)| u64::from(frame.size.0) * u64::from(frame.size.1))
        else {
            return Ok(None);
        };
        let mut work = FrameWork::for_source(self.steps.without_store(), source, frame);
        let mut largest: Option<ImageFacts> = None;
        for condition in part.conditions().filter(|condition| condition.enhancer.is_none()) {
            let image = self
                .image(&mut work, condition, Needed::Image)
                .map_err(|e| e.at(format!("frame {} at {condition}", frame.id)))?;
            let facts = image.payload.facts();
            if largest.as_ref().is_none_or(|known| facts.bytes > known.bytes) {
                largest = Some(facts.clone());
            }
        }
        if let (Some(limit), Some(image)) = (self.steps.limit, &largest) {
            let shown = source.order.len();
            limit.check_request(shown, Some(image))?;
            if let Some(problem) = limit.may_exceed(shown, image) {
                tracing::warn!("{problem}");
            }
        }
        Ok(largest)
    }

    /// Opens a set of enhancers for each worker, so that several images are enhanced at the same time, if there are
    /// enough frames and memory. Measured CPU time of two workers with one thread each, relative to one worker with two
    /// threads: 0.86 for Zero-DCE, 0.59 for RUAS.
    ///
    /// # Errors
    /// If a session cannot be opened.
    pub(crate) fn open_enhancer_sets<I>(
        &mut self,
        sources: &[Source],
        plan: &[SourcePlan<I>],
        workers: &Workers,
    ) -> Result<()> {
        let cores = workers.single_threaded.len();
        if self.enhancers.is_empty() || !has_frames_for_all_workers(sources, plan, cores) {
            return Ok(());
        }
        let count = sets_in_memory(cores);
        if count < 2 {
            return Ok(());
        }
        let threads = NonZeroUsize::new(cores / count).unwrap_or(NonZeroUsize::MIN);
        self.enhancer_sets = (1..=count)
            .map(|number| self.enhancers.iter().map(|enhancer| enhancer.twin(number, threads)).collect())
            .collect::<Result<_>>()?;
        self.enhancers.clear();
        Ok(())
    }
}

/// Warns if images are large and the limit of the endpoint is unknown.
fn warn_about_large_images(largest: Option<&ImageFacts>, limit: ImageLimit) {
    if let Some(image) = largest
        && image.bytes > LARGE_IMAGE
        && limit == ImageLimit::UNKNOWN
    {
        tracing::warn!(
            "images are up to {:.1} MB, {:.1} MB as sent; if the server answers 413, make them smaller with --image max-side=N or --image jpeg:95",
            image.bytes as f64 / 1e6,
            image.bytes as f64 / 0.75e6
        );
    }
}
