//! When a run ends before its plan does: [`Watch`], [`End`].

use std::collections::BTreeSet;

use crate::ask::{AskError, Reach};
use crate::error::Error;
use crate::types::manifest::{Counts, Status};
use crate::types::{FailureKind, FrameId};

/// How many trials may fail alike before any has succeeded: the sixth would too.
const ALIKE: usize = 5;

/// How the asking ended.
#[derive(Debug)]
pub(super) enum End {
    /// Everything was asked.
    Through,
    /// The user interrupted it.
    Interrupted,
    /// No further trial could have succeeded, or too many had failed.
    Stopped(Error),
}

impl End {
    pub(super) fn status(&self, counts: Counts) -> Status {
        match self {
            Self::Through if counts.answered == counts.trials => Status::Complete,
            Self::Through => Status::Incomplete,
            Self::Interrupted => Status::Cancelled,
            Self::Stopped(_) => Status::Stopped,
        }
    }
}

/// Watches the outcomes for a reason to stop.
#[derive(Debug)]
pub(super) struct Watch {
    endpoint: String,
    max_failures: Option<usize>,
    failures: usize,
    successes: usize,
    kinds: BTreeSet<(FailureKind, Option<u16>)>,
    frames: BTreeSet<FrameId>,
    end: Option<End>,
}

impl Watch {
    pub(super) fn new(endpoint: String, max_failures: Option<usize>) -> Self {
        let (kinds, frames) = (BTreeSet::new(), BTreeSet::new());
        Self {
            endpoint,
            max_failures,
            failures: 0,
            successes: 0,
            kinds,
            frames,
            end: None,
        }
    }

    /// Whether there is a reason to ask nothing more.
    pub(super) fn stopped(&self) -> bool {
        self.end.is_some()
    }

    /// How many trials have failed.
    pub(super) fn failures(&self) -> usize {
        self.failures
    }

    pub(super) fn into_end(self) -> End {
        self.end.unwrap_or(End::Through)
    }

    pub(super) fn interrupted(&mut self) {
        self.end.get_or_insert(End::Interrupted);
    }

    pub(super) fn succeeded(&mut self) {
        self.successes += 1;
    }

    /// Takes note of a failure about a frame.
    pub(super) fn failed(&mut self, error: &AskError, frame: &FrameId) {
        self.failures += 1;
        let failure = &error.failure;
        if failure.kind != FailureKind::Image {
            self.kinds.insert((failure.kind, failure.status));
            self.frames.insert(frame.clone());
        }
        let alike = self.successes == 0 && self.kinds.len() == 1 && self.frames.len() > 1;
        let problem = if error.reach == Reach::Endpoint {
            failure.message.clone()
        } else if alike && self.failures >= ALIKE {
            format!(
                "the first {} trials all failed alike: {}",
                self.failures, failure.message
            )
        } else if self.max_failures.is_some_and(|most| self.failures > most) {
            format!(
                "{} trials have failed, more than --max-failures allows; the last: {}",
                self.failures, failure.message
            )
        } else {
            return;
        };
        let problem = format!("{problem} (what was answered is kept; the same command goes on)");
        self.end.get_or_insert(End::Stopped(Error::Endpoint {
            endpoint: self.endpoint.clone(),
            problem,
        }));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::types::Failure;

    fn error(kind: FailureKind, status: u16, reach: Reach) -> AskError {
        AskError {
            failure: Failure {
                kind,
                status: Some(status),
                message: "no".into(),
            },
            attempts: 1,
            reach,
        }
    }

    fn after(
        max_failures: Option<usize>,
        errors: &[(FailureKind, u16, Reach)],
        frames: usize,
    ) -> bool {
        let mut watch = Watch::new("here".into(), max_failures);
        for (i, &(kind, status, reach)) in errors.iter().enumerate() {
            watch.failed(
                &error(kind, status, reach),
                &FrameId((i % frames).to_string()),
            );
        }
        watch.stopped()
    }

    #[test]
    fn it_stops_where_nothing_more_can_succeed() {
        let (bad, gone) = (
            (FailureKind::Request, 400, Reach::Trial),
            (FailureKind::Request, 401, Reach::Endpoint),
        );
        let image = (FailureKind::Image, 0, Reach::Trial);
        assert!(after(None, &[gone], 1));
        assert!(after(None, &[bad; 5], 2));
        assert!(!after(None, &[bad; 4], 2), "too few");
        assert!(!after(None, &[bad; 5], 1), "one frame's fault");
        assert!(!after(None, &[image; 9], 9), "the images' fault");
        assert!(
            !after(
                None,
                &[bad, bad, bad, bad, (FailureKind::Timeout, 0, Reach::Trial)],
                2
            ),
            "not alike"
        );
        assert!(after(Some(1), &[image; 2], 2) && !after(Some(2), &[image; 2], 2));
    }

    #[test]
    fn a_success_shows_that_others_can_succeed() {
        let mut watch = Watch::new("here".into(), None);
        watch.succeeded();
        for i in 0..20 {
            watch.failed(
                &error(FailureKind::Request, 400, Reach::Trial),
                &FrameId(i.to_string()),
            );
        }
        assert!(!watch.stopped());
    }
}
