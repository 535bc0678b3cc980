//! Images for which a server fails again and again: [`Suspects`].

use std::collections::{BTreeMap, BTreeSet};

use crate::ask::{AskError, Reach};
use crate::types::FailureKind;

/// Failed trials about an image after which its others are set aside and asked last. A single failure may be that of the server.
const ASIDE_AFTER: usize = 2;

/// Failed trials about an image, while others are answered, after which no more are asked; chosen.
const GIVEN_UP_AFTER: usize = 3;

/// Failures of the server or the network, by model and by the frame or walk that the trials were about.
#[derive(Debug, Default)]
pub(crate) struct Suspects {
    failures: BTreeMap<(usize, String), usize>,
    /// The models that have answered a trial, with its frame or walk. Such an image is not suspected: the server had an outage.
    answered: BTreeSet<(usize, String)>,
    /// Whether only trials that were set aside are left.
    is_last: bool,
}

impl Suspects {
    /// Notes a reply.
    pub(crate) fn succeeded(&mut self, model: usize, source: &str) {
        let key = (model, source.to_owned());
        self.failures.remove(&key);
        self.answered.insert(key);
    }

    /// Notes a failure; those that reveal nothing about the image are ignored. Returns whether the others about it are now set aside.
    pub(crate) fn failed(&mut self, model: usize, error: &AskError, source: &str) -> bool {
        use FailureKind::{Connection, Response, Server, Timeout};
        let may_be_image = matches!(error.failure.kind, Connection | Response | Server | Timeout);
        let key = (model, source.to_owned());
        if error.reach != Reach::Trial || !may_be_image || self.answered.contains(&key) {
            return false;
        }
        let count = self.failures.entry(key).or_default();
        *count += 1;
        *count == ASIDE_AFTER && !self.is_last
    }

    /// Whether a failure may be that of the image alone: the model has not answered about it, and others are still asked.
    pub(crate) fn may_be_cause(&self, model: usize, source: &str) -> bool {
        !self.is_last && !self.answered.contains(&(model, source.to_owned()))
    }

    /// Whether a trial waits until the others are asked.
    pub(crate) fn is_aside(&self, model: usize, source: &str) -> bool {
        !self.is_last && self.count(model, source) >= ASIDE_AFTER
    }

    /// Whether a trial is not asked in this call, because the server failed for its image and not for others.
    pub(crate) fn is_given_up(&self, model: usize, source: &str) -> bool {
        self.is_last && self.has_answered(model) && self.count(model, source) >= GIVEN_UP_AFTER
    }

    /// Only trials that were set aside are left.
    pub(crate) fn asks_last(&mut self) {
        self.is_last = true;
    }

    /// Whether a model has answered any trial.
    pub(crate) fn has_answered(&self, model: usize) -> bool {
        let mut from = self.answered.range((model, String::new())..);
        from.next().is_some_and(|(answered, _)| *answered == model)
    }

    fn count(&self, model: usize, source: &str) -> usize {
        let key = (model, source.to_owned());
        self.failures.get(&key).copied().unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn error(kind: FailureKind) -> AskError {
        AskError::new(kind, "no".into())
    }

    #[test]
    fn an_image_is_set_aside_and_then_given_up() {
        let mut suspects = Suspects::default();
        let failure = error(FailureKind::Connection);
        assert!(!suspects.failed(0, &failure, "i0"));
        assert!(suspects.failed(0, &failure, "i0"), "said once");
        assert!(!suspects.failed(0, &failure, "i0"));
        assert!(suspects.is_aside(0, "i0") && !suspects.is_aside(1, "i0"));
        assert!(!suspects.is_given_up(0, "i0"));
        suspects.asks_last();
        assert!(!suspects.is_aside(0, "i0") && !suspects.is_given_up(0, "i0"));
        suspects.succeeded(0, "i1");
        assert!(suspects.is_given_up(0, "i0"), "others are answered");
    }

    #[test]
    fn an_image_that_was_answered_is_not_suspected() {
        let mut suspects = Suspects::default();
        suspects.failed(0, &error(FailureKind::Server), "i0");
        suspects.succeeded(0, "i0");
        for _ in 0..9 {
            assert!(!suspects.failed(0, &error(FailureKind::Server), "i0"));
        }
        assert!(!suspects.is_aside(0, "i0"));
        for _ in 0..9 {
            suspects.failed(0, &error(FailureKind::RateLimit), "i1");
        }
        assert!(
            !suspects.is_aside(0, "i1"),
            "the rate is not about the image"
        );
    }
}
