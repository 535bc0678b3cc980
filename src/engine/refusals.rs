//! Trials that the server refused for a cause that it does not name: [`Refusals`].
//!
//! A refusal (4xx) may concern the image and the question of one trial, as a filter of the server does under any words;
//! or every request of the run. What else the model does tells them apart: the trial waits until the model answers
//! another one, and is then asked once more. If it is refused again for the same cause, the server refuses this content
//! and will do so again: the trial counts as a reply that a filter withheld, as if the server had sent the filter as
//! its finish reason. Refused requests cost nothing. Later trials with the same cause are not asked twice. If the model
//! answers nothing, the refusals stay failures, and the circuit breaker stops the model.
//!
//! The first failure of each kind, to describe it at the end of a run: [`FirstFailures`].

use std::collections::{BTreeMap, BTreeSet};

use super::lanes::Finished;
use super::models::ModelUnderTest;
use crate::lanes::PreparedTrial;
use darkqa_ask::{AskError, Reach};
use darkqa_base::types::{Failure, FailureKind, TrialKey};

/// Status and cause of a refusal.
type RefusalCause = (u16, String);

/// A trial that was refused, and waits for another answer of its model.
struct WaitingTrial<I> {
    ready: PreparedTrial<I>,
    error: AskError,
    cause: RefusalCause,
}

impl<I> WaitingTrial<I> {
    fn is_by_status(&self) -> bool {
        self.error.reach == Reach::ByStatus
    }
}

/// Number of trials refused by a status at the end of a run, without a later answer, from which on the key may be the
/// cause; chosen.
const STATUS_REFUSALS_AT_END: usize = 3;

/// Refused trials of one model.
struct OfModel<I> {
    has_answered: bool,
    waiting: Vec<WaitingTrial<I>>,
    /// The first refusal of each trial that was asked again.
    again: BTreeMap<TrialKey, (RefusalCause, AskError)>,
    /// Causes for which a trial was refused twice, with an answer to another trial in between.
    confirmed: BTreeSet<RefusalCause>,
}

/// Refused trials of all models.
pub(super) struct Refusals<I> {
    models: Vec<OfModel<I>>,
    /// Trials to ask again.
    released: Vec<PreparedTrial<I>>,
}

impl<I> Refusals<I> {
    pub(super) fn new(models: usize) -> Self {
        let of_model = |_| OfModel {
            has_answered: false,
            waiting: Vec::new(),
            again: BTreeMap::new(),
            confirmed: BTreeSet::new(),
        };
        Self { models: (0..models).map(of_model).collect(), released: Vec::new() }
    }

    /// True if the cause of a refusal is not known yet, so that the trial waits for another answer of its model.
    pub(super) fn must_wait(&self, ready: &PreparedTrial<I>, error: &AskError) -> bool {
        let model = &self.models[ready.trial.model];
        let Some(cause) = unknown_cause(error) else {
            return false;
        };
        // The same words may come from a key that was revoked in the meantime: only another answer shows that it was
        // not.
        let is_known = model.confirmed.contains(&cause) && error.reach == Reach::Trial;
        !is_known && !model.again.contains_key(&ready.trial.key)
    }

    /// Adds a trial that waits.
    pub(super) fn add(&mut self, ready: PreparedTrial<I>, error: AskError) {
        if let Some(cause) = unknown_cause(&error) {
            self.models[ready.trial.model].waiting.push(WaitingTrial { ready, error, cause });
        }
    }

    /// The result of a trial that does not wait, and the results of waiting trials that follow from it. A refusal of
    /// the content becomes a reply.
    pub(super) fn settle(&mut self, (ready, result): Finished<I>) -> Vec<Finished<I>> {
        let model = &mut self.models[ready.trial.model];
        let earlier = model.again.remove(&ready.trial.key);
        let mut settled = Vec::new();
        let result = match result {
            Ok(mut reply) => {
                model.has_answered = true;
                if let Some((_, first)) = earlier {
                    reply.attempts += first.attempts;
                    reply.lost = reply.lost.plus(*first.lost);
                }
                settled.extend(model.filtered(true));
                self.released.extend(model.release(true));
                Ok(reply)
            }
            Err(error) => {
                let cause = unknown_cause(&error);
                let is_same = matches!((&earlier, &cause), (Some((first, _)), Some(second)) if first == second);
                let is_known = cause.as_ref().is_some_and(|cause| model.confirmed.contains(cause));
                let error = match earlier {
                    Some((_, first)) => AskError {
                        attempts: error.attempts + first.attempts,
                        lost: Box::new(error.lost.plus(*first.lost)),
                        ..error
                    },
                    None => error,
                };
                if let Some(cause) = cause.filter(|_| is_same) {
                    model.confirmed.insert(cause);
                    // A revoked key has the same words at each try: those of a status wait for the next answer.
                    settled.extend(model.filtered(false));
                }
                if is_same || is_known || error.failure.kind == FailureKind::Filtered {
                    error.into_filtered()
                } else {
                    Err(error)
                }
            }
        };
        settled.insert(0, (ready, result));
        settled
    }

    /// Trials to ask again now.
    pub(super) fn take_released(&mut self) -> Vec<PreparedTrial<I>> {
        std::mem::take(&mut self.released)
    }

    /// Trials to ask again when no others are left: one of each cause, of models that have answered. Several refusals
    /// by a status at the end may have the key as their cause, and stay failures.
    pub(super) fn release_last(&mut self) -> Vec<PreparedTrial<I>> {
        self.models
            .iter_mut()
            .filter(|model| model.has_answered)
            .flat_map(|model| {
                let by_status = model.waiting.iter().filter(|waiting| waiting.is_by_status());
                let is_content = by_status.count() < STATUS_REFUSALS_AT_END;
                model.release(is_content)
            })
            .collect()
    }

    /// Takes the waiting trials out, with their refusals. `is_over` is true if all others were asked: then the refusals
    /// concern every request.
    pub(super) fn take_rest(&mut self, is_over: bool) -> Vec<Finished<I>> {
        self.models
            .iter_mut()
            .flat_map(|model| std::mem::take(&mut model.waiting))
            .map(|WaitingTrial { ready, error, .. }| {
                let reach = match error.reach {
                    Reach::ByStatus if is_over => Reach::Endpoint,
                    reach => reach,
                };
                (ready, Err(AskError { reach, ..error }))
            })
            .collect()
    }
}

impl<I> OfModel<I> {
    /// Takes one waiting trial of each cause that no trial is asked again for; those refused by a status only if
    /// `by_status`.
    fn release(&mut self, by_status: bool) -> Vec<PreparedTrial<I>> {
        let mut causes: BTreeSet<RefusalCause> = self.again.values().map(|(cause, _)| cause.clone()).collect();
        let mut released = Vec::new();
        for waiting in std::mem::take(&mut self.waiting) {
            let is_open = by_status || !waiting.is_by_status();
            if is_open && causes.insert(waiting.cause.clone()) {
                let WaitingTrial { ready, error, cause } = waiting;
                self.again.insert(ready.trial.key, (cause, error));
                released.push(ready);
            } else {
                self.waiting.push(waiting);
            }
        }
        released
    }

    /// Takes the waiting trials of confirmed causes, as replies that a filter withheld; those refused by a status only
    /// if `by_status`.
    fn filtered(&mut self, by_status: bool) -> Vec<Finished<I>> {
        let confirmed = &self.confirmed;
        let (known, rest) = std::mem::take(&mut self.waiting).into_iter().partition(|waiting: &WaitingTrial<I>| {
            confirmed.contains(&waiting.cause) && (by_status || !waiting.is_by_status())
        });
        self.waiting = rest;
        known.into_iter().map(|WaitingTrial { ready, error, .. }| (ready, error.into_filtered())).collect()
    }
}

/// The cause of a refusal that may concern the content, if it is not known to be moderation; `None` for other errors.
fn unknown_cause(error: &AskError) -> Option<RefusalCause> {
    let is_open = error.failure.kind == FailureKind::Request && matches!(error.reach, Reach::Trial | Reach::ByStatus);
    let refusal = error.refusal.as_ref().filter(|_| is_open)?;
    Some((refusal.status, refusal.cause.clone()))
}

/// First failure of each model and kind. Images that cannot be made are the same for all models.
#[derive(Debug, Default)]
pub(super) struct FirstFailures(BTreeMap<(usize, FailureKind), TrialFailure>);

/// Frame or walk of a failed trial, and the message of its failure.
#[derive(Debug)]
struct TrialFailure {
    source: String,
    message: String,
}

impl FirstFailures {
    /// Adds a failed trial about a frame or walk.
    pub(super) fn add(&mut self, model: usize, source: &str, failure: &Failure) {
        let model = match failure.kind {
            FailureKind::Image => 0,
            _ => model,
        };
        self.0
            .entry((model, failure.kind))
            .or_insert_with(|| TrialFailure { source: source.to_owned(), message: failure.message.clone() });
    }

    /// Warns about each kind of failure, except of stopped models, whose error describes it.
    pub(super) fn warn(&self, models: &[ModelUnderTest], is_stopped: impl Fn(usize) -> bool) {
        for ((model, kind), failure) in &self.0 {
            let TrialFailure { source, message } = failure;
            if *kind == FailureKind::Image {
                // The message names the frame.
                tracing::warn!("a trial failed: {message}");
            } else if !is_stopped(*model) {
                let model = &models[*model].name;
                tracing::warn!("{model}: a trial about {source} failed: {message}");
            }
        }
    }
}
