//! The pipeline from a frame to images: degrade → enhance → scale → encode ([`ImagePipeline`]).
//!
//! The images of a frame are made condition by condition, those of a walk all at once. The channel to the requests is
//! bounded, so that memory contains only the images in flight, one or two more groups, and the frame of each worker.
//!
//! The notes about an image for the report, made with the image: [`ImagePipeline::image_and_notes`].

mod preparation;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use rayon::prelude::*;
use tokio::sync::mpsc::Sender;

use super::frame_work::{PixelsSent, PreparedImage, Resolved, StagedImage};
use super::notes::{ShownObjects, WantedNotes, fidelity, thumbnail, thumbnail_of_all};
use super::timings::ImageSteps;
use crate::images::enhancement::LazyEnhancer;
use crate::images::frame_work::FrameWork;
use crate::images::frames::Source;
use crate::images::notes::{ImageNotes, MissingNotes};
use crate::images::stored::{Needed, StoredNotes};
use crate::images::timings::TimedStep;
use crate::images::trials::{Item, PreparedGroup, SourcePlan, Stimulus, TrialGroup};
use crate::images::workers::Workers;
use darkqa_base::error::{Error, Result};
use darkqa_base::types::{Condition, EnhancerName, FrameId, Rgb, Thumbnail};
use darkqa_enhance::{Enhancer, ImageUse, Implausible};
use darkqa_pictures::Payload;

pub use preparation::EnhancerStopper;

/// The steps from a frame to an image, with the enhancement models that they need.
pub struct ImagePipeline<'a> {
    pub steps: ImageSteps<'a>,
    /// Open enhancers.
    pub enhancers: Vec<Enhancer>,
    /// Enhancers that are opened only if an image is missing in the store.
    lazy: Vec<Arc<LazyEnhancer>>,
    /// One set of enhancers per worker; empty if one image is enhanced at a time.
    enhancer_sets: Vec<Vec<Enhancer>>,
    /// Reaction to implausible output of an enhancer: stop or continue.
    implausible: Implausible,
    /// In a shard: the frames of the whole run on which enhancers are probed. Empty: the frames of the plan are used.
    pub whole_run: &'a [Source],
}

/// A source in progress.
enum SourceWork<'a> {
    /// One frame; each image is made on demand.
    Frame(Box<FrameWork<'a>>),
    /// A walk, or several frames of one question: all images, by condition.
    Walk(BTreeMap<Condition, Vec<Arc<Payload>>>),
    /// The reason why the images of a source cannot be made.
    Failed(Error),
}

impl<'a> ImagePipeline<'a> {
    /// A pipeline with open enhancers.
    pub fn new(steps: ImageSteps<'a>, enhancers: Vec<Enhancer>, implausible: Implausible) -> Self {
        Self { steps, enhancers, lazy: Vec::new(), enhancer_sets: Vec::new(), implausible, whole_run: &[] }
    }

    /// Makes the images of all sources, until they are done or the channel is closed.
    ///
    /// Normally each worker has one thread, its own frame and its own set of enhancers. All workers share one source in
    /// three cases: if the enhancers are open only once (they have their own threads), for walks, and if there are few
    /// frames.
    pub fn develop<I: Item>(
        mut self,
        sources: &[Source],
        plan: Vec<SourcePlan<I>>,
        missing: &MissingNotes,
        workers: &Workers,
        groups: &Sender<PreparedGroup<I>>,
    ) {
        if !self.enhancers.is_empty() || !has_frames_for_all_workers(sources, &plan, workers.single_threaded.len()) {
            return workers.shared.install(|| self.send_groups(sources, plan.into_iter(), missing, groups));
        }
        let steps = self.steps;
        let plan = Mutex::new(plan.into_iter());
        let sets = match self.enhancer_sets.len() {
            0 => workers.single_threaded.iter().map(|_| Vec::new()).collect(),
            _ => self.enhancer_sets,
        };
        let plan = &plan;
        std::thread::scope(|scope| {
            for (worker, enhancers) in workers.single_threaded.iter().zip(sets) {
                let mut pipeline = ImagePipeline {
                    steps,
                    enhancers,
                    lazy: self.lazy.clone(),
                    enhancer_sets: Vec::new(),
                    implausible: self.implausible,
                    whole_run: self.whole_run,
                };
                scope.spawn(move || {
                    worker.install(|| {
                        let next_part =
                            std::iter::from_fn(|| plan.lock().unwrap_or_else(PoisonError::into_inner).next());
                        pipeline.send_groups(sources, next_part, missing, groups);
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
            timings.time(TimedStep::Waiting, || groups.blocking_send(group).is_ok()).then_some(()).ok_or(())
        });
    }

    /// Makes the groups of one source after another, and calls `take` with each.
    ///
    /// # Errors
    /// The first error of `take`. If an image cannot be made, its group contains the problem.
    pub fn for_each_group<I: Item, X>(
        &mut self,
        sources: &[Source],
        plan: impl Iterator<Item = SourcePlan<I>>,
        missing: &MissingNotes,
        mut take: impl FnMut(PreparedGroup<I>) -> Result<(), X>,
    ) -> Result<(), X> {
        for part in plan {
            let source = &sources[part.source];
            let conditions: Vec<&Condition> = part.conditions().collect();
            let mut work = self.start_source(source, &conditions);
            for TrialGroup { condition, trials } in part.groups {
                let result = self.make_group(&mut work, condition.as_ref(), source, missing);
                let (images, notes, problem) = match result {
                    Ok((images, notes)) => (images, notes, None),
                    Err(problem) => (Vec::new(), ImageNotes::default(), Some(problem)),
                };
                take(PreparedGroup { stimulus: Stimulus { condition, images }, trials, problem, notes })?;
            }
        }
        Ok(())
    }

    fn start_source(&mut self, source: &Source, conditions: &[&Condition]) -> SourceWork<'a> {
        match &source.frames[..] {
            // A walk may show its only frame several times.
            [frame] if source.order.len() == 1 => {
                SourceWork::Frame(Box::new(FrameWork::for_source(self.steps, source, frame)))
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

    /// Makes the images of a group in the order shown, with the missing notes; none without a condition. Several images
    /// share one thumbnail, and their fidelity is not measured.
    fn make_group(
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
                let shown = work.size().map(|size| ShownObjects { size, objects: missing.objects(name) });
                let (image, notes) = self.image_and_notes(work, condition, name, shown, wanted)?;
                Ok((vec![image], notes))
            }
            SourceWork::Walk(images) => {
                let images = images.remove(condition).unwrap_or_default();
                let thumbnail = wanted
                    .thumbnail
                    .then(|| thumbnail_of_all(name, condition, &images))
                    .and_then(|made| ok_or_warn(name, condition, made).flatten());
                let notes = ImageNotes { thumbnail, fidelity: None };
                Ok((images, notes))
            }
            SourceWork::Failed(Error::EnhancerEnded { path, problem }) => {
                let (path, problem) = (path.clone(), problem.clone());
                Err(Error::EnhancerEnded { path, problem })
            }
            SourceWork::Failed(problem) => Err(Error::data(condition, problem)),
        }
    }

    /// Makes the images of a source: one list per condition, in the order shown.
    ///
    /// # Errors
    /// If the source cannot be shown, or one of its images cannot be made.
    pub fn images(&mut self, source: &Source, conditions: &[&Condition]) -> Result<Vec<Vec<Arc<Payload>>>> {
        if let Some(problem) = &source.problem {
            return Err(Error::data(&source.name, problem));
        }
        let mut images = vec![Vec::with_capacity(source.frames.len()); conditions.len()];
        let steps = self.steps;
        // One frame per thread at a time, because a frame in full size takes much memory.
        for frames in source.frames.chunks(rayon::current_num_threads()) {
            let staged = frames
                .par_iter()
                .map(|frame| {
                    let mut work = FrameWork::for_source(steps, source, frame);
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
                    images.push(self.finish(staged, &frame.id, condition)?.payload);
                }
            }
        }
        Ok(images
            .into_iter()
            .map(|images| source.order.iter().map(|index| Arc::clone(&images[*index])).collect())
            .collect())
    }

    /// Makes the image of a frame in a condition as it is sent, with the facts that are needed.
    pub fn image<'w>(
        &mut self,
        work: &mut FrameWork<'w>,
        condition: &Condition,
        needed: Needed,
    ) -> Result<PreparedImage<'w>> {
        let staged = work.stage(condition, needed)?;
        self.finish(staged, work.frame(), condition)
    }

    /// Makes the pixels of a frame in a condition, in the size of the frame.
    pub fn pixels(&mut self, work: &mut FrameWork<'_>, condition: &Condition) -> Result<Arc<Rgb>> {
        let Resolved { work, condition, .. } = work.resolve(condition)?;
        let degraded = Arc::clone(work.degraded(condition.degradation())?);
        match &condition.enhancer {
            None => Ok(degraded),
            Some(name) => {
                let enhanced = self.enhance(&degraded, name, work.frame(), &condition)?;
                Ok(Arc::new(enhanced.0))
            }
        }
    }

    /// Applies the enhancer to a staged image that needs it.
    fn finish<'w>(
        &mut self,
        staged: StagedImage<'w>,
        frame: &FrameId,
        condition: &Condition,
    ) -> Result<PreparedImage<'w>> {
        match staged {
            StagedImage::Ready(image) => Ok(image),
            StagedImage::Stored { image, enhancer, notes } => {
                self.judge_stored_image(&notes, &enhancer, [frame, condition])?;
                Ok(image)
            }
            StagedImage::ToEnhance { degraded, enhancer, mut finish } => {
                let started = Instant::now();
                let (image, used) = self.enhance(&degraded, &enhancer, frame, condition)?;
                finish.took += started.elapsed();
                finish.image(&Arc::new(image), Some(used))
            }
        }
    }

    /// Adds a stored image to the usage of its enhancer, as if it had been enhanced now.
    fn judge_stored_image(
        &mut self,
        notes: &StoredNotes,
        name: &EnhancerName,
        place: [&dyn ToString; 2],
    ) -> Result<()> {
        let implausible = self.implausible;
        let Some(used) = &notes.enhanced else {
            return Ok(());
        };
        if let Some(images) = self.steps.recipe.enhanced_images(name) {
            return used.record_external(images.usage(), images.folder(), place, implausible);
        }
        match self.lazy_enhancer(name) {
            Some(lazy) => used.record(lazy.usage(), lazy.path(), place, implausible),
            None => self.enhancer(name)?.judge_stored(used, place, implausible),
        }
    }

    /// Enhances the image of a frame in a condition. Both names appear in the message about an implausible result.
    fn enhance(
        &mut self,
        image: &Rgb,
        name: &EnhancerName,
        frame: &FrameId,
        condition: &Condition,
    ) -> Result<(Rgb, ImageUse)> {
        let (timings, implausible) = (self.steps.timings, self.implausible);
        if let Some(images) = self.steps.recipe.enhanced_images(name) {
            return timings.time(TimedStep::Decode, || images.image(image, frame, condition, implausible));
        }
        let place: [&dyn ToString; 2] = [frame, condition];
        if let Some(lazy) = self.lazy_enhancer(name) {
            return timings.time(TimedStep::Enhance, || lazy.enhance_and_judge(image, place, implausible));
        }
        let enhancer = self.enhancer(name)?;
        timings.time(TimedStep::Enhance, || enhancer.enhance_and_judge(image, place, implausible))
    }

    fn lazy_enhancer(&self, name: &EnhancerName) -> Option<&LazyEnhancer> {
        self.lazy.iter().map(Arc::as_ref).find(|enhancer| enhancer.name() == name)
    }

    fn enhancer(&mut self, name: &EnhancerName) -> Result<&mut Enhancer> {
        self.enhancers
            .iter_mut()
            .find(|enhancer| enhancer.name() == name)
            .ok_or_else(|| Error::data(name, "this enhancer is not open"))
    }
}

/// True if there are at least two frames per worker, and no walks.
fn has_frames_for_all_workers<I>(sources: &[Source], plan: &[SourcePlan<I>], workers: usize) -> bool {
    plan.len() >= 2 * workers && plan.iter().all(|part| sources[part.source].frames.len() < 2)
}

/// Returns the thumbnail; if it could not be made, warns and returns `None`, so that a trial never fails because of the
/// report.
fn ok_or_warn<T>(name: &FrameId, condition: &Condition, made: Result<T>) -> Option<T> {
    made.inspect_err(|problem| {
        tracing::warn!("the report has no thumbnail of {name} at {condition}: {problem}");
    })
    .ok()
}

impl ImagePipeline<'_> {
    /// Makes the image of a frame in a condition as it is sent, with the wanted notes. `objects` are cropped for the
    /// thumbnail.
    fn image_and_notes(
        &mut self,
        work: &mut FrameWork<'_>,
        condition: &Condition,
        name: &FrameId,
        objects: Option<ShownObjects<'_>>,
        wanted: WantedNotes,
    ) -> Result<(Arc<Payload>, ImageNotes)> {
        let needed = if wanted.fidelity { Needed::Similarity } else { Needed::Image };
        let image = self.image(work, condition, needed)?;
        let similarity = image.similarity.filter(|_| wanted.fidelity);
        let thumbnail =
            if wanted.thumbnail { stored_or_new_thumbnail(work, condition, name, objects, &image)? } else { None };
        let notes = ImageNotes {
            thumbnail,
            fidelity: similarity.map(|found| fidelity(name, condition, &image.payload, found)),
        };
        Ok((image.payload, notes))
    }
}

/// The thumbnail of an image, from the store if possible; `None` with a warning if it cannot be made.
///
/// # Errors
/// If the frame cannot be decoded.
fn stored_or_new_thumbnail(
    work: &mut FrameWork<'_>,
    condition: &Condition,
    name: &FrameId,
    objects: Option<ShownObjects<'_>>,
    image: &PreparedImage<'_>,
) -> Result<Option<Thumbnail>> {
    let timings = work.steps.timings;
    let payload = &image.payload;
    // A store key does not contain how dark a photograph is, and the gain of the crops depends on that.
    let place = image
        .place
        .as_ref()
        .filter(|_| payload.facts().pair.is_none())
        .and_then(|place| place.thumbnail(name, condition, objects));
    let stored =
        place.as_ref().and_then(|place| timings.time(TimedStep::Decode, || place.read(payload.facts().digest)));
    if stored.is_some() {
        return Ok(stored);
    }
    let started = Instant::now();
    let encoded: Option<Arc<Rgb>> = match &image.pixels {
        PixelsSent::Encoded(pixels) => Some(Arc::clone(pixels)),
        PixelsSent::InFrameFile => Some(Arc::clone(work.resolve(condition)?.work.clean()?)),
        PixelsSent::Stored => None,
    };
    let made = timings.time(TimedStep::Encode, || thumbnail(name, condition, payload, encoded.as_deref(), objects));
    let made = ok_or_warn(name, condition, made);
    if let (Some(place), Some(made)) = (place, &made) {
        place.write(made, started.elapsed().as_millis() as u64);
    }
    Ok(made)
}
