//! Models whose batches are not continued by this command: [`StoppedModels`].

use std::collections::BTreeSet;

use super::event::PartFacts;
use crate::engine::models::ModelUnderTest;
use crate::error::Error;

/// Models whose batches are not continued by this command, because their server refuses all further calls.
#[derive(Debug, Default)]
pub(super) struct StoppedModels {
    /// Base URLs and names of models whose parts stay as they are.
    models: BTreeSet<(String, String)>,
    /// Phases and indices of models that are not asked any more in a phase. In another phase or without images, the
    /// same model may still be asked.
    in_phase: BTreeSet<(usize, usize)>,
    errors: Vec<Error>,
}

impl StoppedModels {
    /// Stops the model of a part.
    pub(super) fn add_part(&mut self, facts: &PartFacts, error: Error) {
        self.models.insert(base_and_name(facts));
        self.errors.push(error);
    }

    /// Stops the model with this index in a phase. Its error must be added by [`add_errors`](Self::add_errors).
    pub(super) fn add_model(&mut self, phase: usize, index: usize) {
        self.in_phase.insert((phase, index));
    }

    /// Adds the errors that stopped models.
    pub(super) fn add_errors(&mut self, errors: Vec<Error>) {
        self.errors.extend(errors);
    }

    /// True if the model of a part is stopped.
    pub(super) fn has_part(&self, facts: &PartFacts) -> bool {
        self.models.contains(&base_and_name(facts))
    }

    /// True if the model with this index in a phase is stopped.
    pub(super) fn has_model(&self, phase: usize, index: usize, model: &ModelUnderTest) -> bool {
        let base = model.model.batch_base().unwrap_or_default();
        self.in_phase.contains(&(phase, index)) || self.models.contains(&(base, model.name.to_string()))
    }

    /// The errors that stopped models; empty if no model is stopped.
    pub(super) fn errors(&self) -> &[Error] {
        &self.errors
    }

    /// Takes the errors out.
    pub(super) fn take_errors(&mut self) -> Vec<Error> {
        std::mem::take(&mut self.errors)
    }
}

/// Base URL and name of the model of a part.
fn base_and_name(facts: &PartFacts) -> (String, String) {
    let name = match &*facts.name {
        "" => &facts.model,
        name => name,
    };
    (facts.base.clone(), name.to_owned())
}
