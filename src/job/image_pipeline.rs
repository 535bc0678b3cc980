//! Images as they are sent: [`ImagePipeline`], frame → degrade → enhance → scale → encode, for everything that is asked or written.
//!
//! A source of one frame is handed out condition by condition, a walk as a whole before the next is begun. The channel is bounded, so
//! that memory holds the images in flight, one or two groups more, and the frame that each worker is at.

use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex, PoisonError};

use rayon::prelude::*;
use tokio::sync::mpsc::Sender;

use super::frame_work::{FrameWork, ImageSteps, StagedFrame};
use super::plan::{SourcePlan, TrialGroup};
use super::source::{Source, SourceFrame};
use super::thumbnail::{MissingThumbnails, thumbnail};
use super::timings::TimedStep;
use super::trial::{Item, PreparedGroup, Stimulus};
use super::workers::Workers;
use crate::ask::{ImageLimit, Payload};
use crate::enhance::Enhancer;
use crate::error::{Error, Result};
use crate::types::{Condition, EnhancerName, FrameId, ImageFacts, Rgb, Thumbnail};

/// Images from this size on, in bytes, are more than some servers and proxies take.
const LARGE: usize = 5_000_000;

/// The steps from a frame to an image, with the enhancement models that take part in them.
pub(crate) struct ImagePipeline<'a> {
    pub(crate) steps: ImageSteps<'a>,
    pub(crate) enhancers: Vec<Enhancer>,
}

/// A source being worked on.
enum SourceWork<'a> {
    /// One frame, whose images are made when they are needed.
    Frame(Box<FrameWork<'a>>),
    /// A walk, whose images are all there, by condition.
    Walk(BTreeMap<Condition, Vec<Arc<Payload>>>),
    /// It cannot be shown.
    Unseen(String),
}

impl<'a> ImagePipeline<'a> {
    /// Makes what would stop a run halfway before anything is paid for: the first image of each enhancer and, if images leave the
    /// machine, those of the largest frame without an enhancer. A warning says if these are large and nobody knows whether the
    /// endpoint takes them.
    pub(crate) fn check<I>(&mut self, sources: &[Source], plan: &[SourcePlan<I>]) -> Result<()> {
        self.rehearse(sources, plan)?;
        if let Some(limit) = self.steps.limit {
            warn_of_large(self.largest(sources, plan)?.as_ref(), limit);
        }
        Ok(())
    }

    /// Makes the first image of each enhancer, so that one that does not work is found before anything is asked.
    fn rehearse<I>(&mut self, sources: &[Source], plan: &[SourcePlan<I>]) -> Result<()> {
        let mut tried = BTreeSet::new();
        for part in plan {
            let source = &sources[part.source];
            let Some(frame) = source.middle() else {
                continue;
            };
            for condition in part.conditions() {
                if let Some(name) = &condition.enhancer
                    && tried.insert(name)
                {
                    let mut work = FrameWork::planned(self.steps, source, frame);
                    self.image(&mut work, condition)?;
                }
            }
        }
        Ok(())
    }

    /// Makes the images of the frame with the most pixels in every condition without an enhancer, so that one that is too large
    /// for the endpoint is found before anything is paid for; the largest of them.
    pub(crate) fn largest<I>(
        &mut self,
        sources: &[Source],
        plan: &[SourcePlan<I>],
    ) -> Result<Option<ImageFacts>> {
        let frames = plan.iter().flat_map(|part| {
            let source = &sources[part.source];
            source.frames.iter().map(move |frame| (part, source, frame))
        });
        let pixels = |frame: &SourceFrame| u64::from(frame.size.0) * u64::from(frame.size.1);
        let Some((part, source, frame)) = frames.max_by_key(|(.., frame)| pixels(frame)) else {
            return Ok(None);
        };
        let mut work = FrameWork::planned(self.steps, source, frame);
        let mut largest: Option<ImageFacts> = None;
        for condition in part.conditions().filter(|one| one.enhancer.is_none()) {
            let image = self
                .image(&mut work, condition)
                .map_err(|e| e.at(format!("frame {} at {condition}", frame.id)))?;
            let facts = image.facts();
            if largest
                .as_ref()
                .is_none_or(|known| facts.bytes > known.bytes)
            {
                largest = Some(facts.clone());
            }
        }
        Ok(largest)
    }

    /// Makes the images of all sources until they are done or nobody waits for them any more.
    ///
    /// Each worker has one thread and takes frame after frame. If there is an enhancer, which has threads of its own and takes one
    /// image at a time, or a walk, or if there are few frames, all workers share one source.
    pub(crate) fn develop<I: Item>(
        mut self,
        sources: &[Source],
        plan: Vec<SourcePlan<I>>,
        wanted: &MissingThumbnails,
        workers: &Workers,
        out: &Sender<PreparedGroup<I>>,
    ) {
        let alone = self.enhancers.is_empty()
            && plan.len() >= 2 * workers.each.len()
            && plan
                .iter()
                .all(|part| sources[part.source].frames.len() < 2);
        if !alone {
            return workers
                .all
                .install(|| self.hand_out(sources, plan.into_iter(), wanted, out));
        }
        let steps = self.steps;
        let plan = Mutex::new(plan.into_iter());
        let next = || plan.lock().unwrap_or_else(PoisonError::into_inner).next();
        std::thread::scope(|scope| {
            for worker in &workers.each {
                let mut own = ImagePipeline {
                    steps,
                    enhancers: Vec::new(),
                };
                scope.spawn(move || {
                    worker.install(|| {
                        own.hand_out(sources, std::iter::from_fn(next), wanted, out);
                    });
                });
            }
        });
    }

    fn hand_out<I: Item>(
        &mut self,
        sources: &[Source],
        plan: impl Iterator<Item = SourcePlan<I>>,
        wanted: &MissingThumbnails,
        out: &Sender<PreparedGroup<I>>,
    ) {
        let timings = self.steps.timings;
        // The error is that nobody waits for a group any more.
        let _ = self.one_by_one(sources, plan, wanted, |group| {
            let send = || out.blocking_send(group).is_ok();
            timings
                .time(TimedStep::Waiting, send)
                .then_some(())
                .ok_or(())
        });
    }

    /// Makes the groups of one source after the other, and gives each to `take`.
    ///
    /// # Errors
    /// The first of `take`. An image that cannot be made is noted in its group.
    pub(crate) fn one_by_one<I: Item, X>(
        &mut self,
        sources: &[Source],
        plan: impl Iterator<Item = SourcePlan<I>>,
        wanted: &MissingThumbnails,
        mut take: impl FnMut(PreparedGroup<I>) -> Result<(), X>,
    ) -> Result<(), X> {
        for part in plan {
            let source = &sources[part.source];
            let conditions: Vec<&Condition> = part.conditions().collect();
            let mut work = self.begin(source, &conditions);
            for TrialGroup { condition, trials } in part.groups {
                let made = self.group(&mut work, condition.as_ref(), source, wanted);
                let (images, thumbnail, problem) = match made {
                    Ok((images, thumbnail)) => (images, thumbnail, None),
                    Err(problem) => (Vec::new(), None, Some(problem.to_string())),
                };
                take(PreparedGroup {
                    stimulus: Stimulus { condition, images },
                    trials,
                    problem,
                    thumbnail,
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
                Err(problem) => SourceWork::Unseen(problem.to_string()),
            },
        }
    }

    /// The images of a group, in the order shown, and a small copy of the one in the middle if it is wanted; none if nothing is shown.
    fn group(
        &mut self,
        work: &mut SourceWork<'_>,
        condition: Option<&Condition>,
        source: &Source,
        wanted: &MissingThumbnails,
    ) -> Result<(Vec<Arc<Payload>>, Option<Thumbnail>)> {
        let Some(condition) = condition else {
            return Ok((Vec::new(), None));
        };
        let name = &source.name;
        let wanted = wanted.lacks(name, condition);
        match work {
            SourceWork::Frame(work) => {
                let (image, copy) = self.image_and_copy(work, condition, wanted.then_some(name))?;
                Ok((vec![image], copy))
            }
            SourceWork::Walk(images) => {
                let images = images.remove(condition).unwrap_or_default();
                let middle = images.get(images.len() / 2).filter(|_| wanted);
                let copy = middle.and_then(|middle| small_copy(name, condition, middle, None));
                Ok((images, copy))
            }
            SourceWork::Unseen(problem) => Err(Error::data(condition, problem)),
        }
    }

    /// A frame in a condition, as it is sent, and a small copy of it under this name.
    fn image_and_copy(
        &mut self,
        work: &mut FrameWork<'_>,
        condition: &Condition,
        name: Option<&FrameId>,
    ) -> Result<(Arc<Payload>, Option<Thumbnail>)> {
        let steps = work.steps;
        let copy = |image: &Payload, encoded: &Rgb| {
            let copy = || small_copy(name?, condition, image, Some(encoded));
            steps.timings.time(TimedStep::Encode, copy)
        };
        if let Some(image) = work.as_it_is(condition)? {
            // The file is decoded for its copy alone.
            let copy = match name {
                Some(_) => copy(&image, work.clean()?),
                None => None,
            };
            return Ok((image, copy));
        }
        let pixels = self.pixels(work, condition)?;
        let (image, encoded) = steps.payload(&pixels)?;
        let copy = copy(&image, &encoded);
        Ok((image, copy))
    }

    /// The images of a source in each of these conditions, in the order shown.
    ///
    /// # Errors
    /// If it cannot be shown, or one of its images cannot be made.
    pub(crate) fn images(
        &mut self,
        source: &Source,
        conditions: &[&Condition],
    ) -> Result<Vec<Vec<Arc<Payload>>>> {
        if let Some(problem) = &source.problem {
            return Err(Error::data(&source.name, problem));
        }
        let mut made = vec![Vec::with_capacity(source.frames.len()); conditions.len()];
        let steps = self.steps;
        // As many at a time as there are threads: each holds a frame in its own size.
        for frames in source.frames.chunks(rayon::current_num_threads()) {
            let staged = frames.par_iter().map(|frame| {
                let mut work = FrameWork::planned(steps, source, frame);
                let staged = conditions.iter().map(|condition| work.stage(condition));
                staged.collect::<Result<Vec<StagedFrame>>>()
            });
            for staged in staged.collect::<Result<Vec<_>>>()? {
                for (staged, made) in staged.into_iter().zip(&mut made) {
                    made.push(self.finish(staged)?);
                }
            }
        }
        let shown = |images: Vec<Arc<Payload>>| {
            let order = source.order.iter();
            order.map(|place| Arc::clone(&images[*place])).collect()
        };
        Ok(made.into_iter().map(shown).collect())
    }

    /// A frame in a condition, as it is sent.
    pub(crate) fn image(
        &mut self,
        work: &mut FrameWork<'_>,
        condition: &Condition,
    ) -> Result<Arc<Payload>> {
        let (image, _) = self.image_and_copy(work, condition, None)?;
        Ok(image)
    }

    /// The pixels of a frame in a condition, in the size of the frame.
    pub(crate) fn pixels<'w>(
        &mut self,
        work: &'w mut FrameWork<'_>,
        condition: &Condition,
    ) -> Result<Cow<'w, Rgb>> {
        let degraded = work.degraded(condition.degradation.as_ref())?;
        match &condition.enhancer {
            None => Ok(Cow::Borrowed(degraded)),
            Some(name) => self.enhanced(degraded, name).map(Cow::Owned),
        }
    }

    fn finish(&mut self, staged: StagedFrame) -> Result<Arc<Payload>> {
        match staged {
            StagedFrame::Ready(payload) => Ok(payload),
            StagedFrame::ToEnhance(image, name) => {
                let image = self.enhanced(&image, &name)?;
                Ok(self.steps.payload(&image)?.0)
            }
        }
    }

    fn enhanced(&mut self, image: &Rgb, name: &EnhancerName) -> Result<Rgb> {
        let mut enhancers = self.enhancers.iter_mut();
        let enhancer = enhancers
            .find(|enhancer| enhancer.name() == name)
            .ok_or_else(|| Error::data(name, "this enhancer is not open"))?;
        let enhance = || enhancer.enhance(image);
        self.steps.timings.time(TimedStep::Enhance, enhance)
    }
}

/// A small copy of an image. One that cannot be made is said and left out: a picture for the report is worth no failed answer.
fn small_copy(
    name: &FrameId,
    condition: &Condition,
    image: &Payload,
    encoded: Option<&Rgb>,
) -> Option<Thumbnail> {
    let copy = thumbnail(name, condition, image, encoded);
    copy.inspect_err(|problem| {
        tracing::warn!("no small copy of {name} at {condition} is kept: {problem}");
    })
    .ok()
}

/// Says so if images are large and nobody knows whether the endpoint takes them.
fn warn_of_large(largest: Option<&ImageFacts>, limit: ImageLimit) {
    if let Some(image) = largest
        && image.bytes > LARGE
        && limit == ImageLimit::UNKNOWN
    {
        tracing::warn!(
            "images are up to {:.1} MB, {:.1} MB as sent; where the server answers 413, --max-side or --image jpeg:95 makes them smaller",
            image.bytes as f64 / 1e6,
            image.bytes as f64 / 0.75e6
        );
    }
}

#[cfg(test)]
mod tests;
