//! The first failure of each kind, to describe it at the end of a run: [`FirstFailures`].

use std::collections::BTreeMap;

use crate::engine::models::ModelUnderTest;
use crate::types::{Failure, FailureKind};

/// First failure of each model and kind. Images that cannot be made are the same for all models.
#[derive(Debug, Default)]
pub(super) struct FirstFailures(BTreeMap<(usize, FailureKind), FirstFailure>);

/// Frame or walk of a failed trial, and the message of its failure.
#[derive(Debug)]
struct FirstFailure {
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
            .or_insert_with(|| FirstFailure { source: source.to_owned(), message: failure.message.clone() });
    }

    /// Warns about each kind of failure, except of stopped models, whose error describes it.
    pub(super) fn warn(&self, models: &[ModelUnderTest], is_stopped: impl Fn(usize) -> bool) {
        for ((model, kind), failure) in &self.0 {
            let FirstFailure { source, message } = failure;
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
