//! The engine of everything that is asked: [`Job`] carries out an [`Experiment`].
//!
//! It opens the run folder, plans phase by phase what is left to ask, has the image pipeline make the images, asks about them, keeps
//! every reply the moment it arrives, and has the experiment score what is there. What differs between questions with choices and
//! open ones is in their [`Experiment`]; money, resuming, batches, shards and images are here, once.

pub(crate) mod batch;
pub mod bilinear;
pub(crate) mod budget;
mod circuit_breaker;
pub(crate) mod conditions;
mod dispatch;
pub(crate) mod enhancers;
mod estimate;
pub(crate) mod experiment;
mod folder;
pub(crate) mod frame_work;
pub(crate) mod identity;
pub(crate) mod image_pipeline;
pub(crate) mod interrupt;
mod manifest;
pub mod merge;
pub(crate) mod models;
pub(crate) mod observer;
pub(crate) mod plan;
pub(crate) mod predictions;
pub mod progress;
pub(crate) mod questions;
mod questions_by_rule;
pub(crate) mod rebuild;
pub(crate) mod recipe;
pub mod report;
pub(crate) mod shard;
pub(crate) mod source;
pub(crate) mod stored;
pub(crate) mod thumbnail;
pub(crate) mod timings;
pub(crate) mod trial;
pub(crate) mod walk;
pub(crate) mod workers;

use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::time::Instant;

use crate::ask::ImageLimit;
use crate::config::{Ask, BatchFiles, Images, Mode};
use crate::enhance::{Enhancer, ModelFile};
use crate::error::Result;
use crate::report::forecast::{json, money, render};
use crate::store::{self, Store};
use crate::types::manifest::{Counts, RunManifest, Status};
use crate::types::{Detail as _, Record, Thumbnail, TrialKey};

use budget::Budget;
use circuit_breaker::EndReason;
use dispatch::{Dispatcher, Tally};
use enhancers::OpenEnhancers;
use experiment::{DetailOf, Experiment, RecordOf};
use frame_work::Steps;
use image_pipeline::ImagePipeline;
use plan::Plan;
use progress::Progress;
use thumbnail::Wanted;
use timings::Timings;
use workers::Workers;

pub(crate) use folder::now;
pub(crate) use manifest::count;

/// How a command ended.
#[derive(Debug)]
pub struct Outcome {
    /// How far it came.
    pub status: Status,
    /// What belongs on standard output.
    pub output: String,
}

/// An experiment that is carried out in a run folder.
pub(crate) struct Job<'a, E: Experiment> {
    experiment: &'a E,
    /// The enhancement models, not yet loaded.
    files: Vec<ModelFile>,
    /// Where the run lies, or will.
    folder: PathBuf,
    progress: &'a Progress,
}

impl<'a, E: Experiment> Job<'a, E> {
    /// Finds the folder of the run; nothing is written.
    pub(crate) fn new(
        experiment: &'a E,
        files: Vec<ModelFile>,
        progress: &'a Progress,
    ) -> Result<Self> {
        Ok(Self {
            folder: folder::find(experiment)?,
            experiment,
            files,
            progress,
        })
    }

    /// Asks what is left, or says what that would take.
    ///
    /// # Errors
    /// If nothing can be asked, or no further trial could succeed; what had arrived by then is kept.
    pub(crate) fn run(self) -> Result<Outcome> {
        match self.experiment.settings().mode {
            Mode::DryRun => self.estimate(),
            Mode::Run => self.open()?.ask(),
        }
    }

    /// Writes what is left to ask as files of a Batch API, and notes their trials in the run as sent.
    ///
    /// # Errors
    /// If a model is built in, an image is larger than the endpoint takes, or a file cannot be written.
    pub(crate) fn export_batch(self, files: &BatchFiles) -> Result<Outcome> {
        batch::export::export(self.open()?, files)
    }

    /// Says what is left to ask and what it would take; sends nothing and leaves no file.
    fn estimate(self) -> Result<Outcome> {
        let experiment = self.experiment;
        let settings = experiment.settings();
        let stored: Vec<RecordOf<E>> = store::read_records(&self.folder)?;
        let answered = answered(&stored);
        let mut plans = Vec::new();
        for phase in 0..E::PHASES.len() {
            let mut plan = Plan::new(experiment.plan(phase, &stored)?);
            plan.leave_out(|key| answered.contains(key));
            plans.push(plan);
        }
        let timings = Timings::default();
        let enhancers = OpenEnhancers::load(self.files, &settings.enhancement)?;
        let mut pipeline = pipeline(experiment, enhancers.enhancers, None, &timings);
        let forecast = estimate::estimate(experiment, &plans, &stored, &mut pipeline)?;
        Ok(Outcome {
            status: Status::Complete,
            output: match settings.output.show {
                crate::config::Show::Json => json(&forecast)?,
                crate::config::Show::Table => render(&forecast),
            },
        })
    }

    /// Opens the run folder.
    fn open(self) -> Result<OpenRun<'a, E>> {
        let Self {
            experiment,
            files,
            folder,
            progress,
        } = self;
        let settings = experiment.settings();
        let kept = store::read_manifest(&folder, DetailOf::<E>::SCHEMA)?;
        let complete = kept
            .as_ref()
            .is_some_and(|kept| kept.status == Status::Complete);
        // Opened before the folder is made, so that an enhancer that does not work leaves nothing behind.
        let enhancers = OpenEnhancers::new(files, &settings.enhancement, complete)?;
        let manifest = manifest::of(experiment, kept);
        let mut store = Store::open(&folder, &manifest, folder::moved(&settings.output))?;
        store.add_questions(experiment.questions())?;
        let there: HashSet<TrialKey> = if experiment.given().is_empty() {
            HashSet::new()
        } else {
            store.records()?.iter().map(|record| record.key).collect()
        };
        for record in experiment.given() {
            if !there.contains(&record.key) {
                store.append(record)?;
            }
        }
        Ok(OpenRun {
            experiment,
            progress,
            enhancers,
            store,
            manifest,
            keys: HashSet::new(),
        })
    }
}

/// A run folder that this process alone writes to.
pub(crate) struct OpenRun<'a, E: Experiment> {
    experiment: &'a E,
    progress: &'a Progress,
    enhancers: OpenEnhancers<'a>,
    store: Store<DetailOf<E>>,
    manifest: RunManifest,
    /// Every trial planned so far.
    keys: HashSet<TrialKey>,
}

/// What is left of a phase.
struct Left<E: Experiment> {
    plan: Plan<E::Item>,
    stored: Vec<RecordOf<E>>,
    /// How many trials wait for a batch.
    out: usize,
}

impl<E: Experiment> OpenRun<'_, E> {
    /// Asks what is left, phase by phase.
    fn ask(mut self) -> Result<Outcome> {
        let mut end = EndReason::AllAsked;
        for phase in 0..E::PHASES.len() {
            let left = self.left(phase)?;
            self.warn_of_batches(left.out);
            if left.plan.left() == 0 {
                continue;
            }
            match self.ask_phase(phase, left)? {
                EndReason::AllAsked => {}
                // What the other models have answered goes on.
                EndReason::ModelStopped(error) => end = EndReason::ModelStopped(error),
                over => {
                    end = over;
                    break;
                }
            }
        }
        let settings = self.experiment.settings();
        if let (EndReason::OverBudget, Some(most)) = (&end, settings.money.most) {
            tracing::warn!(
                "stopped: one more question could cost more than the {} of --max-cost; the same command with more goes on",
                money(most)
            );
        }
        for phase in 0..E::PHASES.len() {
            let adapted = models::adapted(self.experiment.models(phase));
            self.manifest.settings.extend(adapted);
        }
        self.finish(end)
    }

    /// What of a phase has no reply and waits for none.
    fn left(&mut self, phase: usize) -> Result<Left<E>> {
        let stored = self.store.records()?;
        let mut plan = Plan::new(self.experiment.plan(phase, &stored)?);
        self.keys.extend(&plan.keys);
        let answered = answered(&stored);
        plan.leave_out(|key| answered.contains(key));
        let sent = self.store.out_in_batches()?;
        let out = plan.leave_out(|key| sent.contains(key));
        Ok(Left { plan, stored, out })
    }

    /// Says what a Batch API has been asked and has not answered: asked here, it would be paid for twice.
    fn warn_of_batches(&self, out: usize) {
        if out > 0 {
            tracing::warn!(
                "{out} trials are out in a batch and are not asked here; take their replies over by batch import, or delete {} to \
                 have them asked",
                self.store.folder().join(store::BATCH).display()
            );
        }
    }

    fn ask_phase(&mut self, phase: usize, left: Left<E>) -> Result<EndReason> {
        let Left { plan, stored, .. } = left;
        let experiment = self.experiment;
        let settings = experiment.settings();
        let models = experiment.models(phase);
        let budget = Budget::new(&settings.money, models, &stored)?;
        drop(stored);
        let tally = Tally {
            trials: plan.keys.len(),
            answered: plan.keys.len() - plan.left(),
        };
        let shown = !plan.conditions().is_empty();
        let enhancers = if shown {
            self.enhancers.take()?
        } else {
            Vec::new()
        };
        self.begin(phase, tally)?;
        let workers = Workers::start(settings.enhancement.threads)?;
        let timings = Timings::default();
        let limit = limit(&settings.ask, &settings.images);
        let stoppers = enhancers.iter().map(Enhancer::stopper).collect();
        let mut pipeline = pipeline(experiment, enhancers, limit, &timings);
        workers
            .all
            .install(|| pipeline.check(experiment.sources(), &plan.sources))?;
        let dispatcher = Dispatcher {
            models,
            progress: self.progress,
            pace: &settings.pace,
            timings: &timings,
        };
        let wanted = wanted(experiment, self.store.folder())?;
        let started = Instant::now();
        let sources = experiment.sources();
        let end = dispatcher.run(tally, budget, &mut self.store, stoppers, |out| {
            pipeline.develop(sources, plan.sources, &wanted, &workers, out);
        })?;
        if settings.show_timings {
            let threads = workers.each.len();
            self.progress
                .note(&timings.told(started.elapsed(), threads));
        }
        Ok(end)
    }

    /// Notes how much there is to ask, so that a killed run says it, and how much of it is there.
    fn begin(&mut self, phase: usize, tally: Tally) -> Result<()> {
        let Tally { trials, answered } = tally;
        self.manifest.platform.extend(self.enhancers.version());
        if phase == 0 {
            self.manifest.counts = Counts {
                trials,
                answered,
                failed: 0,
            };
        }
        self.store.write_manifest(&self.manifest)?;
        if answered > 0 {
            self.progress.say(&format!(
                "{}: {answered} of {trials} trials are answered already",
                self.store.folder().display()
            ));
        }
        Ok(())
    }

    /// Scores what the run holds, and leaves the report in its folder.
    fn finish(mut self, end: EndReason) -> Result<Outcome> {
        let stored = self.store.records()?;
        self.keys.extend(stored.iter().map(|record| record.key));
        let counts = count(self.keys.len(), &stored);
        drop(stored);
        let status = end.status(counts);
        if (status, counts) != (self.manifest.status, self.manifest.counts) {
            (self.manifest.status, self.manifest.counts) = (status, counts);
            self.manifest.updated = now();
        }
        let show = self.experiment.settings().output.show;
        let output = self
            .experiment
            .report(&self.store, &mut self.manifest, show)?;
        if let EndReason::Stopped(error) | EndReason::ModelStopped(error) = end {
            return Err(error);
        }
        Ok(Outcome {
            status: self.manifest.status,
            output,
        })
    }
}

/// The image pipeline of an experiment.
pub(crate) fn pipeline<'a, E: Experiment>(
    experiment: &'a E,
    enhancers: Vec<Enhancer>,
    limit: Option<ImageLimit>,
    timings: &'a Timings,
) -> ImagePipeline<'a> {
    ImagePipeline {
        steps: Steps {
            frames: experiment.frames(),
            recipe: experiment.recipe(),
            limit,
            timings,
        },
        enhancers,
    }
}

/// The largest image that the endpoint takes; `None` if all models are built in.
pub(crate) fn limit(ask: &Ask, images: &Images) -> Option<ImageLimit> {
    let server = ask.server.as_ref()?;
    let known = || ImageLimit::of(&server.access.base);
    Some(images.largest.map_or_else(known, ImageLimit::stated))
}

/// The small copies of images that a run has yet to keep.
fn wanted<E: Experiment>(experiment: &E, folder: &Path) -> Result<Wanted> {
    let kept: Vec<Thumbnail> = store::read_thumbnails(folder)?;
    let names = experiment.sources().iter().map(|source| &source.name);
    Ok(Wanted::new(names, kept))
}

/// The trials that have a reply.
fn answered<D>(stored: &[Record<D>]) -> HashSet<TrialKey> {
    let answered = stored.iter().filter(|record| !record.failed());
    answered.map(|record| record.key).collect()
}
