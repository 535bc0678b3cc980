//! Preparation before the first question: test images, probes of the enhancers, and a set of enhancers for each worker.
//!
//! Opening the enhancers that a plan needs, and probing them on dark frames.

use std::collections::BTreeSet;
use std::num::NonZeroUsize;
use std::sync::Arc;
use std::time::Instant;

use super::{ImagePipeline, has_frames_for_all_workers};
use crate::images::enhancement::enhancers::{EnhancerRunArgs, Model};
use crate::images::enhancement::latency::Latency;
use crate::images::enhancement::{
    DarkFrames, EnhancedImages, LazyEnhancer, dark_frames, dark_or_darkened, evenly_spaced_indices,
};
use crate::images::frame_work::FrameWork;
use crate::images::frames::Source;
use crate::images::stored::{FindingsPlace, Needed};
use crate::images::timings::TimedStep;
use crate::images::trials::SourcePlan;
use crate::images::workers::Workers;
use darkqa_ask::ImageLimit;
use darkqa_base::error::Result;
use darkqa_base::types::{EnhancerName, ImageFacts, Rgb};
use darkqa_enhance::{Enhancer, FRAMES, ProbeFindings, Stopper, Usage, sets_in_memory};

/// Size in bytes above which some servers and proxies refuse an image.
const LARGE_IMAGE: usize = 5_000_000;

impl ImagePipeline<'_> {
    /// Makes a few images before anything is paid for, to find errors that would stop a run later: the first image of
    /// each enhancer and, for an endpoint, the images of the largest frame without an enhancer. Warns if these are
    /// large and the endpoint's limit is unknown.
    pub fn check<I>(&mut self, sources: &[Source], plan: &[SourcePlan<I>]) -> Result<()> {
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
    pub fn probe_sources(&mut self, sources: &[Source]) -> Result<()> {
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
    pub fn check_largest_image<I>(&mut self, sources: &[Source], plan: &[SourcePlan<I>]) -> Result<Option<ImageFacts>> {
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
    pub fn open_enhancer_sets<I>(
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

/// Handle that stops an enhancer from another thread.
pub enum EnhancerStopper {
    /// An open session.
    Open(Stopper),
    /// A session that may be opened later.
    Lazy(Arc<LazyEnhancer>),
}

impl EnhancerStopper {
    /// Stops the current image and all later ones.
    pub fn stop(&self) {
        match self {
            Self::Open(stopper) => stopper.stop(),
            Self::Lazy(enhancer) => enhancer.stop(),
        }
    }
}

/// Contents of the image store about an enhancer.
enum StoredState<'a> {
    /// Nothing, so the enhancer is opened and probed. The findings are written to this place, if there is a store.
    Nothing(Option<FindingsPlace<'a>>),
    /// The findings of the probe.
    Findings(ProbeFindings),
    /// The findings of the probe and all images of the plan.
    All(ProbeFindings),
}

impl<'a> ImagePipeline<'a> {
    /// Adds these models. Each one that the plan needs is opened and probed on a few dark frames, so that implausible
    /// output or unknown value ranges are found before anything is asked. A model is not probed if the store has its
    /// findings, and not opened if the store also has all its images.
    ///
    /// # Errors
    /// If a model cannot be opened, its images are implausible, or a frame cannot be read.
    pub fn open_enhancers<I>(
        &mut self,
        models: Vec<Model>,
        settings: &EnhancerRunArgs,
        sources: &[Source],
        plan: &[SourcePlan<I>],
    ) -> Result<()> {
        for model in models {
            match (self.stored_state(&model, sources, plan)?, model) {
                (StoredState::All(findings), Model::File(file)) => {
                    let lazy = LazyEnhancer::new(file, settings.clone(), findings);
                    self.lazy.push(Arc::new(lazy));
                }
                (StoredState::All(findings) | StoredState::Findings(findings), model) => {
                    findings.warn(model.name(), model.path());
                    let enhancer = model.open(settings)?;
                    let enhancer = enhancer.with_findings(&findings, findings.usage())?;
                    self.enhancers.push(enhancer);
                }
                (StoredState::Nothing(place), model) => {
                    let started = Instant::now();
                    let mut enhancer = model.open(settings)?;
                    self.probe_one(&mut enhancer, sources, plan)?;
                    if let Some(place) = place {
                        place.write(&enhancer.findings(), started.elapsed());
                    }
                    self.enhancers.push(enhancer);
                }
            }
        }
        for images in &self.steps.recipe.enhanced_images {
            self.judge_enhanced_images(images, sources, plan)?;
        }
        Ok(())
    }

    /// Judges whether images that were enhanced elsewhere are plausible, on up to [`FRAMES`] images of dark frames.
    ///
    /// # Errors
    /// If most are implausible, or a file cannot be read.
    fn judge_enhanced_images<I>(
        &mut self,
        images: &EnhancedImages,
        sources: &[Source],
        plan: &[SourcePlan<I>],
    ) -> Result<()> {
        let frames = DarkFrames::new(sources, plan, images.name());
        let steps = self.steps.without_store();
        for (index, (source, conditions)) in frames.frames().iter().enumerate() {
            let Some(frame) = source.middle() else {
                continue;
            };
            let mut work = FrameWork::for_source(steps, source, frame);
            // Each frame starts with another condition, so that all levels and kinds are covered.
            let (before, after) = conditions.split_at(index % conditions.len());
            for condition in after.iter().chain(before) {
                if images.usage().note().judged.images >= FRAMES {
                    return Ok(());
                }
                self.pixels(&mut work, condition)?;
            }
        }
        Ok(())
    }

    /// The frames on which an enhancer is probed.
    fn dark_frames<'s, I>(&self, sources: &'s [Source], plan: &[SourcePlan<I>], name: &EnhancerName) -> DarkFrames<'s>
    where
        'a: 's,
    {
        DarkFrames::for_whole_run(self.whole_run, sources, plan, name)
    }

    /// The stored state of a model.
    fn stored_state<I>(&self, model: &Model, sources: &[Source], plan: &[SourcePlan<I>]) -> Result<StoredState<'a>> {
        let Some(stored) = self.steps.stored else {
            return Ok(StoredState::Nothing(None));
        };
        let recipe = self.steps.recipe;
        let frames = self.dark_frames(sources, plan, model.name());
        if frames.is_empty() {
            // The model enhances nothing in this plan, so it is not probed.
            return Ok(StoredState::Nothing(None));
        }
        let place = stored.findings().place(recipe, model, frames.frames())?;
        let findings = place.read();
        let Some(findings) = findings.filter(|findings| findings.allow(self.implausible)) else {
            return Ok(StoredState::Nothing(Some(place)));
        };
        for part in plan {
            for condition in part.conditions() {
                if condition.enhancer.as_ref() == Some(model.name())
                    && !stored.has_all(recipe, &sources[part.source], condition)?
                {
                    return Ok(StoredState::Findings(findings));
                }
            }
        }
        Ok(StoredState::All(findings))
    }

    /// Probes each enhancer on a few dark frames of a plan.
    ///
    /// # Errors
    /// If its images are implausible, or a frame cannot be read.
    pub fn probe<I>(&mut self, sources: &[Source], plan: &[SourcePlan<I>]) -> Result<()> {
        let mut enhancers = std::mem::take(&mut self.enhancers);
        for enhancer in &mut enhancers {
            self.probe_one(enhancer, sources, plan)?;
        }
        self.enhancers = enhancers;
        Ok(())
    }

    fn probe_one<I>(&self, enhancer: &mut Enhancer, sources: &[Source], plan: &[SourcePlan<I>]) -> Result<()> {
        let frames = self.dark_frames(sources, plan, enhancer.name());
        let dark = dark_frames(self.steps, &frames)?;
        if dark.is_empty() {
            return Ok(());
        }
        self.steps.timings.time(TimedStep::Enhance, || {
            enhancer.probe(&dark, self.implausible)?;
            enhancer.usage().set_latency(Latency::measure(enhancer, &dark).by_size());
            Ok(())
        })
    }

    /// Handles that stop the enhancers.
    pub fn stoppers(&self) -> Vec<EnhancerStopper> {
        let open = self
            .enhancers
            .iter()
            .chain(self.enhancer_sets.iter().flatten())
            .map(|enhancer| EnhancerStopper::Open(enhancer.stopper()));
        let lazy = self.lazy.iter().cloned().map(EnhancerStopper::Lazy);
        open.chain(lazy).collect()
    }

    /// The usage notes of all enhancers, with their names.
    pub fn usages(&self) -> Vec<(EnhancerName, Usage)> {
        let open = self.enhancers.iter().map(|enhancer| (enhancer.name().clone(), enhancer.usage()));
        let lazy = self.lazy.iter().map(|enhancer| (enhancer.name().clone(), enhancer.usage().clone()));
        let imported =
            self.steps.recipe.enhanced_images.iter().map(|images| (images.name().clone(), images.usage().clone()));
        open.chain(lazy).chain(imported).collect()
    }
}
