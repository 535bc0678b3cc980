//! The asynchronous part of a run: sends the trials of prepared groups, and stores each reply when it arrives
//! ([`Dispatcher`]).

use std::cell::RefCell;
use std::collections::{BTreeMap, HashSet};
use std::sync::Arc;
use std::time::{Duration, Instant};

use tokio::runtime;
use tokio::sync::mpsc::{self, Receiver, Sender};
use tokio::sync::watch;
use tokio::task::{JoinError, JoinSet};
use tokio::time::timeout;

use super::circuit_breaker::Suspects;
use super::lanes::{Finished, send};
use super::models::ServedNames;
use super::refusals::FirstFailures;
use crate::circuit_breaker::{CircuitBreaker, EndReason};
use crate::costs::{Budget, BudgetNotes, InFlightCost, Permit, TokenCheck};
use crate::images::image_pipeline::EnhancerStopper;
use crate::images::notes::ImageNotes;
use crate::images::progress::{LINE_INTERVAL, Progress, TrialProgress};
use crate::images::timings::{TimedStep, Timings};
use crate::images::trials::{Item, PreparedGroup, Trial};
use crate::images::workers::thread_start_error;
use crate::interrupt::Interrupt;
use crate::lanes::{Lanes, PreparedTrial};
use crate::models::ModelUnderTest;
use crate::refusals::Refusals;
use crate::reply_checks::ReplyChecks;
use crate::settings::JobSettings;
use darkqa_ask::{AskError, Reach, sleep_running};
use darkqa_base::error::{Error, Result};
use darkqa_base::types::{Digest, FailureKind, Finish, Record, Reply, SetLight, TrialKey};
use darkqa_score::answers::record::answered;
use darkqa_score::answers::{ImageDependence, LitReply};
use darkqa_store::Store;

/// Maximum number of prepared groups that wait in the channel.
const GROUPS_AHEAD: usize = 2;

/// Models and settings of one phase of a run.
pub struct Dispatcher<'a> {
    pub models: &'a [ModelUnderTest],
    pub progress: &'a Progress,
    pub settings: &'a JobSettings,
    pub timings: &'a Timings,
    /// Trials that a gateway gave up on in an earlier call.
    pub timed_out: HashSet<TrialKey>,
    pub in_flight_cost: InFlightCost,
    /// The checks of the replies, which begin anew.
    pub replies: ReplyChecks,
}

/// Numbers of trials in one phase.
#[derive(Debug, Clone, Copy)]
pub struct TrialCounts {
    /// Number of trials, answered or not.
    pub trials: usize,
    /// Number of trials with a reply.
    pub answered: usize,
}

impl Dispatcher<'_> {
    /// Asks the trials of the groups that `make` sends. `make` runs on a separate thread until the channel is closed.
    /// `stoppers` cancel enhancements in progress.
    pub fn run<I: Item>(
        &self,
        counts: TrialCounts,
        budget: Budget,
        store: &mut Store<I::Detail>,
        stoppers: Vec<EnhancerStopper>,
        make: impl FnOnce(&Sender<PreparedGroup<I>>) + Send,
    ) -> Result<EndReason> {
        let runtime = runtime::Builder::new_multi_thread().enable_all().build().map_err(|e| thread_start_error(&e))?;
        let (sender, groups) = mpsc::channel(GROUPS_AHEAD);
        let sink = ReplySink::<I> {
            dispatcher: self,
            store,
            bar: self.progress.trials(counts.trials, counts.answered),
            breaker: self.breaker(),
            suspects: Suspects::default(),
            refusals: Refusals::new(self.models.len()),
            not_asked: BTreeMap::new(),
            budget,
            stoppers,
            answered: counts.answered,
            checks: self.replies.clone(),
            tokens: TokenCheck::new(self.models.len()),
            dependence: vec![ImageDependence::default(); self.models.len()],
            first_questions: vec![FirstQuestion::NotAsked; self.models.len()],
            limits: BudgetNotes::new(self.models),
            given_up: watch::Sender::new(false),
            in_flight_cost: self.in_flight_cost,
            are_notes_lost: false,
            first_failures: FirstFailures::default(),
            served: vec![ServedNames::default(); self.models.len()],
        };
        std::thread::scope(|scope| {
            scope.spawn(move || make(&sender));
            runtime.block_on(sink.ask(groups))
        })
    }

    fn breaker(&self) -> CircuitBreaker {
        let most =
            self.models.iter().filter_map(|model| model.server.as_ref()).map(|server| server.max_in_flight()).max();
        CircuitBreaker::new(
            self.models,
            most.unwrap_or(self.settings.concurrency.max()),
            self.settings.money.max_failures,
        )
        .with_fail_fast(self.settings.money.fail_fast)
    }
}

/// Time for waiting trials to end after their models are closed; chosen: they need microseconds.
const CLOSING_TIME: Duration = Duration::from_millis(50);

/// Asks trials, and stores their replies.
struct ReplySink<'a, I: Item> {
    dispatcher: &'a Dispatcher<'a>,
    store: &'a mut Store<I::Detail>,
    bar: TrialProgress,
    breaker: CircuitBreaker,
    /// Images for which the server fails repeatedly.
    suspects: Suspects,
    /// Refused trials that wait for another answer.
    refusals: Refusals<I>,
    /// Number of trials by frame or walk that were not asked because the server fails for it.
    not_asked: BTreeMap<String, usize>,
    budget: Budget,
    stoppers: Vec<EnhancerStopper>,
    /// Number of trials with a reply, including those of earlier calls.
    answered: usize,
    checks: ReplyChecks,
    /// Comparison of the charged tokens with the estimated ones.
    tokens: TokenCheck,
    /// Check of each model that its replies depend on the image.
    dependence: Vec<ImageDependence>,
    /// State of the first question to each model.
    first_questions: Vec<FirstQuestion>,
    /// Notices about the limit of cost.
    limits: BudgetNotes<'a>,
    /// True once the requests in flight are given up.
    given_up: watch::Sender<bool>,
    in_flight_cost: InFlightCost,
    /// True if a note about an image could not be written.
    are_notes_lost: bool,
    first_failures: FirstFailures,
    /// Names in the replies to each model.
    served: Vec<ServedNames>,
}

/// State of the first question to a model. With `--max-cost`, other questions wait until it ends, because the charged
/// tokens of prompts are not known before.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum FirstQuestion {
    NotAsked,
    InFlight,
    Ended,
}

impl<I: Item> ReplySink<'_, I> {
    /// Asks the trials of all groups until they end or the circuit breaker stops the run.
    async fn ask(mut self, mut groups: Receiver<PreparedGroup<I>>) -> Result<EndReason> {
        let concurrency = self.dispatcher.settings.concurrency.max();
        let mut lanes = Lanes::<I>::new(self.dispatcher.models, concurrency);
        lanes.keep_within_open_files(self.dispatcher.settings.loading.threads);
        let mut in_flight = JoinSet::<Finished<I>>::new();
        let mut interrupt = Interrupt::listen()?;
        let mut grace = None;
        let mut more_groups = true;
        // Refreshes the counts shown even if no trial ends.
        let mut tick = tokio::time::interval(LINE_INTERVAL);
        let spending = Arc::clone(self.budget.spending());
        self.limits.warn_unlimited(&spending);
        self.limits.warn_unpriced(&self.dispatcher.settings.money);
        loop {
            while let Some(ready) = self.next(&mut lanes) {
                match self.permit(&ready) {
                    Permit::Refused => lanes.put_back(ready),
                    permit => {
                        // Requests in flight are already paid for, so the loop below waits for them.
                        if let Err(e) = self.note_in_flight() {
                            self.breaker.ended(e);
                            break;
                        }
                        let model = &self.dispatcher.models[ready.trial.model];
                        let given_up = self.given_up.subscribe();
                        let has_timed_out = self.dispatcher.timed_out.contains(&ready.trial.key);
                        in_flight.spawn(send(model.clone(), ready, permit, has_timed_out, given_up));
                    }
                }
            }
            self.show_counts(lanes.is_held_back());
            if in_flight.is_empty() && !lanes.is_empty() {
                self.breaker.over_budget();
            }
            let all_asked = !more_groups && lanes.is_empty() && in_flight.is_empty();
            if all_asked && lanes.has_deferred() {
                lanes.requeue_deferred();
                self.suspects.start_deferred();
                continue;
            }
            if all_asked && !self.breaker.stopped() && lanes.requeue(self.refusals.release_last()) {
                continue;
            }
            if all_asked || self.breaker.stopped() {
                break;
            }
            let state = match in_flight.len() {
                0 => Some(TimedStep::Idle),
                _ if lanes.has_waiting() => Some(TimedStep::Full),
                _ => None,
            };
            let since = Instant::now();
            let wants_more = more_groups && lanes.wants_more(|model| self.breaker.is_stopped(model));
            tokio::select! {
                () = interrupt.next() => {
                    grace = Some(self.dispatcher.settings.grace);
                    self.breaker.interrupted();
                }
                Some(done) = in_flight.join_next() => {
                    self.record_wait(state, since);
                    if let Ok((ready, _)) = &done {
                        lanes.ended(ready.trial.model);
                    }
                    self.store_result(done)?;
                    lanes.requeue(self.refusals.take_released());
                }
                group = groups.recv(), if wants_more => match group {
                    Some(group) => {
                        self.record_wait(state, since);
                        lanes.extend(self.accept(group)?);
                    }
                    None => more_groups = false,
                },
                () = spending.released(), if lanes.is_held_back() => lanes.release(),
                _ = tick.tick() => self.record_wait(state, since),
            }
        }
        // Ends the image pipeline.
        drop(groups);
        if self.breaker.stopped() {
            self.stoppers.iter().for_each(EnhancerStopper::stop);
            self.drain(in_flight, interrupt, grace).await?;
        }
        for (ready, refused) in self.refusals.take_rest(!self.breaker.stopped()) {
            self.store_settled(&ready, refused)?;
        }
        for (source, trials) in &self.not_asked {
            tracing::warn!(
                "{source}: {trials} of its trials were not asked: the server fails for this image again and again, and answers others; \
                 leave it out, or send it smaller (--image max-side=N)"
            );
        }
        self.first_failures.warn(self.dispatcher.models, |model| self.breaker.is_stopped(model));
        self.store.sync()?;
        self.in_flight_cost.end(self.store.folder())?;
        Ok(self.breaker.into_end())
    }

    /// The next trial to send. Trials about an image for which the server fails repeatedly come last, and are dropped
    /// if it still fails.
    fn next(&mut self, lanes: &mut Lanes<'_, I>) -> Option<PreparedTrial<I>> {
        let Self { breaker, suspects, not_asked, .. } = self;
        let not_asked = RefCell::new(not_asked);
        lanes.next(
            |trial| {
                let is_given_up = suspects.is_given_up(trial.model, trial.item.source());
                if is_given_up {
                    let mut not_asked = not_asked.borrow_mut();
                    *not_asked.entry(trial.item.source().to_owned()).or_default() += 1;
                }
                is_given_up || breaker.is_stopped(trial.model)
            },
            |trial| suspects.is_deferred(trial.model, trial.item.source()),
        )
    }

    /// Permission to ask a trial now, within `--max-cost`.
    fn permit(&mut self, ready: &PreparedTrial<I>) -> Permit {
        let index = ready.trial.model;
        let is_limited = self.budget.spending().limit().is_some();
        if is_limited && self.first_questions[index] == FirstQuestion::InFlight {
            return Permit::Refused;
        }
        let model = &self.dispatcher.models[index];
        let images = ready.stimulus.images.iter().map(|image| image.facts());
        let permit = self.budget.permit(model, &ready.trial, images);
        if let (Permit::Reserved(_), FirstQuestion::NotAsked) = (&permit, self.first_questions[index]) {
            self.first_questions[index] = FirstQuestion::InFlight;
        }
        permit
    }

    /// Records the cost of the requests in flight in the run folder, if `--max-cost` is set.
    fn note_in_flight(&mut self) -> Result<()> {
        let spending = self.budget.spending();
        if spending.limit().is_none() {
            return Ok(());
        }
        let reserved = spending.reserved();
        self.in_flight_cost.raise(self.store.folder(), reserved)
    }

    /// Shows the numbers of trials and the cost so far, and whether `--max-cost` delays requests.
    fn show_counts(&self, is_held_back: bool) {
        let pace = if is_held_back { " · slowed by --max-cost" } else { "" };
        let failures = self.breaker.failures();
        self.bar.count(self.answered, failures, self.budget.spent(), pace);
    }

    /// Adds the time since `since` to the timings of a state.
    fn record_wait(&self, state: Option<TimedStep>, since: Instant) {
        if let Some(state) = state {
            self.dispatcher.timings.add(state, since.elapsed());
        }
    }

    /// Waits for the requests in flight, because they may be paid for already, up to the time `grace` if it is set. A
    /// further interrupt aborts them. Requests that wait for their turn or for a retry are aborted at once.
    async fn drain(
        &mut self,
        mut in_flight: JoinSet<Finished<I>>,
        mut interrupt: Interrupt,
        grace: Option<Duration>,
    ) -> Result<()> {
        let progress = self.dispatcher.progress;
        for model in self.dispatcher.models {
            model.model.close();
        }
        // Requests that were only waiting end now, and are not counted as in flight.
        while let Ok(Some(done)) = timeout(CLOSING_TIME, in_flight.join_next()).await {
            self.store_result(done)?;
        }
        if !in_flight.is_empty() {
            let (at_most, again) = match grace {
                Some(grace) => (format!(", after {} s (--stop grace) at the latest", grace.as_secs_f64()), " again"),
                None => (String::new(), ""),
            };
            progress.print_on_terminal(&format!(
                "stopping when the requests in flight ({}) have ended{at_most}; interrupt{again} to abort them",
                in_flight.len()
            ));
        }
        let out_of_grace = async {
            match grace {
                Some(grace) => sleep_running(grace).await,
                None => std::future::pending().await,
            }
        };
        tokio::pin!(out_of_grace);
        let mut given_up = false;
        while !in_flight.is_empty() {
            let gives_up = tokio::select! {
                () = interrupt.next() => true,
                () = &mut out_of_grace, if !given_up => true,
                Some(done) = in_flight.join_next() => {
                    self.store_result(done)?;
                    false
                }
            };
            if gives_up && !given_up {
                given_up = true;
                tracing::warn!(
                    "requests given up while in flight: {}; they may be paid for, and the same command asks them again",
                    in_flight.len()
                );
                self.given_up.send_replace(true);
            }
        }
        Ok(())
    }

    /// Prepares the trials of a group. If the images could not be made, records all trials as failed, and returns none.
    fn accept(&mut self, group: PreparedGroup<I>) -> Result<Vec<PreparedTrial<I>>> {
        let PreparedGroup { stimulus, trials, problem, notes } = group;
        self.store_notes(&notes);
        let stimulus = Arc::new(stimulus);
        let ready = trials.into_iter().map(|trial| PreparedTrial { trial, stimulus: Arc::clone(&stimulus) });
        let Some(problem) = problem else {
            return Ok(ready.collect());
        };
        // The trials are asked when the command is repeated.
        if let Error::EnhancerEnded { .. } = problem {
            self.breaker.ended(problem);
            return Ok(Vec::new());
        }
        let error = AskError { attempts: 0, ..AskError::new(FailureKind::Image, problem.to_string()) };
        for ready in ready {
            self.store_result(Ok((ready, Err(error.clone()))))?;
        }
        Ok(Vec::new())
    }

    /// Stores the notes about an image, unless an earlier note could not be written. Trials do not depend on notes.
    fn store_notes(&mut self, notes: &ImageNotes) {
        if self.are_notes_lost {
            return;
        }
        if let Err(e) = notes.store(self.store) {
            self.are_notes_lost = true;
            tracing::warn!(
                "{e}; the run goes on without further thumbnails and similarities of images, which the same command adds later"
            );
        }
    }

    /// Stores the reply or the failure of one trial.
    fn store_result(&mut self, done: Result<Finished<I>, JoinError>) -> Result<()> {
        let (ready, result) = match done {
            Ok(done) => done,
            Err(aborted) if aborted.is_cancelled() => return Ok(()),
            Err(panic) => std::panic::resume_unwind(panic.into_panic()),
        };
        let model = ready.trial.model;
        // Zero attempts: the image could not be made, and nothing was sent.
        let attempts = match &result {
            Ok(reply) => reply.attempts,
            Err(error) => error.attempts,
        };
        if attempts > 0 {
            self.first_questions[model] = FirstQuestion::Ended;
        }
        self.limits.warn_exceeded(model, &self.budget);
        self.limits.warn_of_charges(model, &self.budget);
        match result {
            Err(refused) if self.refusals.must_wait(&ready, &refused) => {
                self.breaker.refused(model, &refused, ready.trial.item.source());
                self.refusals.add(ready, refused);
            }
            result => {
                for (ready, result) in self.refusals.settle((ready, result)) {
                    self.store_settled(&ready, result)?;
                }
            }
        }
        Ok(())
    }

    /// Stores the reply or the failure of one trial, once a refusal is known to concern the trial or the run.
    fn store_settled(&mut self, ready: &PreparedTrial<I>, result: Result<Reply, AskError>) -> Result<()> {
        let trial = &ready.trial;
        match &result {
            Ok(_) => {
                self.breaker.succeeded(trial.model);
                self.suspects.succeeded(trial.model, trial.item.source());
            }
            Err(error) => {
                let source = trial.item.source();
                let is_set_aside = self.suspects.failed(trial.model, error, source);
                // If the server has answered nothing, it is the cause, and not the image.
                if is_set_aside && self.suspects.has_answered(trial.model) {
                    tracing::warn!(
                        "{source}: trials about it failed twice; the others about it are asked last ({})",
                        error.failure.message
                    );
                }
                let may_be_cause = self.suspects.may_be_cause(trial.model, source);
                self.breaker.failed(trial.model, error, source, may_be_cause);
                let concerns_all = match error.reach {
                    Reach::Trial => false,
                    Reach::ByStatus => self.breaker.is_stopped(trial.model),
                    _ => true,
                };
                if !concerns_all {
                    self.first_failures.add(trial.model, source, &error.failure);
                }
                // If the endpoint is the cause or the run ends, the trial does not count as asked, unless it cost
                // something.
                if concerns_all && error.lost.is_none() {
                    return Ok(());
                }
            }
        }
        if let Ok(reply) = &result {
            self.answered += 1;
            self.checks.count(reply);
            self.served[trial.model].add(&self.dispatcher.models[trial.model], reply);
            if let Some(usage) = reply.usage {
                let model = &self.dispatcher.models[trial.model];
                let images = ready.stimulus.images.iter().map(|image| image.facts());
                self.tokens.add(model, trial, images.clone(), usage, &self.budget);
                self.budget.observe(model, trial, images, usage);
            }
        }
        let model = &self.dispatcher.models[ready.trial.model];
        let blank = model.blank(&ready.trial, &ready.stimulus);
        let record = match result {
            Ok(reply) => answered(blank, reply)?,
            Err(error) => Record {
                lost: *error.lost,
                finish: error.finish.map(|word| Finish::Other(word.into()).shorten()),
                ..blank.with_failure(error.failure, error.attempts)
            },
        };
        self.store.append(&record)?;
        if let Some(e) = self.store.other_writer() {
            self.breaker.ended(e);
        }
        self.check_dependence(&ready.trial, &record);
        Ok(())
    }

    /// Warns once for each model at an endpoint if its replies do not depend on the image. Skipped for photographs
    /// taken in the dark, where such replies are no evidence.
    fn check_dependence(&mut self, trial: &Trial<I>, record: &Record<I::Detail>) {
        let model = &self.dispatcher.models[trial.model];
        if !model.model.is_remote() || self.dispatcher.settings.set_light == SetLight::Dark {
            return;
        }
        let reply = LitReply::from_record(record, || Digest::from_parts(trial.prompt.parts().map(str::as_bytes)));
        let found = reply.and_then(|reply| self.dependence[trial.model].add(reply));
        if let Some(found) = found {
            tracing::warn!("{}", found.words(&model.name));
        }
    }
}
