//! Reasons to stop asking before the plan ends: [`CircuitBreaker`], [`EndReason`].
//!
//! Images for which a server fails repeatedly: [`Suspects`].

use std::collections::{BTreeMap, BTreeSet};

use crate::models::ModelUnderTest;
use darkqa_ask::{AskError, Reach};
use darkqa_base::error::Error;
use darkqa_base::types::manifests::{Counts, Status};
use darkqa_base::types::{Failure, FailureKind};

/// Number of failed trials after which a model without any success is stopped, because further trials would fail, too.
const FAILURES_AT_START: usize = 5;

/// Minimum number of consecutive failures after which a model that has succeeded before is stopped. Servers recover
/// from shorter outages.
const FAILURES_IN_A_ROW: usize = 20;

/// Maximum number of consecutive failures about one frame or walk that count, because the server may fail for it alone.
/// Chosen: the other trials about it are set aside after as many.
const MAX_FAILURES_PER_SOURCE: usize = 2;

/// Minimum number of frames or walks of refusals in a row that may concern the content, for a model to be stopped;
/// chosen.
const MIN_REFUSED_SOURCES: usize = 3;

/// Reason why no more trials are asked.
#[derive(Debug)]
pub enum EndReason {
    /// All trials of the plan were asked.
    AllAsked,
    /// The user or the batch system interrupted it.
    Interrupted,
    /// The next question could have exceeded `--max-cost`.
    OverBudget,
    /// All models were stopped, too many trials had failed, or this machine had a problem.
    Stopped(Error),
    /// Some models were stopped, for these reasons; the others were asked all trials.
    ModelsStopped(Vec<Error>),
}

impl EndReason {
    /// Status of a run that ended for this reason with these numbers of trials.
    pub fn status(&self, counts: Counts) -> Status {
        match self {
            // Truncated replies that are asked again count as answered.
            Self::OverBudget => Status::OverBudget,
            _ if counts.answered == counts.trials => Status::Complete,
            Self::AllAsked => Status::Incomplete,
            Self::Interrupted => Status::Cancelled,
            Self::Stopped(_) | Self::ModelsStopped(_) => Status::Stopped,
        }
    }
}

/// Successes and failures of one model so far.
#[derive(Debug, Default)]
struct ModelHealth {
    succeeded: bool,
    /// Number of failures since the last success that the server or the network caused.
    outage: usize,
    /// The same failures by frame or walk. One frame may be the cause, so it adds at most [`MAX_FAILURES_PER_SOURCE`]
    /// to `outage`.
    outage_sources: BTreeMap<String, usize>,
    /// Number of requests that the server refused, in the whole run.
    refusals: usize,
    /// Frames or walks of the refused requests. If there is only one, it may be the cause, and the model is not
    /// stopped.
    refused_sources: BTreeSet<String>,
    /// Number of refusals since the last success by a status that concerns every request.
    status_refusals: usize,
    /// Frames or walks of these refusals.
    status_sources: BTreeSet<String>,
    /// True if no more trials of the model are asked.
    stopped: bool,
}

impl ModelHealth {
    /// Counts a refused request.
    fn count_refusal(&mut self, error: &AskError, source: &str) {
        self.refusals += 1;
        self.refused_sources.insert(source.to_owned());
        if error.reach == Reach::ByStatus {
            self.status_refusals += 1;
            self.status_sources.insert(source.to_owned());
        }
    }

    /// True if every further request would be refused, as far as the refusals of this kind show: the model has answered
    /// nothing, or has stopped answering.
    fn is_refused(&self, error: &AskError) -> bool {
        // The content of a frame or two may be the cause.
        let is_by_status = error.reach == Reach::ByStatus
            && self.status_refusals >= FAILURES_AT_START
            && self.status_sources.len() >= MIN_REFUSED_SOURCES;
        let is_first = !self.succeeded && self.refusals >= FAILURES_AT_START && self.refused_sources.len() > 1;
        is_by_status || is_first
    }
}

/// One model with its endpoint and its health.
#[derive(Debug)]
struct ModelState {
    name: String,
    /// Name of the endpoint, for messages.
    endpoint: String,
    health: ModelHealth,
}

/// Counts failed trials, and stops one model or the run when too many have failed.
#[derive(Debug)]
pub struct CircuitBreaker {
    max_failures: Option<usize>,
    /// True if the run ends when the first model is stopped.
    fails_fast: bool,
    /// Number of consecutive failures after which a model that has succeeded before is stopped.
    max_outage: usize,
    models: Vec<ModelState>,
    failures: usize,
    /// True if no more trials of any model are asked.
    stopped: bool,
    end: Option<EndReason>,
    /// The reason for each stopped model.
    model_errors: Vec<Error>,
}

impl CircuitBreaker {
    /// A circuit breaker for these models. Up to `concurrency` requests in flight may fail for the same cause.
    pub fn new(models: &[ModelUnderTest], concurrency: usize, max_failures: Option<usize>) -> Self {
        Self {
            max_failures,
            fails_fast: false,
            max_outage: FAILURES_IN_A_ROW.max(3 * concurrency),
            models: models
                .iter()
                .map(|model| ModelState {
                    name: model.name.to_string(),
                    endpoint: model.endpoint_name(),
                    health: ModelHealth::default(),
                })
                .collect(),
            failures: 0,
            stopped: false,
            end: None,
            model_errors: Vec::new(),
        }
    }

    /// Sets whether the run ends when the first model is stopped.
    #[must_use]
    pub fn with_fail_fast(self, fails_fast: bool) -> Self {
        Self { fails_fast, ..self }
    }

    /// True if no more trials of any model are asked.
    pub fn stopped(&self) -> bool {
        self.stopped
    }

    /// True if no more trials of a model are asked.
    pub fn is_stopped(&self, model: usize) -> bool {
        self.models[model].health.stopped
    }

    /// Number of failed trials.
    pub fn failures(&self) -> usize {
        self.failures
    }

    /// The reason why the run ended; [`EndReason::AllAsked`] if nothing stopped it.
    pub fn into_end(self) -> EndReason {
        match self.end {
            Some(EndReason::Stopped(_)) if !self.stopped => EndReason::ModelsStopped(self.model_errors),
            end => end.unwrap_or(EndReason::AllAsked),
        }
    }

    /// Stops the run because of an interrupt.
    pub fn interrupted(&mut self) {
        self.stop(EndReason::Interrupted);
    }

    /// Stops the run because of this machine: an enhancer cannot be used any further, or a file cannot be written.
    pub fn ended(&mut self, error: Error) {
        self.stop(EndReason::Stopped(error));
    }

    /// Stops the run because one more question could exceed `--max-cost`.
    pub fn over_budget(&mut self) {
        self.stop(EndReason::OverBudget);
    }

    /// Ends the run. The first call decides the reason; it replaces the reason of a model that was stopped before.
    fn stop(&mut self, reason: EndReason) {
        if !self.stopped {
            self.stopped = true;
            self.end = Some(reason);
        }
    }

    /// Records a reply of a model.
    pub fn succeeded(&mut self, model: usize) {
        let health = &mut self.models[model].health;
        (health.succeeded, health.outage) = (true, 0);
        health.outage_sources.clear();
        health.status_refusals = 0;
        health.status_sources.clear();
    }

    /// Records a failed trial about a frame or walk. `may_be_cause` is the result of
    /// [`Suspects::may_be_cause`](Suspects).
    pub fn failed(&mut self, model: usize, error: &AskError, source: &str, may_be_cause: bool) {
        if error.reach == Reach::Interrupted {
            return;
        }
        self.failures += 1;
        if error.failure.kind == FailureKind::Request && error.refusal.is_none() {
            self.models[model].health.count_refusal(error, source);
        }
        self.check(model, error, source, may_be_cause);
    }

    /// Records a refused trial about a frame or walk that waits until the model answers another one. If it fails in the
    /// end, [`failed`](Self::failed) counts it.
    pub fn refused(&mut self, model: usize, error: &AskError, source: &str) {
        self.models[model].health.count_refusal(error, source);
        self.check(model, error, source, false);
    }

    /// Stops a model or the run if the last failure shows that further trials would fail.
    fn check(&mut self, model: usize, error: &AskError, source: &str, may_be_cause: bool) {
        let ModelState { name, endpoint, health } = &mut self.models[model];
        let Failure { kind, message, .. } = &error.failure;
        // The error that ends the run begins with the endpoint.
        let message =
            message.strip_prefix(endpoint.as_str()).and_then(|rest| rest.strip_prefix(": ")).unwrap_or(message);
        match kind {
            // The images or their content are the cause; the next may succeed.
            FailureKind::Image | FailureKind::Filtered | FailureKind::Request => {}
            _ => {
                let source_failures = health.outage_sources.entry(source.to_owned()).or_default();
                *source_failures += 1;
                let counts = *source_failures <= MAX_FAILURES_PER_SOURCE || !may_be_cause || error.is_unconnected();
                health.outage += usize::from(counts);
            }
        }
        let max_outage = if health.succeeded { self.max_outage } else { FAILURES_AT_START };
        let problem = if error.reach == Reach::Endpoint {
            Some(format!("{name}: {message}"))
        } else if health.is_refused(error) && health.succeeded {
            Some(format!("{name}: {} trials in a row were refused: {message}", health.status_refusals))
        } else if health.is_refused(error) {
            Some(format!("{name}: the first {} trials were all refused: {message}", health.refusals))
        } else if health.outage >= max_outage {
            Some(format!("{name}: {} trials in a row failed: {message}", health.outage))
        } else {
            None
        };
        // Replies that were in flight may fail after the model was stopped.
        let is_newly_stopped = problem.is_some() && !health.stopped;
        health.stopped |= problem.is_some();
        let too_many = self.max_failures.is_some_and(|max| self.failures >= max);
        let too_many = too_many.then(|| {
            format!("the limit of failed trials is reached (--stop failures={}); the last: {message}", self.failures)
        });
        let endpoint = endpoint.clone();
        self.stopped |= self.fails_fast && is_newly_stopped;
        self.stopped |= too_many.is_some() || self.models.iter().all(|model| model.health.stopped);
        if let Some(problem) = problem.or(too_many) {
            let how = if error.forced.is_empty() {
                "the same command continues"
            } else {
                "the same command continues; with another value, --resume DIR does"
            };
            let problem = format!("{problem} (replies so far are stored; {how})");
            if is_newly_stopped {
                let (endpoint, problem) = (endpoint.clone(), problem.clone());
                self.model_errors.push(Error::Endpoint { endpoint, problem });
            }
            self.end.get_or_insert(EndReason::Stopped(Error::Endpoint { endpoint, problem }));
        }
    }
}

/// Number of failed trials about an image after which its other trials are asked last. A single failure may have
/// another cause.
const ASIDE_AFTER: usize = 2;

/// Number of failed trials about an image after which no more are asked, if the model answers about other images;
/// chosen.
const GIVEN_UP_AFTER: usize = 3;

/// Counts of failures by model and by frame or walk, to find images that make a server fail.
#[derive(Debug, Default)]
pub struct Suspects {
    /// Number of failures of the server or the network, by model and source.
    failures: BTreeMap<(usize, String), usize>,
    /// Models with the sources that they have answered a trial about. Such a source is not suspected: the server had an
    /// outage.
    answered: BTreeSet<(usize, String)>,
    /// True once only the trials that were set aside are left.
    asks_deferred: bool,
}

impl Suspects {
    /// Records a reply.
    pub fn succeeded(&mut self, model: usize, source: &str) {
        let key = (model, source.to_owned());
        self.failures.remove(&key);
        self.answered.insert(key);
    }

    /// Records a failure, unless its cause cannot be the image. Returns true if the other trials about the image are
    /// set aside from now on.
    pub fn failed(&mut self, model: usize, error: &AskError, source: &str) -> bool {
        use FailureKind::{Connection, Response, Server, Timeout};
        let may_be_image = matches!(error.failure.kind, Connection | Response | Server | Timeout);
        let key = (model, source.to_owned());
        if error.reach != Reach::Trial || !may_be_image || self.answered.contains(&key) {
            return false;
        }
        let count = self.failures.entry(key).or_default();
        *count += 1;
        *count == ASIDE_AFTER && !self.asks_deferred
    }

    /// True if the image alone may be the cause of a failure: the model has not answered about it, and trials about
    /// others are left.
    pub fn may_be_cause(&self, model: usize, source: &str) -> bool {
        !self.asks_deferred && !self.answered.contains(&(model, source.to_owned()))
    }

    /// True if the trials about a source wait until all others have been asked.
    pub fn is_deferred(&self, model: usize, source: &str) -> bool {
        !self.asks_deferred && self.count(model, source) >= ASIDE_AFTER
    }

    /// True if no more trials about a source are asked in this call, because the server fails for it and answers
    /// others.
    pub fn is_given_up(&self, model: usize, source: &str) -> bool {
        self.asks_deferred && self.has_answered(model) && self.count(model, source) >= GIVEN_UP_AFTER
    }

    /// Begins the trials that were set aside; no others are left.
    pub fn start_deferred(&mut self) {
        self.asks_deferred = true;
    }

    /// True if a model has answered any trial.
    pub fn has_answered(&self, model: usize) -> bool {
        self.answered.range((model, String::new())..).next().is_some_and(|(answered, _)| *answered == model)
    }

    fn count(&self, model: usize, source: &str) -> usize {
        let key = (model, source.to_owned());
        self.failures.get(&key).copied().unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use darkqa_ask::{Model, Random};
    use darkqa_base::types::View;

    fn breaker(models: usize, max_failures: Option<usize>) -> CircuitBreaker {
        let model = |_| ModelUnderTest::new(Model::Random(Random { seed: 0 }), View::Image, None).unwrap();
        let models: Vec<ModelUnderTest> = (0..models).map(model).collect();
        CircuitBreaker::new(&models, 2, max_failures)
    }

    /// Error of a request that was sent.
    fn error(kind: FailureKind, reach: Reach) -> AskError {
        AskError { reach, may_have_effect: true, ..AskError::new(kind, "no".into()) }
    }

    /// True if one of two models is stopped after `times` failures, about `frames` frames.
    fn stopped_after(kind: FailureKind, times: usize, frames: usize, succeeded: bool) -> bool {
        let mut breaker = breaker(2, None);
        if succeeded {
            breaker.succeeded(0);
        }
        for i in 0..times {
            breaker.succeeded(1);
            breaker.failed(0, &error(kind, Reach::Trial), &(i % frames).to_string(), true);
        }
        assert!(!breaker.stopped(), "the other model continues");
        breaker.is_stopped(0)
    }

    #[test]
    fn an_interrupt_after_one_model_was_stopped_is_the_end() {
        let mut breaker = breaker(2, None);
        for i in 0..5 {
            breaker.succeeded(1);
            let failure = error(FailureKind::Server, Reach::Trial);
            breaker.failed(0, &failure, &i.to_string(), true);
        }
        assert!(breaker.is_stopped(0) && !breaker.stopped());
        breaker.interrupted();
        breaker.over_budget();
        assert!(matches!(breaker.into_end(), EndReason::Interrupted));
    }

    #[test]
    fn a_model_that_cannot_be_asked_is_stopped_and_the_others_continue() {
        use FailureKind::{Connection, Image, Request, Server};
        for kind in [Connection, Server] {
            assert!(stopped_after(kind, 5, 3, false), "{kind:?}");
            assert!(!stopped_after(kind, 99, 1, false), "one frame may be the cause: {kind:?}");
            assert!(!stopped_after(kind, 4, 4, false));
            assert!(stopped_after(kind, 20, 10, true) && !stopped_after(kind, 19, 19, true));
        }
        assert!(stopped_after(Request, 5, 2, false));
        assert!(!stopped_after(Request, 9, 1, false), "one frame may be the cause");
        assert!(!stopped_after(Request, 99, 99, true), "others succeeded");
        assert!(!stopped_after(Image, 99, 99, false), "the images are the cause");
    }

    #[test]
    fn failures_about_one_frame_count_if_it_is_not_the_cause() {
        let failure = error(FailureKind::Server, Reach::Trial);
        for (may_be_cause, is_stopped) in [(true, false), (false, true)] {
            let mut breaker = breaker(1, None);
            breaker.succeeded(0);
            for _ in 0..20 {
                breaker.failed(0, &failure, "a", may_be_cause);
            }
            assert_eq!(breaker.is_stopped(0), is_stopped);
        }
    }

    #[test]
    fn failures_to_connect_count_whatever_their_text() {
        for (may_have_effect, message, is_stopped) in
            [(false, "dns error: failed to lookup address", true), (true, "broken after a tcp connect error", false)]
        {
            let failure = AskError { may_have_effect, ..AskError::new(FailureKind::Connection, message.into()) };
            let mut breaker = breaker(1, None);
            breaker.succeeded(0);
            for _ in 0..20 {
                breaker.failed(0, &failure, "a", true);
            }
            assert_eq!(breaker.is_stopped(0), is_stopped, "{message}");
        }
    }

    #[test]
    fn a_success_ends_an_outage() {
        let mut breaker = breaker(1, None);
        for i in 0..100 {
            if i % 10 == 0 {
                breaker.succeeded(0);
            }
            breaker.failed(0, &error(FailureKind::Server, Reach::Trial), &i.to_string(), true);
        }
        assert!(!breaker.is_stopped(0));
    }

    #[test]
    fn the_run_stops_when_no_model_remains_or_too_much_has_failed() {
        let mut breaker = breaker(2, None);
        breaker.failed(0, &error(FailureKind::Request, Reach::Endpoint), "a", true);
        assert!(breaker.is_stopped(0) && !breaker.stopped());
        breaker.failed(1, &error(FailureKind::Request, Reach::Endpoint), "a", true);
        assert!(breaker.stopped());

        let mut breaker = self::breaker(1, Some(2));
        breaker.failed(0, &error(FailureKind::Image, Reach::Trial), "a", true);
        assert!(!breaker.stopped());
        breaker.failed(0, &error(FailureKind::Image, Reach::Trial), "b", true);
        assert!(breaker.stopped() && matches!(breaker.into_end(), EndReason::Stopped(_)));
    }

    #[test]
    fn aborted_requests_do_not_count_as_failures() {
        let mut breaker = breaker(1, Some(1));
        breaker.failed(0, &error(FailureKind::Connection, Reach::Interrupted), "a", true);
        assert!(!breaker.stopped() && breaker.failures() == 0);
    }

    #[test]
    fn an_interrupt_after_the_last_reply_changes_nothing() {
        let all = Counts { trials: 2, answered: 2, failed: 0 };
        assert_eq!(EndReason::Interrupted.status(all), Status::Complete);
        // Truncated replies may be left to ask again.
        assert_eq!(EndReason::OverBudget.status(all), Status::OverBudget);
        let some = Counts { answered: 1, ..all };
        assert_eq!(EndReason::Interrupted.status(some), Status::Cancelled);
        assert_eq!(EndReason::OverBudget.status(some), Status::OverBudget);
        assert_eq!(EndReason::AllAsked.status(some), Status::Incomplete);
    }

    fn suspects_error(kind: FailureKind) -> AskError {
        AskError::new(kind, "no".into())
    }

    #[test]
    fn an_image_is_set_aside_and_then_given_up() {
        let mut suspects = Suspects::default();
        let failure = suspects_error(FailureKind::Connection);
        assert!(!suspects.failed(0, &failure, "i0"));
        assert!(suspects.failed(0, &failure, "i0"), "said once");
        assert!(!suspects.failed(0, &failure, "i0"));
        assert!(suspects.is_deferred(0, "i0") && !suspects.is_deferred(1, "i0"));
        assert!(!suspects.is_given_up(0, "i0"));
        suspects.start_deferred();
        assert!(!suspects.is_deferred(0, "i0") && !suspects.is_given_up(0, "i0"));
        suspects.succeeded(0, "i1");
        assert!(suspects.is_given_up(0, "i0"), "others are answered");
    }

    #[test]
    fn an_image_that_was_answered_is_not_suspected() {
        let mut suspects = Suspects::default();
        suspects.failed(0, &suspects_error(FailureKind::Server), "i0");
        suspects.succeeded(0, "i0");
        for _ in 0..9 {
            assert!(!suspects.failed(0, &suspects_error(FailureKind::Server), "i0"));
        }
        assert!(!suspects.is_deferred(0, "i0"));
        for _ in 0..9 {
            suspects.failed(0, &suspects_error(FailureKind::RateLimit), "i1");
        }
        assert!(!suspects.is_deferred(0, "i1"), "the rate is not about the image");
    }
}
