//! A run that is open for writing: [`OpenRun`].
//!
//! The source at which a process starts in its plan: [`first_source`].

use std::collections::{BTreeMap, HashSet};
use std::fmt::Write as _;
use std::path::Path;
use std::time::Instant;

use crate::batch::journal::Journal;
use crate::circuit_breaker::EndReason;
use crate::costs::{Budget, InFlightCost, RunModels};
use crate::dispatch::{Dispatcher, TrialCounts};
use crate::experiment::{DetailOf, Experiment};
use crate::image_cache::ImageStore;
use crate::images::enhancement::enhancers::EnhancerModels;
use crate::images::frames::Source;
use crate::images::image_pipeline::ImagePipeline;
use crate::images::notes::MissingNotes;
use crate::images::progress::Progress;
use crate::images::recipes::Maker;
use crate::images::stored::StoredImages;
use crate::images::timings::{ImageSteps, Timings};
use crate::images::trials::Plan;
use crate::images::workers::Workers;
use crate::models::{self, ModelUnderTest};
use crate::reply_checks::ReplyChecks;
use crate::settings::JobSettings;
use crate::stored_keys::{self, lost_for_good, truncated};
use crate::{dark_already, manifest};
use darkqa_ask::{HeldBack, ImageLimit};
use darkqa_base::error::Result;
use darkqa_base::types::manifests::{Counts, PngForm, RunManifest};
use darkqa_base::types::text::{counted, money, plural};
use darkqa_base::types::{Digest, EnhancerName, TrialKey, View};
use darkqa_enhance::{Enhancer, Usage};
use darkqa_runs::missing_thumbnails::MissingThumbnails;
use darkqa_runs::outcome::{Outcome, OverBudget};
use darkqa_runs::record_table;
use darkqa_runs::shard::{Shard, ShardBudget};
use darkqa_runs::shard_records::OtherShards;
use darkqa_runs::stored::StoredRun;
use darkqa_score::answers::MIN_REPLIES;
use darkqa_store::{Store, StoredTrial, now};

/// Share of `--max-cost` below which a cost that no server stated is not mentioned; chosen.
const SMALL_SHARE: f64 = 0.01;

/// Number of trials about undegraded images that each model is asked first, if the run has that many; chosen so that a
/// server that drops every second image is noticed within them.
const UNTOUCHED_FIRST: usize = 128;

/// A run folder that is locked for this process, and the state needed to ask its trials.
pub struct OpenRun<'a, E: Experiment> {
    pub experiment: &'a E,
    pub progress: &'a Progress,
    pub enhancers: EnhancerModels<'a>,
    pub store: Store<DetailOf<E>>,
    /// True if notes about images were lost before this command.
    pub lacks_notes: bool,
    pub manifest: RunManifest,
    /// Keys of all trials planned so far, in all phases.
    pub keys: HashSet<TrialKey>,
    /// The image store; `None` without one.
    pub images: Option<ImageStore>,
    /// Numbers of the stored trials, if this command had none to ask; otherwise `None`.
    pub unasked: Option<Counts>,
}

/// The trials of a phase that still have to be asked.
pub struct Remaining<E: Experiment> {
    pub plan: Plan<E::Item>,
    pub stored: Vec<StoredTrial>,
    /// Number of trials that wait for a batch and are therefore not in `plan`.
    pub in_batch: usize,
}

impl<E: Experiment> OpenRun<'_, E> {
    /// Asks the remaining trials, phase by phase.
    pub fn ask(mut self) -> Result<Outcome> {
        let (mut end, mut stopped) = (EndReason::AllAsked, Vec::new());
        let mut has_asked = false;
        for phase in 0..E::PHASES.len() {
            let mut remaining = self.remaining(phase)?;
            self.warn_of_batches(remaining.in_batch);
            self.add_lost_notes(phase, &mut remaining.plan)?;
            if remaining.plan.sources.is_empty() {
                if !has_asked {
                    let trials = remaining.stored.iter();
                    self.unasked = Some(self.counts(trials.map(|trial| (trial.key, trial.failed()))));
                }
                continue;
            }
            (has_asked, self.unasked) = (true, None);
            match self.ask_phase(phase, remaining)? {
                EndReason::AllAsked => {}
                // The next phases continue with the answers of the other models.
                EndReason::ModelsStopped(errors) => stopped.extend(errors),
                early => {
                    end = early;
                    break;
                }
            }
        }
        if matches!(end, EndReason::AllAsked) && !stopped.is_empty() {
            end = EndReason::ModelsStopped(stopped);
        }
        let settings = self.experiment.settings();
        if let (EndReason::OverBudget, Some(max_cost)) = (&end, settings.money.max_cost) {
            tracing::warn!(
                "stopped: one more question could exceed the {} of --max-cost; the same command with a higher limit continues",
                money(max_cost)
            );
        }
        for phase in 0..E::PHASES.len() {
            let adapted = models::adapted(self.experiment.models(phase));
            self.manifest.settings.extend(adapted);
        }
        models::note_changes(&every_model(self.experiment), &mut self.manifest.settings);
        self.note_cost()?;
        self.finish(end)
    }

    /// Records in the manifest by how much the run exceeded `--max-cost`, and how much a shard has left of its share.
    pub fn note_cost(&mut self) -> Result<()> {
        let settings = self.experiment.settings();
        let Some(limit) = settings.money.max_cost else {
            return Ok(());
        };
        let models = every_model(self.experiment);
        let run_models = RunModels { models: &models, manifest: Some(&self.manifest) };
        let trials = self.store.trials()?;
        let budget = Budget::for_run(&settings.money, &[], run_models, &trials)?;
        let spent = budget.charged();
        let over = (budget.spending().overrun() > 0.0).then(|| OverBudget {
            limit,
            spent,
            longer_replies: longer_replies(&models, &trials),
            dearer_replies: budget.dearer().clone(),
        });
        OverBudget::note(over.as_ref(), &mut self.manifest);
        self.warn_unstated(&budget)?;
        if let Some(over) = over {
            tracing::warn!("{}", over.sentence());
        }
        if settings.shard.is_part() {
            let cost = ShardBudget::new(limit, spent);
            cost.note(&mut self.manifest);
            let shard = settings.shard;
            self.progress.note(&format!("shard {shard}: {}", cost.words()));
        }
        Ok(())
    }

    /// Warns of costs that no server has stated, if they are more than [`SMALL_SHARE`] of `--max-cost`.
    fn warn_unstated(&self, budget: &Budget) -> Result<()> {
        let killed = InFlightCost::open(self.store.folder())?.killed();
        let threshold = SMALL_SHARE * budget.spending().limit().unwrap_or(0.0);
        let (requests, dollars) = budget.unstated();
        if dollars > threshold {
            tracing::warn!(
                "--max-cost: {} without stated tokens may have cost up to {}, and count so",
                counted(requests as usize, "request"),
                money(dollars)
            );
        }
        if killed > threshold {
            tracing::warn!(
                "--max-cost: requests that were in flight when this run was killed may have cost up to {}, and count so (in_flight.json)",
                money(killed)
            );
        }
        Ok(())
    }

    /// The trials of a phase that have no reply and do not wait for a batch. Replies that shards of another division
    /// have are copied first.
    pub fn remaining(&mut self, phase: usize) -> Result<Remaining<E>> {
        let mut stored = self.store.trials()?;
        let mut answered = stored_keys::answered(&stored);
        let mut again = truncated(&stored, self.experiment.models(phase));
        let mut plan = self.experiment.plan_without(
            phase,
            || self.store.records(),
            |key| answered.contains(key) && !again.contains(key),
        )?;
        if let Some(part) = &mut self.manifest.part {
            for (source, trials) in &plan.by_source {
                part.trials[*source] += trials;
            }
        }
        if self.copy_from_other_shards(&plan.keys, &answered)? {
            stored = self.store.trials()?;
            answered = stored_keys::answered(&stored);
            again = truncated(&stored, self.experiment.models(phase));
            plan.exclude(|key| answered.contains(key) && !again.contains(key));
        }
        let asked_again = plan.remaining_where(|key| again.contains(key));
        if asked_again > 0 {
            let replies = plural(asked_again, "truncated reply is", "truncated replies are");
            let flag = self.experiment.token_flag(phase);
            self.progress.note(&format!("{replies} asked again with the larger {flag}"));
        }
        let paid_for = lost_for_good(&stored, self.experiment.settings());
        let not_again = plan.exclude(|key| paid_for.contains(key));
        if not_again > 0 {
            let (trials, were) = if not_again == 1 { ("trial", "was") } else { ("trials", "were") };
            tracing::warn!(
                "{not_again} {trials} not asked again: {were} charged for several attempts without a reply; asked again with more \
                 --retries paid, best with a larger {} in another folder",
                self.experiment.token_flag(phase)
            );
        }
        let sent = self.store.pending_in_batches()?;
        let in_batch = plan.exclude(|key| sent.contains(key));
        // Dropped before the set of keys grows, because each of these sets takes 70 MB for a million trials.
        drop((answered, again, paid_for));
        self.keys.extend(&plan.keys);
        Ok(Remaining { plan, stored, in_batch })
    }

    /// Adds the images whose notes were lost to a plan, without trials.
    fn add_lost_notes(&self, phase: usize, plan: &mut Plan<E::Item>) -> Result<()> {
        if !self.lacks_notes {
            return Ok(());
        }
        let missing = missing_notes(self.experiment, self.store.folder());
        let sources = self.experiment.sources();
        let all = self.experiment.plan(phase, || self.store.records())?;
        plan.add_images(all, |source, condition| {
            let Source { name, frames, .. } = &sources[source];
            let wanted = missing.wanted(name, condition);
            // Fidelity is measured only for sources of one image.
            wanted.thumbnail || (wanted.fidelity && frames.len() == 1)
        });
        Ok(())
    }

    /// Copies the replies to these trials from shards of another division of the run. Returns true if any were copied.
    fn copy_from_other_shards(&mut self, keys: &[TrialKey], answered: &HashSet<TrialKey>) -> Result<bool> {
        let others = OtherShards::find::<DetailOf<E>>(self.store.folder(), &self.manifest)?;
        let wanted = keys.iter().filter(|key| !answered.contains(key));
        let sources = self.experiment.sources().iter();
        let copied = others.copy_into(
            &mut self.store,
            &self.manifest,
            &wanted.copied().collect(),
            &sources.map(|source| &source.name).collect(),
        )?;
        if copied > 0 {
            self.progress.note(&format!(
                "{}: {} copied from parts of another division",
                self.store.folder().display(),
                plural(copied, "reply", "replies")
            ));
        }
        Ok(copied > 0)
    }

    /// Warns about trials that wait for a batch. They are not asked here, because they would be paid for twice.
    fn warn_of_batches(&self, in_batch: usize) {
        if in_batch > 0 {
            let verb = if in_batch == 1 { " is" } else { "s are" };
            tracing::warn!(
                "{in_batch} trial{verb} waiting for a batch and not asked here; import the replies with batch run, batch fetch or batch \
                 import; batch cancel {} ends what batch run has submitted, and frees it; or delete {} to ask here",
                self.store.folder().display(),
                self.store.folder().join(darkqa_store::BATCH).display()
            );
        }
    }

    /// Asks the remaining trials of a phase.
    pub fn ask_phase(&mut self, phase: usize, remaining: Remaining<E>) -> Result<EndReason> {
        let Remaining { mut plan, stored, .. } = remaining;
        let experiment = self.experiment;
        let settings = experiment.settings();
        let models = experiment.models(phase);
        let all = every_model(experiment);
        let run_models = RunModels { models: &all, manifest: Some(&self.manifest) };
        let batches = Journal::open(self.store.folder(), &self.manifest)?.max_open_cost();
        let budget = Budget::for_run(&settings.money, models, run_models, &stored)?;
        let in_flight_cost = InFlightCost::open(self.store.folder())?;
        let budget = budget.with_unrecorded(batches + in_flight_cost.killed());
        let counts = TrialCounts { trials: plan.keys.len(), answered: plan.keys.len() - plan.remaining() };
        let shows_images = !plan.conditions().is_empty();
        let enhancers = if shows_images { self.enhancers.take_models()? } else { Vec::new() };
        self.begin(counts, &stored)?;
        let timed_out: HashSet<TrialKey> =
            stored.iter().filter(|trial| trial.timed_out_at_gateway()).map(|trial| trial.key).collect();
        warn_of_timeouts(plan.remaining_where(|key| timed_out.contains(key)));
        drop(stored);
        let workers = Workers::start(settings.loading.threads.threads)?;
        let timings = Timings::default();
        let limit = image_limit(settings);
        let sources = experiment.sources();
        let maker = Maker::new(self.enhancers.version(), &settings.loading.size);
        let images = self.images.as_ref();
        let mut pipeline = pipeline(experiment, Vec::new(), limit, &timings);
        pipeline.steps.png = self.manifest.png;
        pipeline.steps.stored = images.map(|images| StoredImages::new(images, &maker, self.manifest.png));
        workers.shared.install(|| {
            if shows_images {
                dark_already::warn(experiment);
            }
            pipeline.open_enhancers(enhancers, &settings.loading, sources, &plan.sources)?;
            pipeline.check(sources, &plan.sources)
        })?;
        let usages = pipeline.usages();
        pipeline.open_enhancer_sets(sources, &plan.sources, &workers)?;
        if self.images.is_some() {
            let names = models.iter().map(|model| model.name.as_ref());
            let first = first_source(names, settings.shard, plan.sources.len());
            plan.sources.rotate_left(first);
        }
        if models.iter().any(|model| model.model.is_remote()) {
            plan.ask_untouched_first(MIN_REPLIES * models.len(), UNTOUCHED_FIRST * models.len(), |source| {
                sources[source].frames.len() == 1
            });
        }
        let stoppers = pipeline.stoppers();
        let dispatcher = Dispatcher {
            models,
            progress: self.progress,
            settings,
            timings: &timings,
            timed_out,
            in_flight_cost,
            replies: ReplyChecks::new(experiment.token_flag(phase), experiment.mark_protocol(phase)),
        };
        let missing = missing_notes(experiment, self.store.folder());
        let started = Instant::now();
        let end = dispatcher.run(counts, budget, &mut self.store, stoppers, |groups| {
            pipeline.develop(sources, plan.sources, &missing, &workers, groups);
        })?;
        self.note_enhancers(usages);
        if settings.show_timings {
            let threads = workers.single_threaded.len();
            let held_back =
                models.iter().map(|model| model.model.held_back()).fold(HeldBack::default(), HeldBack::longest);
            let line = timings.summary(
                started.elapsed(),
                threads,
                held_back,
                models.iter().any(|model| model.model.is_remote()),
            );
            let line = match E::PHASES {
                [_] => line,
                phases => format!("{}: {line}", phases[phase]),
            };
            self.progress.note(&line);
            if let Some(images) = self.images.as_ref().filter(|_| shows_images) {
                self.progress.note(&images.summary());
            }
        }
        Ok(end)
    }

    /// Adds the use of the enhancers to the manifest.
    pub fn note_enhancers(&mut self, usages: Vec<(EnhancerName, Usage)>) {
        for (name, usage) in usages {
            let name = name.to_string();
            let earlier = self.manifest.enhancers.remove(&name);
            let note = usage.note().with_earlier(earlier);
            self.manifest.enhancers.insert(name, note);
        }
    }

    /// Writes the numbers of trials into the manifest, so that they are known even if the process is killed.
    pub fn write_counts(&mut self, stored: &[StoredTrial]) -> Result<()> {
        self.manifest.counts =
            Counts { failed: 0, ..self.counts(stored.iter().map(|trial| (trial.key, trial.failed()))) };
        self.store.write_manifest(&self.manifest)
    }

    /// Writes the start of a phase into the manifest, and prints how many of its trials are answered.
    fn begin(&mut self, counts: TrialCounts, stored: &[StoredTrial]) -> Result<()> {
        let TrialCounts { trials, answered } = counts;
        manifest::mark_started(self.experiment, &mut self.manifest);
        models::note_changes(&every_model(self.experiment), &mut self.manifest.settings);
        self.manifest.platform.extend(self.enhancers.version());
        self.write_counts(stored)?;
        if answered > 0 {
            self.progress.print_on_terminal(&format!(
                "{}: {answered} of {trials} trials already answered",
                self.store.folder().display()
            ));
        }
        Ok(())
    }

    /// Numbers of trials of the run, from the keys of the stored trials and whether each failed. Trials that an earlier
    /// command planned count only if they are answered.
    fn counts(&self, stored: impl Iterator<Item = (TrialKey, bool)>) -> Counts {
        let (mut unplanned, mut answered, mut failed) = (0, 0, 0);
        for (key, has_failed) in stored {
            let is_planned = self.keys.contains(&key);
            if !has_failed {
                unplanned += usize::from(!is_planned);
                answered += 1;
            } else if is_planned {
                failed += 1;
            }
        }
        Counts { trials: self.keys.len() + unplanned, answered, failed }
    }

    /// The manifest at the end of this command.
    fn final_manifest(&self, end: &EndReason, counts: Counts) -> RunManifest {
        let mut manifest = self.manifest.clone();
        let status = end.status(counts);
        if (status, counts) != (manifest.status, manifest.counts) {
            (manifest.status, manifest.counts) = (status, counts);
            manifest.updated = now();
        }
        manifest
    }

    /// The outcome if nothing was asked and the report in the folder is that of the records; otherwise `None`.
    fn finish_unchanged(&self, end: &EndReason) -> Result<Option<Outcome>> {
        let (EndReason::AllAsked, Some(counts)) = (end, self.unasked) else {
            return Ok(None);
        };
        let settings = self.experiment.settings();
        let manifest = self.final_manifest(end, counts);
        let outcome = self.experiment.unchanged_report(&self.store, &manifest, settings.show)?;
        if outcome.is_some() {
            self.store.write_manifest(&manifest)?;
            record_table::update(self.store.folder(), settings.table)?;
        }
        Ok(outcome)
    }

    /// Scores the run, and writes the report into its folder, unless it has the report already.
    pub fn finish(self, end: EndReason) -> Result<Outcome> {
        if let Some(outcome) = self.finish_unchanged(&end)? {
            return Ok(outcome);
        }
        let mut run = StoredRun::reread(self.store.folder(), self.manifest.clone(), self.store.indexed().cloned())?;
        let trials = run.trials.iter();
        let counts = self.counts(trials.map(|trial| (trial.key(), trial.failed())));
        run.manifest = self.final_manifest(&end, counts);
        let settings = self.experiment.settings();
        let mut outcome = self.experiment.report(&self.store, run, settings.show)?;
        record_table::update(self.store.folder(), settings.table)?;
        match end {
            EndReason::Stopped(error) => Err(error),
            EndReason::ModelsStopped(errors) => {
                // Printed last, because the results may be long.
                for error in errors {
                    if settings.show.is_document() {
                        tracing::warn!("not asked any further: {error}");
                    } else {
                        let _ = writeln!(outcome.output, "! not asked any further: {error}");
                    }
                }
                Ok(outcome)
            }
            _ => Ok(outcome),
        }
    }
}

/// Numbers of replies that were charged more tokens than the limit of their model, by model.
fn longer_replies(models: &[&ModelUnderTest], trials: &[StoredTrial]) -> BTreeMap<String, usize> {
    let mut longer = BTreeMap::new();
    for trial in trials {
        let tokens = trial.usage().and_then(|usage| usage.completion_tokens);
        let model = models.iter().find(|model| *model.name == **trial.model);
        let limit = model.and_then(|model| model.model.reply_limit());
        if tokens.zip(limit).is_some_and(|(tokens, limit)| tokens > limit) {
            *longer.entry(trial.model.to_string()).or_default() += 1;
        }
    }
    longer
}

/// The models of all phases of an experiment.
pub fn every_model<E: Experiment>(experiment: &E) -> Vec<&ModelUnderTest> {
    let phases = 0..E::PHASES.len();
    phases.flat_map(|phase| experiment.models(phase)).collect()
}

/// The image pipeline of an experiment, without an image store, and with the PNG files of a new run.
pub fn pipeline<'a, E: Experiment>(
    experiment: &'a E,
    enhancers: Vec<Enhancer>,
    limit: Option<ImageLimit>,
    timings: &'a Timings,
) -> ImagePipeline<'a> {
    let steps = ImageSteps {
        frames: experiment.frames(),
        recipe: experiment.recipe(),
        limit,
        timings,
        png: PngForm::NEWEST,
        stored: None,
    };
    let implausible = experiment.settings().loading.probe.implausible();
    let mut pipeline = ImagePipeline::new(steps, enhancers, implausible);
    pipeline.whole_run = experiment.probe_sources();
    pipeline
}

/// The strictest image limit of all endpoints, because each image is made once for all of them; `None` if all models
/// are built in.
pub fn image_limit(settings: &JobSettings) -> Option<ImageLimit> {
    let limit = settings
        .ask
        .servers()
        .into_iter()
        .filter_map(|server| {
            let stated = server.sending.max_image;
            let stated = stated.map(|megabytes| ImageLimit::from_user((megabytes * 1e6) as usize));
            let known = server.replicas.iter().map(ImageLimit::from_access);
            stated.or_else(|| known.reduce(ImageLimit::stricter))
        })
        .reduce(ImageLimit::stricter)?;
    // Limits on requests matter only for models that see images.
    let replicas = settings
        .ask
        .models
        .iter()
        .filter(|model| model.view == View::Image)
        .filter_map(|model| model.server.as_ref())
        .flat_map(|server| &server.replicas);
    Some(replicas.fold(limit, ImageLimit::with_requests_to))
}

/// The notes about images that a run folder does not have yet.
pub fn missing_notes<E: Experiment>(experiment: &E, folder: &Path) -> MissingNotes {
    let names = experiment.sources().iter().map(|source| &source.name);
    let thumbnails = MissingThumbnails::new(names, darkqa_store::read_thumbnails(folder));
    let thumbnails = thumbnails.with_objects(&experiment.questions());
    MissingNotes::new(thumbnails, darkqa_store::read_fidelity(folder))
}

/// Notes the number of trials that a gateway gave up on in an earlier call.
fn warn_of_timeouts(trials: usize) {
    if trials > 0 {
        let (trials, were, each) = if trials == 1 {
            ("1 trial".to_owned(), "was", "it")
        } else {
            (format!("{trials} trials"), "were", "each")
        };
        tracing::warn!(
            "{trials} {were} given up by a gateway in an earlier call, and may have been charged: {each} is asked once more, as a stream if \
             --request wire permits, and given up at the next timeout"
        );
    }
}

/// The index of the first source that a process works on, in a plan of `count` sources. It depends on the models and
/// the shard, so that processes that share an image store start at different sources, and most images are made by only
/// one of them.
fn first_source<'n>(models: impl Iterator<Item = &'n str>, shard: Shard, count: usize) -> usize {
    let shard = shard.to_string();
    let mut parts: Vec<&[u8]> = models.map(str::as_bytes).collect();
    parts.push(shard.as_bytes());
    let number =
        Digest::from_parts(parts).as_bytes().iter().take(8).fold(0_u64, |number, byte| number << 8 | u64::from(*byte));
    match count {
        0 => 0,
        count => (number % count as u64) as usize,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn first(model: &str, shard: Shard) -> usize {
        first_source([model].into_iter(), shard, 1000)
    }

    #[test]
    fn first_source_depends_on_models_and_shard_only() {
        let whole: Shard = "1/1".parse().unwrap();
        assert_eq!(first("a", whole), first("a", whole));
        assert_ne!(first("a", whole), first("b", whole));
        assert_ne!(first("a", "1/2".parse().unwrap()), first("a", "2/2".parse().unwrap()));
        assert_eq!(first_source(["a"].into_iter(), whole, 0), 0);
        for model in ["a", "b", "c", "d"] {
            assert!(first_source([model].into_iter(), whole, 3) < 3);
        }
    }
}
