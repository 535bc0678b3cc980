//! When a run ends before its plan does: [`CircuitBreaker`], [`EndReason`].

use std::collections::BTreeSet;

use super::models::ModelUnderTest;
use crate::ask::{AskError, Reach};
use crate::error::Error;
use crate::types::manifest::{Counts, Status};
use crate::types::{Failure, FailureKind};

/// How many trials of a model may fail before any has succeeded: the next would too.
const AT_FIRST: usize = 5;

/// How many in a row may fail later on, at least: servers come back from shorter troubles.
const IN_A_ROW: usize = 20;

/// How the asking ended.
#[derive(Debug)]
pub(crate) enum EndReason {
    /// Everything was asked.
    AllAsked,
    /// The user interrupted it.
    Interrupted,
    /// The next question would have gone beyond `--max-cost`.
    OverBudget,
    /// No model could be asked any further, or too much had failed.
    Stopped(Error),
    /// One model could not be asked any further; the others were.
    ModelStopped(Error),
}

impl EndReason {
    pub(crate) fn status(&self, counts: Counts) -> Status {
        match self {
            _ if counts.answered == counts.trials => Status::Complete,
            Self::AllAsked => Status::Incomplete,
            Self::Interrupted | Self::OverBudget => Status::Cancelled,
            Self::Stopped(_) | Self::ModelStopped(_) => Status::Stopped,
        }
    }
}

/// What is known of one model.
#[derive(Debug, Default)]
struct ModelHealth {
    succeeded: bool,
    /// Failures since the last success that the server or the way to it is to blame for.
    outage: usize,
    /// Requests refused before any success, by the frames or walks they were about: one may be at fault by itself.
    refusals: usize,
    refused_places: BTreeSet<String>,
    /// It is asked nothing more.
    stopped: bool,
}

/// One model that is watched.
#[derive(Debug)]
struct WatchedModel {
    name: String,
    /// Where it is asked.
    place: String,
    health: ModelHealth,
}

/// Watches the outcomes for a reason to stop asking one model, or all.
#[derive(Debug)]
pub(crate) struct CircuitBreaker {
    max_failures: Option<usize>,
    patience: usize,
    models: Vec<WatchedModel>,
    failures: usize,
    stopped: bool,
    end: Option<EndReason>,
}

impl CircuitBreaker {
    /// `concurrency` requests may fail together without it meaning more than one failure.
    pub(crate) fn new(
        models: &[ModelUnderTest],
        concurrency: usize,
        max_failures: Option<usize>,
    ) -> Self {
        let watched = models.iter().map(|one| WatchedModel {
            name: one.model.name().to_owned(),
            place: one.place().to_owned(),
            health: ModelHealth::default(),
        });
        Self {
            max_failures,
            patience: IN_A_ROW.max(3 * concurrency),
            models: watched.collect(),
            failures: 0,
            stopped: false,
            end: None,
        }
    }

    /// Whether nothing more is to be asked at all.
    pub(crate) fn stopped(&self) -> bool {
        self.stopped
    }

    /// Whether a model is asked nothing more.
    pub(crate) fn retired(&self, model: usize) -> bool {
        self.models[model].health.stopped
    }

    /// How many trials have failed.
    pub(crate) fn failures(&self) -> usize {
        self.failures
    }

    pub(crate) fn into_end(self) -> EndReason {
        match self.end {
            Some(EndReason::Stopped(error)) if !self.stopped => EndReason::ModelStopped(error),
            end => end.unwrap_or(EndReason::AllAsked),
        }
    }

    pub(crate) fn interrupted(&mut self) {
        self.stopped = true;
        self.end.get_or_insert(EndReason::Interrupted);
    }

    /// Takes note that nothing more is within the means.
    pub(crate) fn spent(&mut self) {
        self.stopped = true;
        self.end.get_or_insert(EndReason::OverBudget);
    }

    pub(crate) fn succeeded(&mut self, model: usize) {
        let health = &mut self.models[model].health;
        (health.succeeded, health.outage) = (true, 0);
    }

    /// Takes note of a failure about a frame or walk.
    pub(crate) fn failed(&mut self, model: usize, error: &AskError, place: &str) {
        if error.reach == Reach::Interrupted {
            return;
        }
        self.failures += 1;
        let WatchedModel {
            name,
            place: endpoint,
            health,
        } = &mut self.models[model];
        let Failure { kind, message, .. } = &error.failure;
        match kind {
            // The images are at fault, or what they show; the next may pass.
            FailureKind::Image | FailureKind::Filtered => {}
            FailureKind::Request => {
                health.refusals += 1;
                health.refused_places.insert(place.to_owned());
            }
            _ => health.outage += 1,
        }
        let refused = health.refusals >= AT_FIRST && health.refused_places.len() > 1;
        let patience = if health.succeeded {
            self.patience
        } else {
            AT_FIRST
        };
        let hopeless = if error.reach == Reach::Endpoint {
            Some(format!("{name}: {message}"))
        } else if refused && !health.succeeded {
            Some(format!(
                "{name}: the first {} trials were all refused: {message}",
                health.refusals
            ))
        } else if health.outage >= patience {
            Some(format!(
                "{name}: {} trials in a row failed: {message}",
                health.outage
            ))
        } else {
            None
        };
        health.stopped |= hopeless.is_some();
        let too_many = self.max_failures.is_some_and(|most| self.failures >= most);
        let too_many = too_many.then(|| {
            format!(
                "{} trials have failed (--max-failures), the last: {message}",
                self.failures
            )
        });
        let endpoint = endpoint.clone();
        self.stopped |= too_many.is_some() || self.models.iter().all(|one| one.health.stopped);
        if let Some(problem) = hopeless.or(too_many) {
            let problem =
                format!("{problem} (what was answered is kept; the same command goes on)");
            self.end
                .get_or_insert(EndReason::Stopped(Error::Endpoint { endpoint, problem }));
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::ask::{Model, Random};
    use crate::types::View;

    fn breaker(models: usize, max_failures: Option<usize>) -> CircuitBreaker {
        let model = |_| ModelUnderTest {
            model: Arc::new(Model::Random(Random { seed: 0 })),
            digest: "".into(),
            view: View::Image,
            address: None,
        };
        let models: Vec<ModelUnderTest> = (0..models).map(model).collect();
        CircuitBreaker::new(&models, 2, max_failures)
    }

    fn error(kind: FailureKind, reach: Reach) -> AskError {
        let failure = Failure {
            kind,
            status: None,
            message: "no".into(),
        };
        AskError {
            failure,
            attempts: 1,
            reach,
            refused_field: None,
        }
    }

    /// Lets one of `models` fail so often over so many frames; whether it is retired then.
    fn retired_after(kind: FailureKind, times: usize, frames: usize, succeeded: bool) -> bool {
        let mut breaker = breaker(2, None);
        if succeeded {
            breaker.succeeded(0);
        }
        for i in 0..times {
            breaker.succeeded(1);
            breaker.failed(0, &error(kind, Reach::Trial), &(i % frames).to_string());
        }
        assert!(!breaker.stopped(), "the other model goes on");
        breaker.retired(0)
    }

    #[test]
    fn a_model_that_cannot_be_asked_is_retired_and_the_others_go_on() {
        use FailureKind::{Connection, Image, Request, Server};
        for kind in [Connection, Server] {
            assert!(
                retired_after(kind, 5, 1, false),
                "one frame is enough: {kind:?}"
            );
            assert!(!retired_after(kind, 4, 4, false));
            assert!(retired_after(kind, 20, 1, true) && !retired_after(kind, 19, 19, true));
        }
        assert!(retired_after(Request, 5, 2, false));
        assert!(
            !retired_after(Request, 9, 1, false),
            "one frame may be at fault"
        );
        assert!(!retired_after(Request, 99, 99, true), "others were taken");
        assert!(
            !retired_after(Image, 99, 99, false),
            "the images are at fault"
        );
    }

    #[test]
    fn a_success_ends_an_outage() {
        let mut breaker = breaker(1, None);
        for i in 0..100 {
            if i % 10 == 0 {
                breaker.succeeded(0);
            }
            breaker.failed(0, &error(FailureKind::Server, Reach::Trial), &i.to_string());
        }
        assert!(!breaker.retired(0));
    }

    #[test]
    fn the_run_stops_when_no_model_is_left_or_too_much_has_failed() {
        let mut breaker = breaker(2, None);
        breaker.failed(0, &error(FailureKind::Request, Reach::Endpoint), "a");
        assert!(breaker.retired(0) && !breaker.stopped());
        breaker.failed(1, &error(FailureKind::Request, Reach::Endpoint), "a");
        assert!(breaker.stopped());

        let mut breaker = self::breaker(1, Some(2));
        breaker.failed(0, &error(FailureKind::Image, Reach::Trial), "a");
        assert!(!breaker.stopped());
        breaker.failed(0, &error(FailureKind::Image, Reach::Trial), "b");
        assert!(breaker.stopped() && matches!(breaker.into_end(), EndReason::Stopped(_)));
    }

    #[test]
    fn what_was_given_up_has_not_failed() {
        let mut breaker = breaker(1, Some(1));
        breaker.failed(0, &error(FailureKind::Connection, Reach::Interrupted), "a");
        assert!(!breaker.stopped() && breaker.failures() == 0);
    }

    #[test]
    fn an_interrupt_after_the_last_reply_changes_nothing() {
        let all = Counts {
            trials: 2,
            answered: 2,
            failed: 0,
        };
        assert_eq!(EndReason::Interrupted.status(all), Status::Complete);
        let some = Counts { answered: 1, ..all };
        assert_eq!(EndReason::Interrupted.status(some), Status::Cancelled);
        assert_eq!(EndReason::AllAsked.status(some), Status::Incomplete);
    }
}
