//! Images for which a server fails repeatedly: [`Suspects`].

use std::collections::{BTreeMap, BTreeSet};

use crate::ask::{AskError, Reach};
use crate::types::FailureKind;

/// Number of failed trials about an image after which its other trials are asked last. A single failure may have
/// another cause.
const ASIDE_AFTER: usize = 2;

/// Number of failed trials about an image after which no more are asked, if the model answers about other images;
/// chosen.
const GIVEN_UP_AFTER: usize = 3;

/// Counts of failures by model and by frame or walk, to find images that make a server fail.
#[derive(Debug, Default)]
pub(crate) struct Suspects {
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
    pub(crate) fn succeeded(&mut self, model: usize, source: &str) {
        let key = (model, source.to_owned());
        self.failures.remove(&key);
        self.answered.insert(key);
    }

    /// Records a failure, unless its cause cannot be the image. Returns true if the other trials about the image are
    /// set aside from now on.
    pub(crate) fn failed(&mut self, model: usize, error: &AskError, source: &str) -> bool {
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
    pub(crate) fn may_be_cause(&self, model: usize, source: &str) -> bool {
        !self.asks_deferred && !self.answered.contains(&(model, source.to_owned()))
    }

    /// True if the trials about a source wait until all others have been asked.
    pub(crate) fn is_deferred(&self, model: usize, source: &str) -> bool {
        !self.asks_deferred && self.count(model, source) >= ASIDE_AFTER
    }

    /// True if no more trials about a source are asked in this call, because the server fails for it and answers
    /// others.
    pub(crate) fn is_given_up(&self, model: usize, source: &str) -> bool {
        self.asks_deferred && self.has_answered(model) && self.count(model, source) >= GIVEN_UP_AFTER
    }

    /// Begins the trials that were set aside; no others are left.
    pub(crate) fn start_deferred(&mut self) {
        self.asks_deferred = true;
    }

    /// True if a model has answered any trial.
    pub(crate) fn has_answered(&self, model: usize) -> bool {
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
        suspects.failed(0, &error(FailureKind::Server), "i0");
        suspects.succeeded(0, "i0");
        for _ in 0..9 {
            assert!(!suspects.failed(0, &error(FailureKind::Server), "i0"));
        }
        assert!(!suspects.is_deferred(0, "i0"));
        for _ in 0..9 {
            suspects.failed(0, &error(FailureKind::RateLimit), "i1");
        }
        assert!(!suspects.is_deferred(0, "i1"), "the rate is not about the image");
    }
}
