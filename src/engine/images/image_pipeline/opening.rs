//! Opening the enhancers that a plan needs, and probing them on dark frames.

use std::sync::Arc;
use std::time::Instant;

use super::ImagePipeline;
use crate::engine::images::enhancement::enhancers::{EnhancerRunArgs, Model};
use crate::engine::images::enhancement::{DarkFrames, EnhancedImages, LazyEnhancer, dark_frames};
use crate::engine::images::frame_work::FrameWork;
use crate::engine::images::frames::Source;
use crate::engine::images::stored::FindingsPlace;
use crate::engine::images::timings::TimedStep;
use crate::engine::images::trials::SourcePlan;
use crate::error::Result;
use crate::types::EnhancerName;
use darkqa_enhance::{Enhancer, FRAMES, Findings, Stopper, Usage};

/// Handle that stops an enhancer from another thread.
pub(crate) enum EnhancerStopper {
    /// An open session.
    Open(Stopper),
    /// A session that may be opened later.
    Lazy(Arc<LazyEnhancer>),
}

impl EnhancerStopper {
    /// Stops the current image and all later ones.
    pub(crate) fn stop(&self) {
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
    Findings(Findings),
    /// The findings of the probe and all images of the plan.
    All(Findings),
}

impl<'a> ImagePipeline<'a> {
    /// Adds these models. Each one that the plan needs is opened and probed on a few dark frames, so that implausible
    /// output or unknown value ranges are found before anything is asked. A model is not probed if the store has its
    /// findings, and not opened if the store also has all its images.
    ///
    /// # Errors
    /// If a model cannot be opened, its images are implausible, or a frame cannot be read.
    pub(crate) fn open_enhancers<I>(
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
    pub(crate) fn probe<I>(&mut self, sources: &[Source], plan: &[SourcePlan<I>]) -> Result<()> {
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
        self.steps.timings.time(TimedStep::Enhance, || enhancer.probe(&dark, self.implausible))
    }

    /// Handles that stop the enhancers.
    pub(crate) fn stoppers(&self) -> Vec<EnhancerStopper> {
        let open = self
            .enhancers
            .iter()
            .chain(self.enhancer_sets.iter().flatten())
            .map(|enhancer| EnhancerStopper::Open(enhancer.stopper()));
        let lazy = self.lazy.iter().cloned().map(EnhancerStopper::Lazy);
        open.chain(lazy).collect()
    }

    /// The usage notes of all enhancers, with their names.
    pub(crate) fn usages(&self) -> Vec<(EnhancerName, Usage)> {
        let open = self.enhancers.iter().map(|enhancer| (enhancer.name().clone(), enhancer.usage()));
        let lazy = self.lazy.iter().map(|enhancer| (enhancer.name().clone(), enhancer.usage().clone()));
        let imported =
            self.steps.recipe.enhanced_images.iter().map(|images| (images.name().clone(), images.usage().clone()));
        open.chain(lazy).chain(imported).collect()
    }
}
