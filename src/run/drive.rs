//! The asynchronous side: asks about what the darkroom has made, and keeps every reply the moment it arrives.

use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Instant;

use tokio::runtime;
use tokio::sync::mpsc::{self, Receiver, Sender};
use tokio::task::{JoinError, JoinSet};

use super::askers::Asker;
use super::cores::unstarted;
use super::interrupt::Interrupt;
use super::ledger::Ledger;
use super::progress::{Bar, Progress};
use super::stop::{End, Watch};
use super::timings::{Step, Timings};
use super::trial::{Exposed, Item, Slide, Trial};
use crate::ask::{AskError, Call, Reach};
use crate::config::Pace;
use crate::enhance::Stopper;
use crate::error::Result;
use crate::store::Store;
use crate::types::{Failure, FailureKind, Finish, Reply};

/// How many finished slides may wait to be asked about.
const SLIDES_AHEAD: usize = 2;

/// What a run is driven with.
pub(super) struct Drive<'a> {
    pub(super) askers: &'a [Asker],
    pub(super) progress: &'a Progress,
    pub(super) pace: &'a Pace,
    /// Where the models are asked, for messages.
    pub(super) endpoint: String,
    pub(super) timings: &'a Timings,
}

/// How far a run has come.
#[derive(Debug, Clone, Copy)]
pub(super) struct Tally {
    /// All trials.
    pub(super) trials: usize,
    /// Those that have a reply.
    pub(super) answered: usize,
}

/// One trial with the slide that it shares.
struct Ready<I> {
    trial: Trial<I>,
    slide: Arc<Slide>,
}

/// One trial with what came of it.
type Done<I> = (Ready<I>, Result<Reply, AskError>);

impl Drive<'_> {
    /// Asks what `make` hands out, which works on a thread of its own until nobody takes its slides any more; `stoppers`
    /// end what it is at.
    pub(super) fn run<I: Item>(
        &self,
        tally: Tally,
        ledger: Ledger,
        store: &mut Store<I::Detail>,
        stoppers: Vec<Stopper>,
        make: impl FnOnce(&Sender<Exposed<I>>) + Send,
    ) -> Result<End> {
        let runtime = runtime::Builder::new_multi_thread()
            .enable_all()
            .build()
            .map_err(|e| unstarted(&e))?;
        let (out, slides) = mpsc::channel(SLIDES_AHEAD);
        let intake = Intake::<I> {
            drive: self,
            store,
            bar: self.progress.trials(tally.trials, tally.answered),
            watch: self.watch(),
            ledger,
            stoppers,
            answered: tally.answered,
            cut: Cut::default(),
        };
        std::thread::scope(|scope| {
            scope.spawn(move || make(&out));
            runtime.block_on(intake.ask(slides))
        })
    }

    /// How many questions may be under way now.
    fn width(&self) -> usize {
        let widths = self.askers.iter().filter_map(|asker| asker.model.width());
        // Models of one endpoint share its window.
        widths.max().unwrap_or(self.pace.concurrency.most())
    }

    fn watch(&self) -> Watch {
        Watch::new(
            self.endpoint.clone(),
            self.askers,
            self.pace.concurrency.most(),
            self.pace.max_failures,
        )
    }
}

/// Where replies come in and are kept.
struct Intake<'a, I: Item> {
    drive: &'a Drive<'a>,
    store: &'a mut Store<I::Detail>,
    bar: Bar,
    watch: Watch,
    ledger: Ledger,
    stoppers: Vec<Stopper>,
    /// Trials with a reply, those of earlier calls included.
    answered: usize,
    cut: Cut,
}

/// Counts replies that the token limit cut before an answer: the first ones tell whether it is too low.
#[derive(Debug, Default)]
struct Cut {
    replies: usize,
    cut: usize,
}

impl Cut {
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

impl<I: Item> Intake<'_, I> {
    async fn ask(mut self, mut slides: Receiver<Exposed<I>>) -> Result<End> {
        let mut waiting = VecDeque::<Ready<I>>::new();
        let mut asking = JoinSet::<Done<I>>::new();
        let mut interrupt = Interrupt::listen()?;
        let mut more = true;
        loop {
            while asking.len() < self.drive.width()
                && let Some(ready) = waiting.pop_front()
            {
                let asker = &self.drive.askers[ready.trial.asker];
                if self.watch.retired(ready.trial.asker) {
                    continue;
                }
                let likely = self.likely(&ready);
                let place = ready.trial.asker;
                if !self.ledger.affords(asking.len(), place, likely, I::REPLY) {
                    waiting.push_front(ready);
                    break;
                }
                asking.spawn(put(asker.clone(), ready));
            }
            if asking.is_empty() && !waiting.is_empty() {
                self.watch.spent();
            }
            let through = !more && waiting.is_empty() && asking.is_empty();
            if through || self.watch.stopped() {
                break;
            }
            let state = match asking.len() {
                0 => Some(Step::Idle),
                n if n >= self.drive.width() => Some(Step::Full),
                _ => None,
            };
            let since = Instant::now();
            tokio::select! {
                () = interrupt.next() => self.watch.interrupted(),
                Some(done) = asking.join_next() => {
                    self.waited(state, since);
                    self.keep(done)?;
                }
                exposed = slides.recv(), if more && waiting.is_empty() => match exposed {
                    Some(exposed) => {
                        self.waited(state, since);
                        waiting.extend(self.accept(exposed)?);
                    }
                    None => more = false,
                },
            }
        }
        // The darkroom ends as soon as nobody waits for its slides.
        drop(slides);
        if self.watch.stopped() {
            self.stoppers.iter().for_each(Stopper::stop);
            self.drain(asking, interrupt).await?;
        }
        self.store.sync()?;
        Ok(self.watch.into_end())
    }

    /// Takes note of how long it waited, and in what state.
    fn waited(&self, state: Option<Step>, since: Instant) {
        if let Some(state) = state {
            self.drive.timings.add(state, since.elapsed());
        }
    }

    /// Waits for the requests on the wire, for they may be paid for already; a second interrupt gives them up. What
    /// waits for its turn or for a retry is given up at once.
    async fn drain(
        &mut self,
        mut asking: JoinSet<Done<I>>,
        mut interrupt: Interrupt,
    ) -> Result<()> {
        if !asking.is_empty() {
            let count = asking.len();
            self.drive.progress.say(&format!(
                "stopping: {count} requests are in flight; interrupt again to give them up"
            ));
        }
        for asker in self.drive.askers {
            asker.model.close();
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
    fn likely(&self, ready: &Ready<I>) -> f64 {
        let asker = &self.drive.askers[ready.trial.asker];
        let images = ready.slide.images.iter().map(|image| image.facts());
        self.ledger.likely(asker, &ready.trial, images)
    }

    /// Makes trials ready to be asked, or failures out of those without their images.
    fn accept(&mut self, exposed: Exposed<I>) -> Result<Vec<Ready<I>>> {
        let Exposed {
            slide,
            trials,
            problem,
            thumbnail,
        } = exposed;
        if let Some(thumbnail) = thumbnail {
            self.store.append_thumbnail(&thumbnail)?;
        }
        let slide = Arc::new(slide);
        let ready = trials.into_iter().map(|trial| Ready {
            trial,
            slide: Arc::clone(&slide),
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
            refused: None,
        };
        for ready in ready {
            self.keep(Ok((ready, Err(error.clone()))))?;
        }
        Ok(Vec::new())
    }

    /// Keeps what came of one trial.
    fn keep(&mut self, done: Result<Done<I>, JoinError>) -> Result<()> {
        let (ready, result) = match done {
            Ok(done) => done,
            Err(aborted) if aborted.is_cancelled() => return Ok(()),
            Err(panic) => std::panic::resume_unwind(panic.into_panic()),
        };
        let trial = &ready.trial;
        match &result {
            Ok(_) => self.watch.succeeded(trial.asker),
            Err(error) => {
                self.watch.failed(trial.asker, error, trial.item.place());
                // Where the model itself is at fault or the run ends, the trial was never really made.
                if error.reach != Reach::Trial {
                    return Ok(());
                }
            }
        }
        if let Ok(reply) = &result {
            self.answered += 1;
            self.cut.note(reply);
            let (asker, likely) = (ready.trial.asker, self.likely(&ready));
            self.ledger.book(asker, reply.usage, likely, I::REPLY);
        }
        self.bar
            .count(self.answered, self.watch.failures(), self.ledger.spent());
        let asker = &self.drive.askers[ready.trial.asker];
        let blank = I::blank(&ready.trial, &ready.slide, asker.model.name());
        self.store.append(&match result {
            Ok(reply) => blank.answered(reply)?,
            Err(error) => blank.failed_by(error.failure, error.attempts),
        })
    }
}

/// Puts one question to its model.
async fn put<I: Item>(asker: Asker, ready: Ready<I>) -> Done<I> {
    let Ready { trial, slide } = &ready;
    let call = Call {
        query: trial.item.query(),
        condition: slide.condition.as_ref(),
        message: trial.prompt.message(&slide.images),
        turn: trial.item.turn(),
    };
    let result = asker.model.ask(call).await;
    (ready, result)
}
