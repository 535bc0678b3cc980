//! Runs an experiment through batches that the program submits: [`run`].

use std::collections::{BTreeMap, BTreeSet};

use super::BatchFileArgs;
use super::driver::{Driven, Driver, Goal, Notes};
use super::file::{self, RequestCost, StoppedModels, require_files, require_remote};
use super::folder::{self, start_runtime};
use super::journal::Journal;
use super::recover::recover;
use super::servers::{BatchRunArgs, BatchServers};
use crate::circuit_breaker::EndReason;
use crate::costs::{Budget, BudgetNotes, RunModels};
use crate::experiment::Experiment;
use crate::images::enhancement::enhancers::{self, EnhancerModels};
use crate::images::trials::{Item as _, Stimulus, Trial};
use crate::interrupt::Interrupt;
use crate::models::{self, ModelUnderTest};
use crate::open_run::{OpenRun, Remaining, every_model};
use crate::stored_keys::answered;
use darkqa_base::error::{Error, Result};
use darkqa_base::types::TrialKey;
use darkqa_base::types::manifests::Status;
use darkqa_base::types::text::{money, plural};
use darkqa_runs::outcome::Outcome;
use darkqa_store::StoredTrial;

/// Maximum number of further batches for requests without a reply; chosen.
const MAX_REPEATS: usize = 3;

/// The end of a phase.
enum PhaseEnd {
    /// Every request that can be batched was submitted, and the replies are imported.
    Asked,
    /// The batches are created, and the command returns.
    Detached,
    /// The command ends early.
    Early(EndReason),
}

/// Asks the remaining trials in batches, phase by phase, and waits for their replies.
///
/// # Errors
/// If a model is built in, or a server refuses all further calls. The batches stay, and the same command continues.
pub fn run<E: Experiment>(run: OpenRun<'_, E>, files: &BatchFileArgs, args: &BatchRunArgs) -> Result<Outcome> {
    let journal = Journal::open(run.store.folder(), &run.manifest)?;
    let mut batches = RunBatches {
        run,
        journal,
        files,
        args,
        refused: BTreeSet::new(),
        stopped: StoppedModels::default(),
        enhancers_used: false,
    };
    recover(&mut batches.journal, &batches.run.store)?;
    let mut end = EndReason::AllAsked;
    for phase in 0..E::PHASES.len() {
        match batches.phase(phase)? {
            PhaseEnd::Asked => {}
            PhaseEnd::Detached => return Ok(batches.detached()),
            PhaseEnd::Early(reason) => {
                end = reason;
                break;
            }
        }
    }
    if matches!(end, EndReason::AllAsked) && !batches.stopped.errors().is_empty() {
        end = EndReason::ModelsStopped(batches.stopped.take_errors());
    }
    batches.finish(end)
}

/// The mean completion tokens of each model's stored replies; `None` if no reply states them.
fn reply_lengths(models: &[ModelUnderTest], stored: &[StoredTrial]) -> Vec<Option<f64>> {
    models
        .iter()
        .map(|model| {
            let tokens = stored
                .iter()
                .filter(|trial| **trial.model == *model.name)
                .filter_map(|trial| trial.usage()?.completion_tokens);
            let (count, sum) = tokens.fold((0.0, 0.0), |(count, sum), tokens| (count + 1.0, sum + tokens as f64));
            (count > 0.0).then(|| sum / count)
        })
        .collect()
}

/// State of a run with its batches.
struct RunBatches<'a, 'b, E: Experiment> {
    run: OpenRun<'a, E>,
    journal: Journal,
    files: &'b BatchFileArgs,
    args: &'b BatchRunArgs,
    /// Trials that the server refused and would refuse again.
    refused: BTreeSet<TrialKey>,
    /// Models that cannot be asked any further.
    stopped: StoppedModels,
    /// True if the enhancers of `run` may have been used up.
    enhancers_used: bool,
}

impl<E: Experiment> RunBatches<'_, '_, E> {
    fn phase(&mut self, phase: usize) -> Result<PhaseEnd> {
        for repeat in 0..=MAX_REPEATS {
            let mut remaining = self.remaining(phase)?;
            if repeat == 0 {
                self.warn_of_other_batches(&remaining);
            }
            let has_parts = self.journal.has_open_parts();
            if remaining.plan.remaining() == 0 && !has_parts {
                break;
            }
            if remaining.plan.remaining() > 0 {
                let models = self.run.experiment.models(phase);
                require_remote(models)?;
                require_files(models)?;
                if repeat == 0 && !self.args.no_scout {
                    match self.scout(phase, remaining)? {
                        EndReason::AllAsked => {}
                        early => return Ok(PhaseEnd::Early(early)),
                    }
                    remaining = self.remaining(phase)?;
                }
                self.write(phase, remaining)?;
            }
            let driven = self.drive();
            self.note_adapted()?;
            let driven = driven?;
            if let Some(first) = self.stopped_phase(phase) {
                return Ok(PhaseEnd::Early(EndReason::Stopped(first)));
            }
            match driven {
                Some(Driven::Reached) if self.args.detach && self.journal.has_open_parts() => {
                    return Ok(PhaseEnd::Detached);
                }
                Some(Driven::Reached) => {}
                Some(Driven::OverBudget) => {
                    self.warn_of_budget();
                    return Ok(PhaseEnd::Early(EndReason::OverBudget));
                }
                None => return Ok(PhaseEnd::Early(EndReason::Interrupted)),
            }
        }
        Ok(PhaseEnd::Asked)
    }

    /// The trials of a phase that are to be asked in a batch, without refused ones and those of stopped models.
    fn remaining(&mut self, phase: usize) -> Result<Remaining<E>> {
        let mut remaining = self.run.remaining(phase)?;
        let models = self.run.experiment.models(phase);
        let excluded: BTreeSet<TrialKey> = remaining
            .plan
            .groups()
            .flat_map(|(_, group)| &group.trials)
            .filter(|trial| self.stopped.has_model(phase, trial.model, &models[trial.model]))
            .map(|trial| trial.key)
            .collect();
        remaining.plan.exclude(|key| self.refused.contains(key) || excluded.contains(key));
        Ok(remaining)
    }

    /// The first error, if all models of a phase are stopped; `None` if any may still be asked.
    fn stopped_phase(&mut self, phase: usize) -> Option<Error> {
        let is_stopped = self
            .run
            .experiment
            .models(phase)
            .iter()
            .enumerate()
            .all(|(index, model)| self.stopped.has_model(phase, index, model));
        if !is_stopped {
            return None;
        }
        self.stopped.take_errors().into_iter().next()
    }

    /// Warns about trials in files submitted by the user.
    fn warn_of_other_batches(&self, remaining: &Remaining<E>) {
        let own = self.journal.open_requests();
        if remaining.in_batch > own {
            tracing::warn!(
                "{} in files of batch export and not asked here; import the replies with batch import",
                plural(remaining.in_batch - own, "trial is", "trials are")
            );
        }
    }

    /// Asks one trial of each model directly, to find out what the server refuses before a batch is created. A model
    /// that cannot be asked any further is stopped; the others continue.
    fn scout(&mut self, phase: usize, mut remaining: Remaining<E>) -> Result<EndReason> {
        let mut scouts = BTreeMap::new();
        for (_, group) in remaining.plan.groups() {
            for trial in &group.trials {
                scouts.entry(trial.model).or_insert(trial.key);
            }
        }
        let keys: BTreeSet<TrialKey> = scouts.values().copied().collect();
        remaining.plan.exclude(|key| !keys.contains(key));
        self.reload_enhancers()?;
        let end = self.run.ask_phase(phase, remaining);
        self.note_adapted()?;
        let end = end?;
        if let EndReason::ModelsStopped(errors) = end {
            self.stop_unanswered(phase, &scouts, errors)?;
            return Ok(EndReason::AllAsked);
        }
        Ok(end)
    }

    /// Stops the models whose scout trial has no reply because of one of these errors.
    fn stop_unanswered(&mut self, phase: usize, scouts: &BTreeMap<usize, TrialKey>, errors: Vec<Error>) -> Result<()> {
        let answered = answered(&self.run.store.trials()?);
        let models = self.run.experiment.models(phase);
        for (model, _) in scouts.iter().filter(|(_, key)| !answered.contains(key)) {
            // Each error begins with the name of its model. Without an error, only this question has failed.
            let name = format!("{}: ", models[*model].name);
            let has_error = errors
                .iter()
                .any(|error| matches!(error, Error::Endpoint { problem, .. } if problem.starts_with(&name)));
            if has_error {
                self.stopped.add_model(phase, *model);
            }
        }
        self.stopped.add_errors(errors);
        Ok(())
    }

    /// Writes the remaining trials as parts.
    fn write(&mut self, phase: usize, remaining: Remaining<E>) -> Result<()> {
        if remaining.plan.remaining() == 0 {
            return Ok(());
        }
        self.reload_enhancers()?;
        self.run.write_counts(&remaining.stored)?;
        let experiment = self.run.experiment;
        let (models, money) = (experiment.models(phase), &experiment.settings().money);
        let all = every_model(experiment);
        let run_models = RunModels { models: &all, manifest: Some(&self.run.manifest) };
        let budget = Budget::for_run(money, models, run_models, &remaining.stored)?;
        if self.args.no_scout {
            BudgetNotes::new(models).warn_unlimited(budget.spending());
        }
        let replies = reply_lengths(models, &remaining.stored);
        let cost = |trial: &Trial<E::Item>, stimulus: &Stimulus| {
            let model = &models[trial.model];
            let images = stimulus.images.iter().map(|image| image.facts());
            let tokens = budget.expected_tokens(model, trial, images.clone());
            let reply = replies[trial.model].unwrap_or_else(|| trial.item.reply_tokens());
            let dollars = budget.expected_cost(trial.model, tokens, reply);
            let request = budget.request(model, trial, images);
            RequestCost {
                tokens,
                dollars: dollars.map(|dollars| money.prices.batch * dollars),
                most_dollars: request.as_ref().map(|request| money.prices.batch * request.max_cost()),
                bound: request.map(|request| request.current_bound()),
            }
        };
        let quota = self.args.enqueued_tokens.map(std::num::NonZeroU64::get);
        let target = file::FileSettings { files: self.files, quota, journal: Some(&mut self.journal), cost: &cost };
        file::write(&mut self.run, phase, remaining.plan, target)?;
        Ok(())
    }

    /// Reads the enhancers again, if they have been used.
    fn reload_enhancers(&mut self) -> Result<()> {
        let settings = self.run.experiment.settings();
        if self.enhancers_used {
            let files = enhancers::read_models(&settings.enhancers.llie)?;
            self.run.enhancers = EnhancerModels::from_files(files, &settings.loading);
        }
        self.enhancers_used = true;
        Ok(())
    }

    /// Advances all parts; `None` if the user interrupted.
    fn drive(&mut self) -> Result<Option<Driven>> {
        let experiment = self.run.experiment;
        let models = every_model(experiment);
        let servers = BatchServers::for_models(&models)?;
        let mut driver = Driver {
            store: &mut self.run.store,
            manifest: &self.run.manifest,
            journal: &mut self.journal,
            servers: &servers,
            models: &models,
            args: self.args,
            money: Some(&experiment.settings().money),
            progress: self.run.progress,
            until: if self.args.detach { Goal::Submitted } else { Goal::Imported },
            refused: &mut self.refused,
            stopped: &mut self.stopped,
            notes: Notes::default(),
        };
        start_runtime()?.block_on(async {
            let mut interrupt = Interrupt::listen()?;
            tokio::select! {
                biased;
                () = interrupt.next() => Ok(None),
                driven = driver.drive() => driven.map(Some),
            }
        })
    }

    fn warn_of_budget(&self) {
        if let Some(max_cost) = self.run.experiment.settings().money.max_cost {
            tracing::warn!(
                "stopped: one more batch could exceed the {} of --max-cost; the same command with a higher limit continues, and batch \
                 cancel frees the requests that wait",
                money(max_cost)
            );
        }
    }

    /// The outcome of a command that does not wait for its batches.
    fn detached(self) -> Outcome {
        let folder = self.run.store.folder().display().to_string();
        let parts = folder::lines(&self.journal, &BTreeMap::new());
        let output = format!(
            "{parts}the same command, or batch fetch {folder}, imports the replies; the same command also submits what waits\n"
        );
        for error in self.stopped.errors() {
            tracing::warn!("not asked any further: {error}");
        }
        let status = match self.stopped.errors() {
            [] => Status::Complete,
            _ => Status::Stopped,
        };
        Outcome::text(status, output)
    }

    fn finish(mut self, end: EndReason) -> Result<Outcome> {
        if let EndReason::Interrupted = end {
            let folder = self.run.store.folder().display();
            let line = if self.journal.has_batches() {
                format!(
                    "interrupted: the batches continue at the server; the same command continues the run, and batch cancel {folder} ends \
                     them"
                )
            } else {
                "interrupted: no batch is at the server; the same command continues the run".to_owned()
            };
            self.run.progress.note(&line);
        }
        self.run.note_cost()?;
        self.run.finish(end)
    }

    /// Writes changes to requests into the manifest at once, so that they are known however the command ends.
    fn note_adapted(&mut self) -> Result<()> {
        let before = self.run.manifest.settings.clone();
        for phase in 0..E::PHASES.len() {
            let adapted = models::adapted(self.run.experiment.models(phase));
            self.run.manifest.settings.extend(adapted);
        }
        if self.run.manifest.settings == before {
            return Ok(());
        }
        self.run.store.write_manifest(&self.run.manifest)
    }
}
