//! Images that were not made because other images exist in their place: [`Refusals`].

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};

use crate::engine::images::stored::output_image::Refusal;

/// The refused images of a command by reason; thread-safe.
#[derive(Debug, Default)]
pub(crate) struct Refusals(Mutex<BTreeMap<String, BTreeSet<PathBuf>>>);

impl Refusals {
    pub(crate) fn add(&self, Refusal { image, problem }: Refusal) {
        let mut refused = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        refused.entry(problem).or_default().insert(image);
    }

    /// Logs each reason once, with its first image and the number of the others.
    pub(crate) fn log(self) {
        let refused = self.0.into_inner().unwrap_or_else(PoisonError::into_inner);
        for (problem, images) in refused {
            let Some(first) = images.first() else {
                continue;
            };
            let more = match images.len() {
                1 => String::new(),
                n => format!(" and {} more", n - 1),
            };
            tracing::error!("{}{more}: {problem}", first.display());
        }
    }
}
