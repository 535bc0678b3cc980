//! A run under way: [`OpenRun`].

use std::collections::HashSet;
use std::path::Path;
use std::time::Instant;

use super::budget::Budget;
use super::circuit_breaker::EndReason;
use super::dispatch::{Dispatcher, TrialCounts};
use super::enhancers::OpenEnhancers;
use super::experiment::{DetailOf, Experiment, RecordOf};
use super::folder::now;
use super::frame_work::ImageSteps;
use super::image_pipeline::ImagePipeline;
use super::manifest;
use super::models;
use super::outcome::Outcome;
use super::plan::Plan;
use super::progress::Progress;
use super::settings::JobSettings;
use super::stored::StoredRun;
use super::thumbnail::MissingThumbnails;
use super::timings::Timings;
use super::workers::Workers;
use crate::ask::ImageLimit;
use crate::enhance::Enhancer;
use crate::error::Result;
use crate::report::forecast::money;
use crate::store::{self, Store};
use crate::types::manifest::{Counts, RunManifest};
use crate::types::{Record, Thumbnail, TrialKey};

/// A run folder that this process alone writes to.
pub(crate) struct OpenRun<'a, E: Experiment> {
    pub(super) experiment: &'a E,
    pub(super) progress: &'a Progress,
    pub(super) enhancers: OpenEnhancers<'a>,
    pub(super) store: Store<DetailOf<E>>,
    pub(super) manifest: RunManifest,
    /// Every trial planned so far.
    pub(super) keys: HashSet<TrialKey>,
}

/// What is left of a phase.
pub(super) struct Remaining<E: Experiment> {
    pub(super) plan: Plan<E::Item>,
    pub(super) stored: Vec<RecordOf<E>>,
    /// How many trials wait for a batch.
    pub(super) out: usize,
}

impl<E: Experiment> OpenRun<'_, E> {
    /// Asks what is left, phase by phase.
    pub(super) fn ask(mut self) -> Result<Outcome> {
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
    pub(super) fn left(&mut self, phase: usize) -> Result<Remaining<E>> {
        let stored = self.store.records()?;
        let mut plan = Plan::new(self.experiment.plan(phase, &stored)?);
        self.keys.extend(&plan.keys);
        let answered = answered(&stored);
        plan.leave_out(|key| answered.contains(key));
        let sent = self.store.pending_in_batches()?;
        let out = plan.leave_out(|key| sent.contains(key));
        Ok(Remaining { plan, stored, out })
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

    fn ask_phase(&mut self, phase: usize, left: Remaining<E>) -> Result<EndReason> {
        let Remaining { plan, stored, .. } = left;
        let experiment = self.experiment;
        let settings = experiment.settings();
        let models = experiment.models(phase);
        let budget = Budget::new(&settings.money, models, &stored)?;
        let tally = TrialCounts {
            trials: plan.keys.len(),
            answered: plan.keys.len() - plan.left(),
        };
        let shown = !plan.conditions().is_empty();
        let enhancers = if shown {
            self.enhancers.take()?
        } else {
            Vec::new()
        };
        self.begin(tally, &stored)?;
        drop(stored);
        let workers = Workers::start(settings.loading.threads.threads)?;
        let timings = Timings::default();
        let limit = limit(settings);
        let stoppers = enhancers.iter().map(Enhancer::stopper).collect();
        let mut pipeline = pipeline(experiment, enhancers, limit, &timings);
        workers
            .all
            .install(|| pipeline.check(experiment.sources(), &plan.sources))?;
        let dispatcher = Dispatcher {
            models,
            progress: self.progress,
            settings,
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
            let line = timings.told(started.elapsed(), threads);
            let line = match E::PHASES {
                [_] => line,
                phases => format!("{}: {line}", phases[phase]),
            };
            self.progress.note(&line);
        }
        Ok(end)
    }

    /// Notes in the manifest how many trials there are, so that a killed run says it.
    pub(super) fn note_counts(&mut self, stored: &[RecordOf<E>]) -> Result<()> {
        self.manifest.counts = Counts {
            failed: 0,
            ..self.counts(stored)
        };
        self.store.write_manifest(&self.manifest)
    }

    /// Notes how much there is to ask, and says how much of it is there.
    fn begin(&mut self, tally: TrialCounts, stored: &[RecordOf<E>]) -> Result<()> {
        let TrialCounts { trials, answered } = tally;
        manifest::go_on(self.experiment, &mut self.manifest);
        self.manifest.platform.extend(self.enhancers.version());
        self.note_counts(stored)?;
        if answered > 0 {
            self.progress.say(&format!(
                "{}: {answered} of {trials} trials are answered already",
                self.store.folder().display()
            ));
        }
        Ok(())
    }

    /// How many trials the run has: those planned, and those that were answered under an earlier command. A trial that failed and is
    /// planned no more, because its images are others by now, does not count.
    fn counts(&self, stored: &[RecordOf<E>]) -> Counts {
        let (mut keys, mut failed) = (self.keys.clone(), 0);
        for record in stored {
            if !record.failed() {
                keys.insert(record.key);
            } else if keys.contains(&record.key) {
                failed += 1;
            }
        }
        Counts {
            trials: keys.len(),
            answered: stored.iter().filter(|record| !record.failed()).count(),
            failed,
        }
    }

    /// Scores what the run holds, and leaves the report in its folder.
    fn finish(self, end: EndReason) -> Result<Outcome> {
        let mut run = StoredRun::of(self.store.folder(), self.manifest.clone())?;
        let counts = self.counts(&run.records);
        let status = end.status(counts);
        let manifest = &mut run.manifest;
        if (status, counts) != (manifest.status, manifest.counts) {
            (manifest.status, manifest.counts) = (status, counts);
            manifest.updated = now();
        }
        let show = self.experiment.settings().show;
        let outcome = self.experiment.report(&self.store, run, show)?;
        match end {
            EndReason::Stopped(error) | EndReason::ModelStopped(error) => Err(error),
            _ => Ok(outcome),
        }
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
        steps: ImageSteps {
            frames: experiment.frames(),
            recipe: experiment.recipe(),
            limit,
            timings,
        },
        enhancers,
    }
}

/// The largest image that the endpoint takes; `None` if all models are built in.
pub(crate) fn limit(settings: &JobSettings) -> Option<ImageLimit> {
    let server = settings.ask.server.as_ref()?;
    let known = || ImageLimit::of(&server.access.base);
    Some(settings.max_image.map_or_else(known, ImageLimit::stated))
}

/// The small copies of images that a run has yet to keep.
pub(super) fn wanted<E: Experiment>(experiment: &E, folder: &Path) -> Result<MissingThumbnails> {
    let kept: Vec<Thumbnail> = store::read_thumbnails(folder)?;
    let names = experiment.sources().iter().map(|source| &source.name);
    Ok(MissingThumbnails::new(names, kept))
}

/// The trials that have a reply.
pub(super) fn answered<D>(stored: &[Record<D>]) -> HashSet<TrialKey> {
    let answered = stored.iter().filter(|record| !record.failed());
    answered.map(|record| record.key).collect()
}
