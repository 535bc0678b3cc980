//! [`StoredViews`]: the inputs that each model of a stored run was shown, from its manifest.

use std::collections::{BTreeMap, BTreeSet};

use serde::Deserialize;
use serde_json::json;

use super::manifest::RunManifest;
use crate::types::View;

/// The entry of a manifest's settings that holds the views of models which are asked without images.
const VIEWS: &str = "views of models";

/// Inputs shown to each model, by its name in tables.
pub type Views = BTreeMap<String, BTreeSet<View>>;

/// How well the inputs of one model match those of another.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Fit {
    /// One is shown images alone, and the other one none.
    Apart,
    /// Not recorded in the manifest.
    Unknown,
    /// One is shown everything that the other one is, and more.
    Part,
    /// The same.
    Whole,
}

/// The inputs that the models of a stored run were shown, as far as its manifest records them.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StoredViews {
    known: Views,
    /// Whether a model that is not among these was shown images alone.
    is_whole: bool,
}

/// A model as the settings of a manifest hold it.
#[derive(Deserialize)]
struct Noted {
    name: String,
    view: BTreeSet<View>,
}

impl StoredViews {
    /// Reads the views that a manifest records.
    pub fn from_manifest(manifest: &RunManifest) -> Self {
        if let Some(known) = manifest
            .settings
            .get(VIEWS)
            .and_then(|value| serde_json::from_value::<Views>(value.clone()).ok())
        {
            return Self {
                known,
                is_whole: true,
            };
        }
        // The models that the command before asked by its file.
        let models = manifest.settings.get("models").cloned();
        let models = models
            .and_then(|models| serde_json::from_value::<Vec<Noted>>(models).ok())
            .into_iter()
            .flatten();
        Self {
            known: models.map(|model| (model.name, model.view)).collect(),
            is_whole: false,
        }
    }

    /// True if the manifest records the views of all models.
    pub fn is_noted(&self) -> bool {
        self.is_whole
    }

    /// Compares the stored inputs of a model with those that a model is shown now.
    pub fn fit(&self, stored: &str, now: &BTreeSet<View>) -> Fit {
        match self.views(stored) {
            None => Fit::Unknown,
            Some(views) if views == *now => Fit::Whole,
            Some(views) if views.is_disjoint(now) => Fit::Apart,
            Some(_) => Fit::Part,
        }
    }

    /// Records the views in a manifest under the current names: those of the stored models, each with its new name, and those of the
    /// command.
    pub fn note<'a>(
        &self,
        manifest: &mut RunManifest,
        stored: impl Iterator<Item = (&'a String, String)>,
        now: &Views,
    ) {
        let mut views = Views::new();
        for (name, new) in stored {
            views
                .entry(new)
                .or_default()
                .extend(self.views(name).into_iter().flatten());
        }
        for (name, shown) in now {
            views.entry(name.clone()).or_default().extend(shown);
        }
        views.retain(|_, views| views.contains(&View::Blind));
        if views.is_empty() {
            manifest.settings.remove(VIEWS);
        } else {
            manifest.settings.insert(VIEWS.to_owned(), json!(views));
        }
    }

    fn views(&self, name: &str) -> Option<BTreeSet<View>> {
        self.known
            .get(name)
            .cloned()
            .or_else(|| self.is_whole.then(|| BTreeSet::from([View::Image])))
    }
}
