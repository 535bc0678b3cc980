//! The asynchronous side: asks about what the darkroom has made, and keeps every reply the moment it arrives.

use std::collections::VecDeque;
use std::sync::Arc;

use rayon::ThreadPoolBuilder;
use tokio::runtime;
use tokio::sync::mpsc::{self, Receiver};
use tokio::task::{JoinError, JoinSet};

use super::askers::Asker;
use super::darkroom::{Darkroom, Exposed};
use super::gallery::Gallery;
use super::interrupt::Interrupt;
use super::ledger::Ledger;
use super::plan::{Plan, Trial};
use super::progress::{Bar, Progress};
use super::recipe::Recipe;
use super::record;
use super::stop::{End, Watch};
use super::thumbnail::Wanted;
use crate::ask::{AskError, Call, ImageLimit, Payload, Reach};
use crate::config::Config;
use crate::dataset::Dataset;
use crate::enhance::{Enhancer, Stopper};
use crate::error::{Error, Result};
use crate::store::Store;
use crate::types::{Condition, Failure, FailureKind, Finish, ImageFacts, Reply, View};

/// How many finished images may wait to be asked about.
const IMAGES_AHEAD: usize = 2;

/// What a run is driven with.
pub(super) struct Drive<'a> {
    pub(super) config: &'a Config,
    pub(super) dataset: &'a Dataset,
    pub(super) pictures: &'a Gallery,
    pub(super) recipe: &'a Recipe,
    pub(super) askers: &'a [Asker],
    pub(super) progress: &'a Progress,
    /// What an image may be that leaves the machine.
    pub(super) limit: Option<ImageLimit>,
    /// The small copies that are to be kept.
    pub(super) wanted: &'a Wanted,
}

/// One trial with the image that it shares.
pub(super) struct Ready {
    pub(super) trial: Trial,
    pub(super) view: View,
    pub(super) condition: Option<Condition>,
    pub(super) image: Option<Arc<Payload>>,
}

/// One trial with what came of it.
type Done = (Ready, Result<Reply, AskError>);

impl Drive<'_> {
    /// Asks everything that is left.
    pub(super) fn run(
        &self,
        plan: Plan,
        enhancers: Vec<Enhancer>,
        ledger: Ledger,
        store: &mut Store,
    ) -> Result<End> {
        if plan.left() == 0 {
            return Ok(End::Through);
        }
        let unstarted = |e: &dyn std::fmt::Display| {
            Error::usage("--threads", format_args!("cannot be started: {e}"))
        };
        let threads = self.config.enhancement.threads.map_or(0, usize::from);
        let cores = ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .map_err(|e| unstarted(&e))?;
        let runtime = runtime::Builder::new_multi_thread()
            .enable_all()
            .build()
            .map_err(|e| unstarted(&e))?;
        let (out, images) = mpsc::channel(IMAGES_AHEAD);
        let bar = self
            .progress
            .trials(plan.trials(), plan.trials() - plan.left());
        let stoppers: Vec<Stopper> = enhancers.iter().map(Enhancer::stopper).collect();
        let mut darkroom = Darkroom {
            dataset: self.dataset,
            pictures: self.pictures,
            recipe: self.recipe,
            enhancers,
            limit: self.limit,
        };
        cores.install(|| darkroom.rehearse(&plan.frames))?;
        if self.limit.is_some() {
            let largest = cores.install(|| darkroom.largest(&plan.frames))?;
            warn_of_large(largest.as_ref(), self.limit);
        }
        let intake = Intake {
            drive: self,
            store,
            bar,
            watch: self.watch(),
            ledger,
            stoppers,
            answered: plan.trials() - plan.left(),
            cut: Cut::default(),
        };
        std::thread::scope(|scope| {
            scope.spawn(move || cores.install(|| darkroom.develop(plan.frames, self.wanted, &out)));
            runtime.block_on(intake.ask(images))
        })
    }

    /// How many questions may be under way now.
    fn width(&self) -> usize {
        let widths = self.askers.iter().filter_map(|asker| asker.model.width());
        // Models of one endpoint share its window.
        widths.max().unwrap_or(self.config.pace.concurrency.most())
    }

    fn watch(&self) -> Watch {
        let server = self.config.ask.server.as_ref();
        let endpoint = server.map_or("built-in models".to_owned(), |server| {
            server.access.base.to_string()
        });
        let pace = &self.config.pace;
        Watch::new(
            endpoint,
            self.askers,
            pace.concurrency.most(),
            pace.max_failures,
        )
    }
}

/// Where replies come in and are kept.
struct Intake<'a> {
    drive: &'a Drive<'a>,
    store: &'a mut Store,
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

impl Intake<'_> {
    async fn ask(mut self, mut images: Receiver<Exposed>) -> Result<End> {
        let mut waiting = VecDeque::<Ready>::new();
        let mut asking = JoinSet::<Done>::new();
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
                if !self.ledger.affords(asking.len(), ready.trial.asker, likely) {
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
            tokio::select! {
                () = interrupt.next() => self.watch.interrupted(),
                Some(done) = asking.join_next() => self.keep(done)?,
                exposed = images.recv(), if more && waiting.is_empty() => match exposed {
                    Some(exposed) => waiting.extend(self.accept(exposed)?),
                    None => more = false,
                },
            }
        }
        // The darkroom ends as soon as nobody waits for its images.
        drop(images);
        if self.watch.stopped() {
            self.stoppers.iter().for_each(Stopper::stop);
            self.drain(asking, interrupt).await?;
        }
        self.store.sync()?;
        Ok(self.watch.into_end())
    }

    /// Waits for the requests on the wire, for they may be paid for already; a second interrupt gives them up. What
    /// waits for its turn or for a retry is given up at once.
    async fn drain(&mut self, mut asking: JoinSet<Done>, mut interrupt: Interrupt) -> Result<()> {
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
    fn likely(&self, ready: &Ready) -> f64 {
        let asker = &self.drive.askers[ready.trial.asker];
        let image = ready.image.as_ref().map(|image| image.facts());
        self.ledger.likely(asker, &ready.trial, image)
    }

    /// Makes trials out of an image, or failures out of a failed one.
    fn accept(&mut self, exposed: Exposed) -> Result<Vec<Ready>> {
        let Exposed {
            condition,
            trials,
            image,
            thumbnail,
        } = exposed;
        if let Some(thumbnail) = thumbnail {
            self.store.append_thumbnail(&thumbnail)?;
        }
        let (image, broken) = match image {
            Ok(image) => (image, None),
            Err(e) => (None, Some(e.to_string())),
        };
        let view = if condition.is_some() {
            View::Image
        } else {
            View::Blind
        };
        let ready = trials.into_iter().map(|trial| Ready {
            trial,
            view,
            condition: condition.clone(),
            image: image.clone(),
        });
        let Some(message) = broken else {
            return Ok(ready.collect());
        };
        for ready in ready {
            let failure = Failure {
                kind: FailureKind::Image,
                status: None,
                message: message.clone(),
            };
            self.keep(Ok((
                ready,
                Err(AskError {
                    failure,
                    attempts: 0,
                    reach: Reach::Trial,
                    refused: None,
                }),
            )))?;
        }
        Ok(Vec::new())
    }

    /// Keeps what came of one trial.
    fn keep(&mut self, done: Result<Done, JoinError>) -> Result<()> {
        let (ready, result) = match done {
            Ok(done) => done,
            Err(aborted) if aborted.is_cancelled() => return Ok(()),
            Err(panic) => std::panic::resume_unwind(panic.into_panic()),
        };
        let trial = &ready.trial;
        match &result {
            Ok(_) => self.watch.succeeded(trial.asker),
            Err(error) => {
                self.watch.failed(trial.asker, error, &trial.question.frame);
                // Where the model itself is at fault or the run ends, the trial was never really made.
                if error.reach != Reach::Trial {
                    return Ok(());
                }
            }
        }
        if let Ok(reply) = &result {
            self.answered += 1;
            self.cut.note(reply);
            self.ledger
                .book(ready.trial.asker, reply.usage, self.likely(&ready));
        }
        self.bar
            .count(self.answered, self.watch.failures(), self.ledger.spent());
        let asker = &self.drive.askers[ready.trial.asker];
        let image = ready.image.as_ref().map(|image| image.facts());
        let model = asker.model.name();
        let blank = record::blank(&ready.trial, ready.view, ready.condition, model, image);
        self.store.append(&match result {
            Ok(reply) => record::answered(blank, reply)?,
            Err(error) => record::failed(blank, error.failure, error.attempts),
        })
    }
}

/// Images from this size on, in bytes, are more than some servers and proxies take.
const LARGE: usize = 5_000_000;

/// Says so where images are large and nobody knows whether the endpoint takes them.
fn warn_of_large(largest: Option<&ImageFacts>, limit: Option<ImageLimit>) {
    if let Some(image) = largest
        && image.bytes > LARGE
        && limit == Some(ImageLimit::UNKNOWN)
    {
        tracing::warn!(
            "images are up to {:.1} MB, {:.1} MB as sent; where the server answers 413, --max-side or --image jpeg:95 makes them smaller",
            image.bytes as f64 / 1e6,
            image.bytes as f64 / 0.75e6
        );
    }
}

/// Puts one question to its model.
async fn put(asker: Asker, ready: Ready) -> Done {
    let call = Call {
        question: &ready.trial.question,
        condition: ready.condition.as_ref(),
        prompt: &ready.trial.prompt,
        image: ready.image.as_deref(),
        turn: ready.trial.turn,
    };
    let result = asker.model.ask(call).await;
    (ready, result)
}
