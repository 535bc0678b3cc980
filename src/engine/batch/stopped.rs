//! The models whose batches go on no further under this command: [`Stopped`].

use std::collections::BTreeSet;

use super::event::PartFacts;
use crate::engine::models::ModelUnderTest;
use crate::error::Error;

/// The models whose batches go on no further under this command, because their server refuses what every further call would ask.
#[derive(Debug, Default)]
pub(super) struct Stopped {
    /// Addresses and names in tables of models whose parts stay as they are.
    models: BTreeSet<(String, String)>,
    /// Models that are asked nothing more in a phase, by phase and index: one that takes no images may be asked without, and may judge.
    asked: BTreeSet<(usize, usize)>,
    errors: Vec<Error>,
}

impl Stopped {
    /// Stops the model of a part.
    pub(super) fn add_part(&mut self, facts: &PartFacts, error: Error) {
        self.models.insert(place(facts));
        self.errors.push(error);
    }

    /// Stops the model with this index in a phase; the error is added apart.
    pub(super) fn add_model(&mut self, phase: usize, index: usize) {
        self.asked.insert((phase, index));
    }

    /// Adds why models are stopped.
    pub(super) fn add_errors(&mut self, errors: Vec<Error>) {
        self.errors.extend(errors);
    }

    /// Whether the model of a part is stopped.
    pub(super) fn has_part(&self, facts: &PartFacts) -> bool {
        self.models.contains(&place(facts))
    }

    /// Whether nothing more is asked of the model with this index in a phase.
    pub(super) fn has_model(&self, phase: usize, (index, model): (usize, &ModelUnderTest)) -> bool {
        let base = model.model.batch_base().unwrap_or_default();
        let place = (base, model.name.to_string());
        self.asked.contains(&(phase, index)) || self.models.contains(&place)
    }

    /// Why models are stopped; empty if none is.
    pub(super) fn errors(&self) -> &[Error] {
        &self.errors
    }

    /// Takes the errors out.
    pub(super) fn take_errors(&mut self) -> Vec<Error> {
        std::mem::take(&mut self.errors)
    }
}

/// Address and name of the model of a part.
fn place(facts: &PartFacts) -> (String, String) {
    let name = match &*facts.name {
        "" => &facts.model,
        name => name,
    };
    (facts.base.clone(), name.to_owned())
}
