//! Opening the enhancers of a plan, as far as they are needed, and trying them on dark frames.

use std::sync::Arc;
use std::time::Instant;

use super::ImagePipeline;
use crate::error::Result;
use crate::images::enhancement::enhancers::{EnhancerRunArgs, Model};
use crate::images::enhancement::{DarkFrames, EnhancedImages, RestingEnhancer, dark_frames};
use crate::images::frame_work::FrameWork;
use crate::images::frames::Source;
use crate::images::stored::FindingsPlace;
use crate::images::timings::TimedStep;
use crate::images::trials::SourcePlan;
use crate::types::EnhancerName;
use darkqa_enhance::{Enhancer, FRAMES, Findings, Stopper, Usage};

/// Ends the runs of an enhancer from another thread.
pub(crate) enum EnhancerStopper {
    /// Of an open session.
    Open(Stopper),
    /// Of a session that may be opened in the meantime.
    Resting(Arc<RestingEnhancer>),
}

impl EnhancerStopper {
    /// Stops the current image, and every later one.
    pub(crate) fn stop(&self) {
        match self {
            Self::Open(stopper) => stopper.stop(),
            Self::Resting(enhancer) => enhancer.stop(),
        }
    }
}

/// The stored state of an enhancer and of its images.
enum Known<'a> {
    /// Nothing: it is opened and tried, and what is found is kept at this place, if there is a store.
    Nothing(Option<FindingsPlace<'a>>),
    /// The findings of the probe.
    Findings(Findings),
    /// The findings of the probe, and all images of the plan.
    All(Findings),
}

impl<'a> ImagePipeline<'a> {
    /// Adds these models. Each one that the plan needs is opened and tried on a few dark frames, so that one whose images cannot be
    /// enhanced images, or whose value ranges are unknown, is found before anything is asked. What the store knows is not found out
    /// again, and a model all of whose images it has is not opened.
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
            match (self.known(&model, sources, plan)?, model) {
                (Known::All(findings), Model::Read(file)) => {
                    let resting = RestingEnhancer::new(file, settings.clone(), findings);
                    self.resting.push(Arc::new(resting));
                }
                (Known::All(findings) | Known::Findings(findings), model) => {
                    findings.warn(model.name(), model.path());
                    let enhancer = model.open(settings)?;
                    let enhancer = enhancer.with_findings(&findings, findings.usage())?;
                    self.enhancers.push(enhancer);
                }
                (Known::Nothing(place), model) => {
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
        for images in &self.steps.recipe.elsewhere {
            self.look_at(images, sources, plan)?;
        }
        Ok(())
    }

    /// Looks at images that were enhanced elsewhere, until enough of dark frames were seen for a verdict.
    ///
    /// # Errors
    /// If most are implausible, or a file cannot be read.
    fn look_at<I>(
        &mut self,
        images: &EnhancedImages,
        sources: &[Source],
        plan: &[SourcePlan<I>],
    ) -> Result<()> {
        let frames = DarkFrames::new(sources, plan, images.name());
        let steps = self.steps.without_store();
        for (place, (source, conditions)) in frames.frames().iter().enumerate() {
            let Some(frame) = source.middle() else {
                continue;
            };
            let mut work = FrameWork::planned(steps, source, frame);
            // Another condition of each frame first, so that all levels and kinds are met.
            let (before, after) = conditions.split_at(place % conditions.len());
            for condition in after.iter().chain(before) {
                if images.usage().note().judged.images >= FRAMES {
                    return Ok(());
                }
                self.pixels(&mut work, condition)?;
            }
        }
        Ok(())
    }

    /// The frames that an enhancer is tried on.
    fn dark_frames<'s, I>(
        &self,
        sources: &'s [Source],
        plan: &[SourcePlan<I>],
        name: &EnhancerName,
    ) -> DarkFrames<'s>
    where
        'a: 's,
    {
        DarkFrames::for_whole_run(self.whole_run, sources, plan, name)
    }

    /// The stored state of a model.
    fn known<I>(
        &self,
        model: &Model,
        sources: &[Source],
        plan: &[SourcePlan<I>],
    ) -> Result<Known<'a>> {
        let Some(stored) = self.steps.stored else {
            return Ok(Known::Nothing(None));
        };
        let recipe = self.steps.recipe;
        let frames = self.dark_frames(sources, plan, model.name());
        if frames.is_empty() {
            // It enhances nothing in this plan, so nothing is tried.
            return Ok(Known::Nothing(None));
        }
        let place = stored.findings().place(recipe, model, frames.frames())?;
        let findings = place.read();
        let Some(findings) = findings.filter(|findings| findings.allow(self.implausible)) else {
            return Ok(Known::Nothing(Some(place)));
        };
        for part in plan {
            for condition in part.conditions() {
                if condition.enhancer.as_ref() == Some(model.name())
                    && !stored.has_all(recipe, &sources[part.source], condition)?
                {
                    return Ok(Known::Findings(findings));
                }
            }
        }
        Ok(Known::All(findings))
    }

    /// Tries each enhancer on a few dark frames of a plan.
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

    fn probe_one<I>(
        &self,
        enhancer: &mut Enhancer,
        sources: &[Source],
        plan: &[SourcePlan<I>],
    ) -> Result<()> {
        let frames = self.dark_frames(sources, plan, enhancer.name());
        let dark = dark_frames(self.steps, &frames)?;
        if dark.is_empty() {
            return Ok(());
        }
        let probe = || enhancer.probe(&dark, self.implausible);
        self.steps.timings.time(TimedStep::Enhance, probe)
    }

    /// Handles that stop each enhancer.
    pub(crate) fn stoppers(&self) -> Vec<EnhancerStopper> {
        let open = self
            .enhancers
            .iter()
            .chain(self.sets.iter().flatten())
            .map(|enhancer| EnhancerStopper::Open(enhancer.stopper()));
        let resting = self.resting.iter().cloned().map(EnhancerStopper::Resting);
        open.chain(resting).collect()
    }

    /// The notes of the enhancers, by name.
    pub(crate) fn usages(&self) -> Vec<(EnhancerName, Usage)> {
        let open = self
            .enhancers
            .iter()
            .map(|enhancer| (enhancer.name().clone(), enhancer.usage()));
        let resting = self
            .resting
            .iter()
            .map(|enhancer| (enhancer.name().clone(), enhancer.usage().clone()));
        let elsewhere = self
            .steps
            .recipe
            .elsewhere
            .iter()
            .map(|images| (images.name().clone(), images.usage().clone()));
        open.chain(resting).chain(elsewhere).collect()
    }
}
