//! When a run ends before its plan does: [`Watch`], [`End`].

use std::collections::BTreeSet;

use super::askers::Asker;
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
pub(super) enum End {
    /// Everything was asked.
    Through,
    /// The user interrupted it.
    Interrupted,
    /// The next question would have gone beyond `--max-cost`.
    Spent,
    /// No model could be asked any further, or too much had failed.
    Stopped(Error),
    /// One model could not be asked any further; the others were.
    Retired(Error),
}

impl End {
    pub(super) fn status(&self, counts: Counts) -> Status {
        match self {
            _ if counts.answered == counts.trials => Status::Complete,
            Self::Through => Status::Incomplete,
            Self::Interrupted | Self::Spent => Status::Cancelled,
            Self::Stopped(_) | Self::Retired(_) => Status::Stopped,
        }
    }
}

/// What is known of one model.
#[derive(Debug, Default)]
struct Health {
    succeeded: bool,
    /// Failures since the last success that the server or the way to it is to blame for.
    outage: usize,
    /// Requests refused before any success, by the frames or walks they were about: one may be at fault by itself.
    refusals: usize,
    refused_places: BTreeSet<String>,
    /// It is asked nothing more.
    retired: bool,
}

/// Watches the outcomes for a reason to stop asking one model, or all.
#[derive(Debug)]
pub(super) struct Watch {
    endpoint: String,
    max_failures: Option<usize>,
    patience: usize,
    models: Vec<(String, Health)>,
    failures: usize,
    stopped: bool,
    end: Option<End>,
}

impl Watch {
    /// `concurrency` requests may fail together without it meaning more than one failure.
    pub(super) fn new(
        endpoint: String,
        askers: &[Asker],
        concurrency: usize,
        max_failures: Option<usize>,
    ) -> Self {
        let names = askers.iter().map(|asker| asker.model.name().to_owned());
        Self {
            endpoint,
            max_failures,
            patience: IN_A_ROW.max(3 * concurrency),
            models: names.map(|name| (name, Health::default())).collect(),
            failures: 0,
            stopped: false,
            end: None,
        }
    }

    /// Whether nothing more is to be asked at all.
    pub(super) fn stopped(&self) -> bool {
        self.stopped
    }

    /// Whether a model is asked nothing more.
    pub(super) fn retired(&self, asker: usize) -> bool {
        self.models[asker].1.retired
    }

    /// How many trials have failed.
    pub(super) fn failures(&self) -> usize {
        self.failures
    }

    pub(super) fn into_end(self) -> End {
        match self.end {
            Some(End::Stopped(error)) if !self.stopped => End::Retired(error),
            end => end.unwrap_or(End::Through),
        }
    }

    pub(super) fn interrupted(&mut self) {
        self.stopped = true;
        self.end.get_or_insert(End::Interrupted);
    }

    /// Takes note that nothing more is within the means.
    pub(super) fn spent(&mut self) {
        self.stopped = true;
        self.end.get_or_insert(End::Spent);
    }

    pub(super) fn succeeded(&mut self, asker: usize) {
        let health = &mut self.models[asker].1;
        (health.succeeded, health.outage) = (true, 0);
    }

    /// Takes note of a failure about a frame or walk.
    pub(super) fn failed(&mut self, asker: usize, error: &AskError, place: &str) {
        if error.reach == Reach::Interrupted {
            return;
        }
        self.failures += 1;
        let (name, health) = &mut self.models[asker];
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
        health.retired |= hopeless.is_some();
        let too_many = self.max_failures.is_some_and(|most| self.failures >= most);
        let too_many = too_many.then(|| {
            format!(
                "{} trials have failed (--max-failures), the last: {message}",
                self.failures
            )
        });
        self.stopped |= too_many.is_some() || self.models.iter().all(|(_, health)| health.retired);
        if let Some(problem) = hopeless.or(too_many) {
            let problem =
                format!("{problem} (what was answered is kept; the same command goes on)");
            let endpoint = self.endpoint.clone();
            self.end
                .get_or_insert(End::Stopped(Error::Endpoint { endpoint, problem }));
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::ask::{Model, Random};
    use crate::types::View;

    fn watch(models: usize, max_failures: Option<usize>) -> Watch {
        let asker = |_| Asker {
            model: Arc::new(Model::Random(Random { seed: 0 })),
            digest: "".into(),
            view: View::Image,
        };
        let askers: Vec<Asker> = (0..models).map(asker).collect();
        Watch::new("here".into(), &askers, 2, max_failures)
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
            refused: None,
        }
    }

    /// Lets one of `models` fail so often over so many frames; whether it is retired then.
    fn retired_after(kind: FailureKind, times: usize, frames: usize, succeeded: bool) -> bool {
        let mut watch = watch(2, None);
        if succeeded {
            watch.succeeded(0);
        }
        for i in 0..times {
            watch.succeeded(1);
            watch.failed(0, &error(kind, Reach::Trial), &(i % frames).to_string());
        }
        assert!(!watch.stopped(), "the other model goes on");
        watch.retired(0)
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
        let mut watch = watch(1, None);
        for i in 0..100 {
            if i % 10 == 0 {
                watch.succeeded(0);
            }
            watch.failed(0, &error(FailureKind::Server, Reach::Trial), &i.to_string());
        }
        assert!(!watch.retired(0));
    }

    #[test]
    fn the_run_stops_when_no_model_is_left_or_too_much_has_failed() {
        let mut watch = watch(2, None);
        watch.failed(0, &error(FailureKind::Request, Reach::Endpoint), "a");
        assert!(watch.retired(0) && !watch.stopped());
        watch.failed(1, &error(FailureKind::Request, Reach::Endpoint), "a");
        assert!(watch.stopped());

        let mut watch = self::watch(1, Some(2));
        watch.failed(0, &error(FailureKind::Image, Reach::Trial), "a");
        assert!(!watch.stopped());
        watch.failed(0, &error(FailureKind::Image, Reach::Trial), "b");
        assert!(watch.stopped() && matches!(watch.into_end(), End::Stopped(_)));
    }

    #[test]
    fn what_was_given_up_has_not_failed() {
        let mut watch = watch(1, Some(1));
        watch.failed(0, &error(FailureKind::Connection, Reach::Interrupted), "a");
        assert!(!watch.stopped() && watch.failures() == 0);
    }

    #[test]
    fn an_interrupt_after_the_last_reply_changes_nothing() {
        let all = Counts {
            trials: 2,
            answered: 2,
            failed: 0,
        };
        assert_eq!(End::Interrupted.status(all), Status::Complete);
        let some = Counts { answered: 1, ..all };
        assert_eq!(End::Interrupted.status(some), Status::Cancelled);
        assert_eq!(End::Through.status(some), Status::Incomplete);
    }
}
