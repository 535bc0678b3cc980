//! Where walks are made ready to be shown: [`Theatre`], one thread that goes from walk to walk.
//!
//! The frames of a walk are decoded, darkened, mended, scaled and encoded once for all questions about it, several at a time.
//! A walk is handed out as a whole before the next is begun, and the channel is bounded: memory holds the requests of two walks,
//! whatever the number of walks.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Instant;

use rayon::prelude::*;
use tokio::sync::mpsc::Sender;

use super::episode::{Episode, Still, picture};
use super::item::Open;
use super::plan::{Plan, Shot, WalkPlan};
use super::stage::Stage;
use crate::ask::bilinear::bilinear;
use crate::ask::{ImageLimit, Payload};
use crate::config::{CameraOf, Darkened, OpenEqa, Walk};
use crate::enhance::Enhancer;
use crate::error::{Error, Result};
use crate::run::limit;
use crate::run::recipe::Recipe;
use crate::run::thumbnail::{Wanted, thumbnail};
use crate::run::trial::{Exposed, Slide};
use crate::synthesis::{Film, NoiseKey};
use crate::types::{Condition, FrameId, ImageFacts, Rgb};

/// What the thread works with.
pub(super) struct Theatre<'a> {
    episodes: &'a [Episode],
    walk: &'a Walk,
    recipe: &'a Recipe,
    enhancers: Vec<Enhancer>,
    /// What an image may be; `None` where nobody far away looks at it.
    limit: Option<ImageLimit>,
}

/// The images of a walk in each condition, in the order in which they are shown.
pub(super) type Shown = BTreeMap<Condition, Vec<Arc<Payload>>>;

/// A frame in one condition: as it is sent, or still to be mended.
enum Print {
    Ready(Arc<Payload>),
    Dark(Rgb),
}

/// An image that was made to know its size and time.
pub(super) struct Sample {
    pub(super) condition: Condition,
    pub(super) facts: ImageFacts,
    pub(super) seconds: f64,
}

impl<'a> Theatre<'a> {
    pub(super) fn new(config: &'a OpenEqa, stage: &'a Stage<'_>, enhancers: Vec<Enhancer>) -> Self {
        Self {
            episodes: &stage.episodes,
            walk: stage.walk,
            recipe: &stage.recipe,
            enhancers,
            limit: limit(&config.ask, &config.images),
        }
    }

    /// Makes the middle frame of the first of these walks that can be shown, in every condition: what would stop a run halfway is
    /// found before anything is paid for, and it is known how large images are.
    pub(super) fn sample(&mut self, walks: &[WalkPlan]) -> Result<Vec<Sample>> {
        let first = walks.iter().find_map(|walk| {
            let episode = &self.episodes[walk.episode];
            let reel = episode.reel.as_ref().ok()?;
            let conditions: Vec<&Condition> = Plan::conditions(walk).into_iter().collect();
            let still = reel.stills.get(reel.stills.len() / 2)?;
            (!conditions.is_empty()).then_some((&*episode.name, still, conditions))
        });
        let Some((walk, still, conditions)) = first else {
            return Ok(Vec::new());
        };
        let mut samples = Vec::new();
        for condition in conditions {
            let started = Instant::now();
            let prints = self.prints(walk, still, &[condition])?;
            for payload in self.finish(prints, &[condition])? {
                samples.push(Sample {
                    condition: condition.clone(),
                    facts: payload.facts().clone(),
                    seconds: started.elapsed().as_secs_f64(),
                });
            }
        }
        Ok(samples)
    }

    /// Makes walk after walk until all are done or nobody waits for them any more.
    pub(super) fn show(
        mut self,
        walks: Vec<WalkPlan>,
        wanted: &Wanted,
        out: &Sender<Exposed<Open>>,
    ) {
        for walk in walks {
            let conditions: Vec<&Condition> = Plan::conditions(&walk).into_iter().collect();
            let made = self.walk(walk.episode, &conditions);
            let (mut shown, problem) = match made {
                Ok(shown) => (shown, None),
                Err(problem) => (Shown::new(), Some(problem.to_string())),
            };
            for Shot { condition, trials } in walk.shots {
                let images = condition
                    .as_ref()
                    .and_then(|condition| shown.remove(condition));
                let images = images.unwrap_or_default();
                // Who is shown nothing is asked all the same.
                let problem = problem.as_ref().filter(|_| condition.is_some());
                let frame = FrameId(self.episodes[walk.episode].name.clone());
                let thumbnail = match (&condition, images.get(images.len() / 2)) {
                    (Some(condition), Some(middle)) if wanted.lacks(&frame, condition) => {
                        thumbnail(&frame, condition, middle, None).map(Some)
                    }
                    _ => Ok(None),
                };
                let exposed = Exposed {
                    slide: Slide { condition, images },
                    trials,
                    problem: problem.cloned(),
                    // A picture for the report is worth no failed answer.
                    thumbnail: thumbnail.unwrap_or_else(|problem| {
                        tracing::warn!("no small copy of {frame} is kept: {problem}");
                        None
                    }),
                };
                if out.blocking_send(exposed).is_err() {
                    return;
                }
            }
        }
    }

    /// The images of a walk in these conditions.
    ///
    /// # Errors
    /// Where it cannot be shown, or one of its frames cannot be made.
    pub(super) fn walk(&mut self, episode: usize, conditions: &[&Condition]) -> Result<Shown> {
        let Episode { name, reel } = &self.episodes[episode];
        let mut shown = Shown::new();
        if conditions.is_empty() {
            return Ok(shown);
        }
        let reel = reel
            .as_ref()
            .map_err(|problem| Error::data(name, problem))?;
        let mut sent: Vec<Vec<Arc<Payload>>> = Vec::with_capacity(reel.stills.len());
        // As many at a time as there are cores: each holds a frame in its own size.
        for stills in reel.stills.chunks(rayon::current_num_threads()) {
            let prints = stills
                .par_iter()
                .map(|still| self.prints(name, still, conditions));
            let prints: Vec<Vec<Print>> = prints.collect::<Result<_>>()?;
            for prints in prints {
                sent.push(self.finish(prints, conditions)?);
            }
        }
        for (index, condition) in conditions.iter().enumerate() {
            let images = reel
                .order
                .iter()
                .map(|place| Arc::clone(&sent[*place][index]));
            shown.insert((*condition).clone(), images.collect());
        }
        Ok(shown)
    }

    /// A frame in every condition, as far as it comes without an enhancer.
    fn prints(&self, walk: &str, still: &Still, conditions: &[&Condition]) -> Result<Vec<Print>> {
        let mut clean = picture(&still.path, self.walk.most_pixels)?.decode()?;
        if self.walk.darkened == Darkened::Resized {
            clean = self.scaled(clean)?;
        }
        let key = self.key(walk, still);
        let mut film = Film::default();
        let print = |condition: &&Condition| {
            let synthesis = &self.recipe.synthesis;
            let image = film.degrade(&clean, condition.degradation, &key, synthesis);
            match condition.enhancer {
                None => self.sent(image).map(Print::Ready),
                Some(_) => Ok(Print::Dark(image)),
            }
        };
        conditions.iter().map(print).collect()
    }

    /// The prints as they are sent.
    fn finish(
        &mut self,
        prints: Vec<Print>,
        conditions: &[&Condition],
    ) -> Result<Vec<Arc<Payload>>> {
        let mut sent = Vec::with_capacity(prints.len());
        for (print, condition) in prints.into_iter().zip(conditions) {
            sent.push(match print {
                Print::Ready(payload) => payload,
                Print::Dark(dark) => {
                    let mended = self.enhancer(condition)?.enhance(&dark)?;
                    self.sent(mended)?
                }
            });
        }
        Ok(sent)
    }

    fn enhancer(&mut self, condition: &Condition) -> Result<&mut Enhancer> {
        let mut enhancers = self.enhancers.iter_mut();
        enhancers
            .find(|enhancer| Some(enhancer.name()) == condition.enhancer.as_ref())
            .ok_or_else(|| Error::data(condition, "this enhancer is not open"))
    }

    /// What the noise of a frame is drawn from.
    fn key(&self, walk: &str, still: &Still) -> NoiseKey {
        let of = |id: &FrameId| NoiseKey::new(self.recipe.seed, id);
        let own = of(&still.id);
        match self.walk.camera {
            CameraOf::Frame => own,
            CameraOf::Episode => own.taken_on(&of(&FrameId(walk.to_owned()))),
        }
    }

    /// The image as it is sent.
    fn sent(&self, image: Rgb) -> Result<Arc<Payload>> {
        let payload = Payload::encode(&self.scaled(image)?, self.recipe.format, None)?;
        if let Some(limit) = &self.limit {
            limit.check(payload.facts())?;
        }
        Ok(Arc::new(payload))
    }

    /// The image in the size in which it is sent.
    fn scaled(&self, image: Rgb) -> Result<Rgb> {
        match self.walk.side {
            Some(side) if image.height().max(image.width()) != side => bilinear(&image, side),
            _ => Ok(image),
        }
    }
}
