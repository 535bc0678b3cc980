//! The asynchronous side: asks about what the image pipeline has made, and keeps every reply the moment it arrives.

use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Instant;

use tokio::runtime;
use tokio::sync::mpsc::{self, Receiver, Sender};
use tokio::task::{JoinError, JoinSet};

use super::budget::Budget;
use super::circuit_breaker::{CircuitBreaker, EndReason};
use super::interrupt::Interrupt;
use super::models::ModelUnderTest;
use super::progress::{Progress, StepBar};
use super::settings::JobSettings;
use super::timings::{TimedStep, Timings};
use super::trial::{Item, PreparedGroup, Stimulus, Trial};
use super::workers::unstarted;
use crate::ask::{AskError, Call, Reach};
use crate::enhance::Stopper;
use crate::error::Result;
use crate::store::Store;
use crate::types::{Failure, FailureKind, Finish, Reply};

/// How many finished groups may wait to be asked about.
const GROUPS_AHEAD: usize = 2;

/// What a run is driven with.
pub(crate) struct Dispatcher<'a> {
    pub(crate) models: &'a [ModelUnderTest],
    pub(crate) progress: &'a Progress,
    pub(crate) settings: &'a JobSettings,
    pub(crate) timings: &'a Timings,
}

/// How far a run has come.
#[derive(Debug, Clone, Copy)]
pub(crate) struct TrialCounts {
    /// All trials.
    pub(crate) trials: usize,
    /// Those that have a reply.
    pub(crate) answered: usize,
}

/// One trial with the stimulus that it shares.
struct PreparedTrial<I> {
    trial: Trial<I>,
    stimulus: Arc<Stimulus>,
}

/// One trial with what came of it.
type Finished<I> = (PreparedTrial<I>, Result<Reply, AskError>);

impl Dispatcher<'_> {
    /// Asks what `make` hands out, which works on a thread of its own until nobody takes its groups any more; `stoppers`
    /// end what it is at.
    pub(crate) fn run<I: Item>(
        &self,
        tally: TrialCounts,
        budget: Budget,
        store: &mut Store<I::Detail>,
        stoppers: Vec<Stopper>,
        make: impl FnOnce(&Sender<PreparedGroup<I>>) + Send,
    ) -> Result<EndReason> {
        let runtime = runtime::Builder::new_multi_thread()
            .enable_all()
            .build()
            .map_err(|e| unstarted(&e))?;
        let (out, groups) = mpsc::channel(GROUPS_AHEAD);
        let intake = ReplySink::<I> {
            dispatcher: self,
            store,
            bar: self.progress.trials(tally.trials, tally.answered),
            breaker: self.breaker(),
            budget,
            stoppers,
            answered: tally.answered,
            cut: TruncationCheck::default(),
        };
        std::thread::scope(|scope| {
            scope.spawn(move || make(&out));
            runtime.block_on(intake.ask(groups))
        })
    }

    /// How many questions may be under way now.
    fn width(&self) -> usize {
        let widths = self.models.iter().filter_map(|model| model.model.width());
        // Models of one endpoint share its window.
        widths.max().unwrap_or(self.settings.concurrency.most())
    }

    fn breaker(&self) -> CircuitBreaker {
        CircuitBreaker::new(
            self.models,
            self.settings.concurrency.most(),
            self.settings.money.max_failures,
        )
    }
}

/// Where replies come in and are kept.
struct ReplySink<'a, I: Item> {
    dispatcher: &'a Dispatcher<'a>,
    store: &'a mut Store<I::Detail>,
    bar: StepBar,
    breaker: CircuitBreaker,
    budget: Budget,
    stoppers: Vec<Stopper>,
    /// Trials with a reply, those of earlier calls included.
    answered: usize,
    cut: TruncationCheck,
}

/// Counts replies that the token limit cut before an answer: the first ones tell whether it is too low.
#[derive(Debug, Default)]
struct TruncationCheck {
    replies: usize,
    cut: usize,
}

impl TruncationCheck {
    /// So many replies are looked at.
    const LOOKED_AT: usize = 10;

    /// Takes note of a reply, and says so where most of the first were cut.
    fn note(&mut self, reply: &Reply) {
        if self.replies >= Self::LOOKED_AT {
            return;
        }
        self.replies += 1;
        self.cut += usize::from(reply.finish == Finish::Length && reply.text.trim().is_empty());
        if self.replies == Self::LOOKED_AT && self.cut > Self::LOOKED_AT / 2 {
            tracing::warn!(
                "{} of the first {} replies were cut at the token limit before they said anything: a reasoning model needs a larger \
                 --max-tokens, or a lower --reasoning-effort",
                self.cut,
                self.replies
            );
        }
    }
}

impl<I: Item> ReplySink<'_, I> {
    async fn ask(mut self, mut groups: Receiver<PreparedGroup<I>>) -> Result<EndReason> {
        let mut waiting = VecDeque::<PreparedTrial<I>>::new();
        let mut asking = JoinSet::<Finished<I>>::new();
        let mut interrupt = Interrupt::listen()?;
        let mut more = true;
        loop {
            while asking.len() < self.dispatcher.width()
                && let Some(ready) = waiting.pop_front()
            {
                let model = &self.dispatcher.models[ready.trial.model];
                if self.breaker.retired(ready.trial.model) {
                    continue;
                }
                let likely = self.expected_tokens(&ready);
                let place = ready.trial.model;
                if !self.budget.can_afford(
                    asking.len(),
                    place,
                    likely,
                    ready.trial.item.reply_tokens(),
                ) {
                    waiting.push_front(ready);
                    break;
                }
                asking.spawn(send(model.clone(), ready));
            }
            if asking.is_empty() && !waiting.is_empty() {
                self.breaker.spent();
            }
            let through = !more && waiting.is_empty() && asking.is_empty();
            if through || self.breaker.stopped() {
                break;
            }
            let state = match asking.len() {
                0 => Some(TimedStep::Idle),
                n if n >= self.dispatcher.width() => Some(TimedStep::Full),
                _ => None,
            };
            let since = Instant::now();
            tokio::select! {
                () = interrupt.next() => self.breaker.interrupted(),
                Some(done) = asking.join_next() => {
                    self.waited(state, since);
                    self.keep(done)?;
                }
                group = groups.recv(), if more && waiting.is_empty() => match group {
                    Some(group) => {
                        self.waited(state, since);
                        waiting.extend(self.accept(group)?);
                    }
                    None => more = false,
                },
            }
        }
        // The image pipeline ends as soon as nobody waits for its groups.
        drop(groups);
        if self.breaker.stopped() {
            self.stoppers.iter().for_each(Stopper::stop);
            self.drain(asking, interrupt).await?;
        }
        self.store.sync()?;
        Ok(self.breaker.into_end())
    }

    /// Takes note of how long it waited, and in what state.
    fn waited(&self, state: Option<TimedStep>, since: Instant) {
        if let Some(state) = state {
            self.dispatcher.timings.add(state, since.elapsed());
        }
    }

    /// Waits for the requests on the wire, for they may be paid for already; a second interrupt gives them up. What
    /// waits for its turn or for a retry is given up at once.
    async fn drain(
        &mut self,
        mut asking: JoinSet<Finished<I>>,
        mut interrupt: Interrupt,
    ) -> Result<()> {
        if !asking.is_empty() {
            let count = asking.len();
            self.dispatcher.progress.say(&format!(
                "stopping: {count} requests are in flight; interrupt again to give them up"
            ));
        }
        for model in self.dispatcher.models {
            model.model.close();
        }
        while !asking.is_empty() {
            tokio::select! {
                () = interrupt.next() => asking.abort_all(),
                Some(done) = asking.join_next() => self.keep(done)?,
            }
        }
        Ok(())
    }

    /// How many tokens the prompt of a trial is likely to have.
    fn expected_tokens(&self, ready: &PreparedTrial<I>) -> f64 {
        let model = &self.dispatcher.models[ready.trial.model];
        let images = ready.stimulus.images.iter().map(|image| image.facts());
        self.budget.expected_tokens(model, &ready.trial, images)
    }

    /// Makes trials ready to be asked, or failures out of those without their images.
    fn accept(&mut self, group: PreparedGroup<I>) -> Result<Vec<PreparedTrial<I>>> {
        let PreparedGroup {
            stimulus,
            trials,
            problem,
            thumbnail,
        } = group;
        if let Some(thumbnail) = thumbnail {
            self.store.append_thumbnail(&thumbnail)?;
        }
        let stimulus = Arc::new(stimulus);
        let ready = trials.into_iter().map(|trial| PreparedTrial {
            trial,
            stimulus: Arc::clone(&stimulus),
        });
        let Some(message) = problem else {
            return Ok(ready.collect());
        };
        let error = AskError {
            failure: Failure {
                kind: FailureKind::Image,
                status: None,
                message,
            },
            attempts: 0,
            reach: Reach::Trial,
            refused_field: None,
        };
        for ready in ready {
            self.keep(Ok((ready, Err(error.clone()))))?;
        }
        Ok(Vec::new())
    }

    /// Keeps what came of one trial.
    fn keep(&mut self, done: Result<Finished<I>, JoinError>) -> Result<()> {
        let (ready, result) = match done {
            Ok(done) => done,
            Err(aborted) if aborted.is_cancelled() => return Ok(()),
            Err(panic) => std::panic::resume_unwind(panic.into_panic()),
        };
        let trial = &ready.trial;
        match &result {
            Ok(_) => self.breaker.succeeded(trial.model),
            Err(error) => {
                self.breaker.failed(trial.model, error, trial.item.place());
                // Where the model itself is at fault or the run ends, the trial was never really made.
                if error.reach != Reach::Trial {
                    return Ok(());
                }
            }
        }
        if let Ok(reply) = &result {
            self.answered += 1;
            self.cut.note(reply);
            let (model, likely) = (ready.trial.model, self.expected_tokens(&ready));
            self.budget
                .book(model, reply.usage, likely, ready.trial.item.reply_tokens());
        }
        self.bar
            .count(self.answered, self.breaker.failures(), self.budget.spent());
        let model = &self.dispatcher.models[ready.trial.model];
        let blank = I::blank(&ready.trial, &ready.stimulus, model.model.name());
        self.store.append(&match result {
            Ok(reply) => blank.answered(reply)?,
            Err(error) => blank.failed_by(error.failure, error.attempts),
        })
    }
}

/// Puts one question to its model.
async fn send<I: Item>(model: ModelUnderTest, ready: PreparedTrial<I>) -> Finished<I> {
    let PreparedTrial { trial, stimulus } = &ready;
    let call = Call {
        query: trial.item.query(),
        condition: stimulus.condition.as_ref(),
        message: trial.prompt.message(&stimulus.images),
        turn: trial.item.turn(),
    };
    let result = model.model.ask(call).await;
    (ready, result)
}
