//! [`StoredViews`]: the inputs that each model of a stored run was shown, from its manifest.

use std::collections::{BTreeMap, BTreeSet};

use serde::Deserialize;
use serde_json::json;

use super::manifest::RunManifest;
use crate::types::View;

/// The key in a manifest's settings for the views of models that are asked without images.
const VIEWS: &str = "views of models";

/// Inputs shown to each model, by its name in tables.
pub type Views = BTreeMap<String, BTreeSet<View>>;

/// How the inputs of a stored model compare with those of a model in the command.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Fit {
    /// No view in common: one is shown images alone, the other none.
    Disjoint,
    /// The manifest does not record the views.
    Unknown,
    /// One is asked with and without images, the other in one of these ways.
    Overlapping,
    /// The same views.
    Equal,
}

/// The inputs that the models of a stored run were shown, as far as its manifest records them.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StoredViews {
    known: Views,
    /// True if the views of all models are known: a model that is not in `known` was shown images alone.
    is_complete: bool,
}

/// A model in the settings of an older manifest.
#[derive(Deserialize)]
struct ManifestModel {
    name: String,
    view: BTreeSet<View>,
}

impl StoredViews {
    /// Reads the views that a manifest records.
    pub fn from_manifest(manifest: &RunManifest) -> Self {
        if let Some(known) =
            manifest.settings.get(VIEWS).and_then(|value| serde_json::from_value::<Views>(value.clone()).ok())
        {
            return Self { known, is_complete: true };
        }
        // Older manifests contain only the models in the models file of the last command.
        let known = manifest
            .settings
            .get("models")
            .and_then(|models| serde_json::from_value::<Vec<ManifestModel>>(models.clone()).ok())
            .into_iter()
            .flatten()
            .map(|model| (model.name, model.view))
            .collect();
        Self { known, is_complete: false }
    }

    /// True if the manifest records the views of all models.
    pub fn is_complete(&self) -> bool {
        self.is_complete
    }

    /// Compares the stored views of a model with those of a model in the command.
    pub fn compare(&self, stored: &str, now: &BTreeSet<View>) -> Fit {
        match self.views(stored) {
            None => Fit::Unknown,
            Some(views) if views == *now => Fit::Equal,
            Some(views) if views.is_disjoint(now) => Fit::Disjoint,
            Some(_) => Fit::Overlapping,
        }
    }

    /// Writes the views to a manifest: those of the stored models, each under its new name, and those of the command's
    /// models.
    pub fn write_to<'a>(
        &self,
        manifest: &mut RunManifest,
        stored: impl Iterator<Item = (&'a String, String)>,
        now: &Views,
    ) {
        let mut views = Views::new();
        for (name, new) in stored {
            views.entry(new).or_default().extend(self.views(name).into_iter().flatten());
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
        self.known.get(name).cloned().or_else(|| self.is_complete.then(|| BTreeSet::from([View::Image])))
    }
}
