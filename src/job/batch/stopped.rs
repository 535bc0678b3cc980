//! The models whose batches go on no further under this command: [`Stopped`].

use std::collections::BTreeSet;

use super::event::PartFacts;
use crate::error::Error;
use crate::job::models::ModelUnderTest;

/// The models whose batches go on no further under this command, because their server refuses what every further call would ask.
#[derive(Debug, Default)]
pub(super) struct Stopped {
    /// Addresses and names in tables.
    models: BTreeSet<(String, String)>,
    errors: Vec<Error>,
}

impl Stopped {
    /// Stops the model of a part.
    pub(super) fn add_part(&mut self, facts: &PartFacts, error: Error) {
        self.models.insert(place(facts));
        self.errors.push(error);
    }

    /// Stops a model; the error is added apart.
    pub(super) fn add_model(&mut self, model: &ModelUnderTest) {
        let base = model.model.batch_base().unwrap_or_default();
        self.models.insert((base, model.name.to_string()));
    }

    /// Adds why models are stopped.
    pub(super) fn add_errors(&mut self, errors: Vec<Error>) {
        self.errors.extend(errors);
    }

    /// Whether the model of a part is stopped.
    pub(super) fn has_part(&self, facts: &PartFacts) -> bool {
        self.models.contains(&place(facts))
    }

    /// Whether a model is stopped.
    pub(super) fn has_model(&self, model: &ModelUnderTest) -> bool {
        let base = model.model.batch_base().unwrap_or_default();
        self.models.contains(&(base, model.name.to_string()))
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
