//! The pipeline from a frame to images: degrade → enhance → scale → encode ([`ImagePipeline`]), for everything asked or written.
//!
//! The images of a frame are made condition by condition, those of a walk all at once. The channel is bounded. So memory holds only the
//! images in flight, one or two more groups, and the frame of each worker.

mod noted;
mod opening;
mod preparation;

pub(crate) use opening::EnhancerStopper;

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use rayon::prelude::*;
use tokio::sync::mpsc::Sender;

use crate::error::{Error, Result};
use crate::images::enhancement::RestingEnhancer;
use crate::images::frame_work::FrameWork;
use crate::images::frame_work::pairs::Resolved;
use crate::images::frame_work::staged::{MadeImage, StagedImage};
use crate::images::frames::Source;
use crate::images::image_steps::ImageSteps;
use crate::images::notes::thumbnail::{ShownObjects, thumbnail_of_all};
use crate::images::notes::{ImageNotes, MissingNotes};
use crate::images::stored::{MadeNotes, Needed};
use crate::images::timings::TimedStep;
use crate::images::trials::{Item, PreparedGroup, SourcePlan, Stimulus, TrialGroup};
use crate::images::workers::Workers;
use crate::picture::Payload;
use crate::types::{Condition, EnhancerName, FrameId, Rgb};
use darkqa_enhance::{Enhancer, ImageUse, Implausible};

/// The steps from a frame to an image, with the enhancement models that they need.
pub(crate) struct ImagePipeline<'a> {
    pub(crate) steps: ImageSteps<'a>,
    /// Enhancers that are open.
    pub(crate) enhancers: Vec<Enhancer>,
    /// Enhancers whose images are all in the store.
    resting: Vec<Arc<RestingEnhancer>>,
    /// Further sets of the enhancers, each for a worker of its own; empty if one image is enhanced at a time.
    sets: Vec<Vec<Enhancer>>,
    /// The treatment of an enhancer whose output cannot be an enhanced image.
    implausible: Implausible,
    /// In a shard, the frames of the whole run that enhancers are tried on; empty for those of the plan.
    pub(crate) whole_run: &'a [Source],
}

/// A source in progress.
enum SourceWork<'a> {
    /// One frame, whose images are made when they are needed.
    Frame(Box<FrameWork<'a>>),
    /// A walk, or several frames of one question, whose images are all made, by condition.
    Walk(BTreeMap<Condition, Vec<Arc<Payload>>>),
    /// A source whose images cannot be made, and the reason.
    Failed(Error),
}

impl<'a> ImagePipeline<'a> {
    /// A pipeline with enhancers that are open.
    pub(crate) fn new(
        steps: ImageSteps<'a>,
        enhancers: Vec<Enhancer>,
        implausible: Implausible,
    ) -> Self {
        Self {
            steps,
            enhancers,
            resting: Vec::new(),
            sets: Vec::new(),
            implausible,
            whole_run: &[],
        }
    }

    /// Makes the images of all sources, until they are done or the channel is closed.
    ///
    /// Normally each worker has one thread and works on one frame at a time, with a set of enhancers of its own. All workers share one
    /// source in three cases: with enhancers that are open only once and have their own threads; with walks; and with few frames.
    pub(crate) fn develop<I: Item>(
        mut self,
        sources: &[Source],
        plan: Vec<SourcePlan<I>>,
        missing: &MissingNotes,
        workers: &Workers,
        groups: &Sender<PreparedGroup<I>>,
    ) {
        if !self.enhancers.is_empty() || !one_frame_each(sources, &plan, workers.each.len()) {
            return workers
                .all
                .install(|| self.send_groups(sources, plan.into_iter(), missing, groups));
        }
        let steps = self.steps;
        let plan = Mutex::new(plan.into_iter());
        let next = || plan.lock().unwrap_or_else(PoisonError::into_inner).next();
        let sets = match self.sets.len() {
            0 => workers.each.iter().map(|_| Vec::new()).collect(),
            _ => self.sets,
        };
        std::thread::scope(|scope| {
            for (worker, enhancers) in workers.each.iter().zip(sets) {
                let mut pipeline = ImagePipeline {
                    steps,
                    enhancers,
                    resting: self.resting.clone(),
                    sets: Vec::new(),
                    implausible: self.implausible,
                    whole_run: self.whole_run,
                };
                scope.spawn(move || {
                    worker.install(|| {
                        pipeline.send_groups(sources, std::iter::from_fn(next), missing, groups);
                    });
                });
            }
        });
    }

    fn send_groups<I: Item>(
        &mut self,
        sources: &[Source],
        plan: impl Iterator<Item = SourcePlan<I>>,
        missing: &MissingNotes,
        groups: &Sender<PreparedGroup<I>>,
    ) {
        let timings = self.steps.timings;
        // The error means that the channel is closed.
        let _ = self.for_each_group(sources, plan, missing, |group| {
            let send = || groups.blocking_send(group).is_ok();
            timings
                .time(TimedStep::Waiting, send)
                .then_some(())
                .ok_or(())
        });
    }

    /// Makes the groups of one source after another, and calls `take` with each.
    ///
    /// # Errors
    /// The first error of `take`. If an image cannot be made, its group contains the problem.
    pub(crate) fn for_each_group<I: Item, X>(
        &mut self,
        sources: &[Source],
        plan: impl Iterator<Item = SourcePlan<I>>,
        missing: &MissingNotes,
        mut take: impl FnMut(PreparedGroup<I>) -> Result<(), X>,
    ) -> Result<(), X> {
        for part in plan {
            let source = &sources[part.source];
            let conditions: Vec<&Condition> = part.conditions().collect();
            let mut work = self.begin(source, &conditions);
            for TrialGroup { condition, trials } in part.groups {
                let result = self.group(&mut work, condition.as_ref(), source, missing);
                let (images, notes, problem) = match result {
                    Ok((images, notes)) => (images, notes, None),
                    Err(problem) => (Vec::new(), ImageNotes::default(), Some(problem)),
                };
                take(PreparedGroup {
                    stimulus: Stimulus { condition, images },
                    trials,
                    problem,
                    notes,
                })?;
            }
        }
        Ok(())
    }

    fn begin(&mut self, source: &Source, conditions: &[&Condition]) -> SourceWork<'a> {
        match &source.frames[..] {
            // A walk may show its only frame several times.
            [frame] if source.order.len() == 1 => {
                SourceWork::Frame(Box::new(FrameWork::planned(self.steps, source, frame)))
            }
            _ if conditions.is_empty() => SourceWork::Walk(BTreeMap::new()),
            _ => match self.images(source, conditions) {
                Ok(images) => {
                    let conditions = conditions.iter().map(|condition| (*condition).clone());
                    SourceWork::Walk(conditions.zip(images).collect())
                }
                Err(problem) => SourceWork::Failed(problem),
            },
        }
    }

    /// The images of a group in the order shown, with the missing notes; none if nothing is shown. Of several images, one
    /// thumbnail stands for all, and no fidelity is measured.
    fn group(
        &mut self,
        work: &mut SourceWork<'_>,
        condition: Option<&Condition>,
        source: &Source,
        missing: &MissingNotes,
    ) -> Result<(Vec<Arc<Payload>>, ImageNotes)> {
        let Some(condition) = condition else {
            return Ok((Vec::new(), ImageNotes::default()));
        };
        let name = &source.name;
        let wanted = missing.wanted(name, condition);
        match work {
            SourceWork::Frame(work) => {
                let shown = work.size().map(|size| ShownObjects {
                    size,
                    objects: missing.objects(name),
                });
                let (image, notes) =
                    self.image_and_notes(work, condition, (name, shown), wanted)?;
                Ok((vec![image], notes))
            }
            SourceWork::Walk(images) => {
                let images = images.remove(condition).unwrap_or_default();
                let thumbnail = wanted
                    .thumbnail
                    .then(|| thumbnail_of_all(name, condition, &images))
                    .and_then(|made| or_warning(name, condition, made).flatten());
                let fidelity = None;
                let notes = ImageNotes {
                    thumbnail,
                    fidelity,
                };
                Ok((images, notes))
            }
            SourceWork::Failed(Error::EnhancerEnded { path, problem }) => {
                let (path, problem) = (path.clone(), problem.clone());
                Err(Error::EnhancerEnded { path, problem })
            }
            SourceWork::Failed(problem) => Err(Error::data(condition, problem)),
        }
    }

    /// The images of a source in each of these conditions, in the order shown.
    ///
    /// # Errors
    /// If the source cannot be shown, or one of its images cannot be made.
    pub(crate) fn images(
        &mut self,
        source: &Source,
        conditions: &[&Condition],
    ) -> Result<Vec<Vec<Arc<Payload>>>> {
        if let Some(problem) = &source.problem {
            return Err(Error::data(&source.name, problem));
        }
        let mut images = vec![Vec::with_capacity(source.frames.len()); conditions.len()];
        let steps = self.steps;
        // One frame per thread at a time, because each holds a frame in its full size.
        for frames in source.frames.chunks(rayon::current_num_threads()) {
            let staged = frames
                .par_iter()
                .map(|frame| {
                    let mut work = FrameWork::planned(steps, source, frame);
                    let mut staged = Vec::with_capacity(conditions.len());
                    for condition in conditions {
                        staged.push(work.stage(condition, Needed::Image)?);
                    }
                    Ok(staged)
                })
                .collect::<Result<Vec<Vec<StagedImage<'_>>>>>()?;
            for (frame, staged) in frames.iter().zip(staged) {
                let conditions = conditions.iter().zip(&mut images);
                for (staged, (condition, images)) in staged.into_iter().zip(conditions) {
                    images.push(self.finished(staged, &frame.id, condition)?.payload);
                }
            }
        }
        let in_order = |images: Vec<Arc<Payload>>| {
            source
                .order
                .iter()
                .map(|place| Arc::clone(&images[*place]))
                .collect()
        };
        Ok(images.into_iter().map(in_order).collect())
    }

    /// A frame in a condition as it is sent, with what is needed besides.
    pub(crate) fn image<'w>(
        &mut self,
        work: &mut FrameWork<'w>,
        condition: &Condition,
        needed: Needed,
    ) -> Result<MadeImage<'w>> {
        let staged = work.stage(condition, needed)?;
        self.finished(staged, work.frame(), condition)
    }

    /// The pixels of a frame in a condition, in the size of the frame.
    pub(crate) fn pixels(
        &mut self,
        work: &mut FrameWork<'_>,
        condition: &Condition,
    ) -> Result<Arc<Rgb>> {
        let Resolved {
            work, condition, ..
        } = work.resolved(condition)?;
        let degraded = Arc::clone(work.degraded(condition.degradation())?);
        match &condition.enhancer {
            None => Ok(degraded),
            Some(name) => {
                let enhanced = self.enhanced(&degraded, name, (work.frame(), &condition))?;
                Ok(Arc::new(enhanced.0))
            }
        }
    }

    /// An image after its enhancer.
    fn finished<'w>(
        &mut self,
        staged: StagedImage<'w>,
        frame: &FrameId,
        condition: &Condition,
    ) -> Result<MadeImage<'w>> {
        match staged {
            StagedImage::Ready(image) => Ok(image),
            StagedImage::Stored {
                image,
                enhancer,
                notes,
            } => {
                self.judge_stored(&notes, &enhancer, [frame, condition])?;
                Ok(image)
            }
            StagedImage::ToEnhance {
                degraded,
                enhancer,
                mut finish,
            } => {
                let started = Instant::now();
                let (image, used) = self.enhanced(&degraded, &enhancer, (frame, condition))?;
                finish.took += started.elapsed();
                finish.image(&Arc::new(image), Some(used))
            }
        }
    }

    /// Notes an image of the store as its enhancer would.
    fn judge_stored(
        &mut self,
        notes: &MadeNotes,
        name: &EnhancerName,
        place: [&dyn ToString; 2],
    ) -> Result<()> {
        let implausible = self.implausible;
        let Some(used) = &notes.enhanced else {
            return Ok(());
        };
        if let Some(images) = self.steps.recipe.elsewhere(name) {
            return used.record_external(images.usage(), images.folder(), place, implausible);
        }
        match self.resting(name) {
            Some(resting) => used.record(resting.usage(), resting.path(), place, implausible),
            None => self.enhancer(name)?.judge_stored(used, place, implausible),
        }
    }

    /// The enhanced image of a frame in a condition, which are named where the image cannot be an enhanced one.
    fn enhanced(
        &mut self,
        image: &Rgb,
        name: &EnhancerName,
        (frame, condition): (&FrameId, &Condition),
    ) -> Result<(Rgb, ImageUse)> {
        let (timings, implausible) = (self.steps.timings, self.implausible);
        if let Some(images) = self.steps.recipe.elsewhere(name) {
            let read = || images.image(image, (frame, condition), implausible);
            return timings.time(TimedStep::Decode, read);
        }
        let place: [&dyn ToString; 2] = [frame, condition];
        if let Some(resting) = self.resting(name) {
            let enhance = || resting.enhance_and_judge(image, place, implausible);
            return timings.time(TimedStep::Enhance, enhance);
        }
        let enhancer = self.enhancer(name)?;
        let enhance = || enhancer.enhance_and_judge(image, place, implausible);
        timings.time(TimedStep::Enhance, enhance)
    }

    fn resting(&self, name: &EnhancerName) -> Option<&RestingEnhancer> {
        self.resting
            .iter()
            .map(Arc::as_ref)
            .find(|enhancer| enhancer.name() == name)
    }

    fn enhancer(&mut self, name: &EnhancerName) -> Result<&mut Enhancer> {
        self.enhancers
            .iter_mut()
            .find(|enhancer| enhancer.name() == name)
            .ok_or_else(|| Error::data(name, "this enhancer is not open"))
    }
}

/// Whether each worker can work on frames of its own: there are enough of them, and no walks.
fn one_frame_each<I>(sources: &[Source], plan: &[SourcePlan<I>], workers: usize) -> bool {
    let mut parts = plan.iter();
    plan.len() >= 2 * workers && parts.all(|part| sources[part.source].frames.len() < 2)
}

/// The value made for the report, or a warning and `None`: an answer must not fail because of a picture for the report.
fn or_warning<T>(name: &FrameId, condition: &Condition, made: Result<T>) -> Option<T> {
    made.inspect_err(|problem| {
        tracing::warn!("the report has no thumbnail of {name} at {condition}: {problem}");
    })
    .ok()
}

#[cfg(test)]
mod tests;
