//! Findings about enhancers in the image store: that a model was opened, and the result of its probe ([`StoredFindings`]).

use std::time::Duration;

use serde::Serialize;

use crate::error::Result;
use crate::image_store::{Content, Entry, EntryFacts, ImageStore, Key, Shown};
use crate::images::enhancement::enhancers::{EnhancerModels, Model};
use crate::images::frames::Source;
use crate::images::recipes::{ImageKeyFacts, Maker, Recipe};
use crate::types::{Condition, Digest};
use darkqa_enhance::{self, Findings};

/// The image store, with the settings that decide how enhancers run.
#[derive(Debug, Clone, Copy)]
pub(crate) struct StoredFindings<'a> {
    store: &'a ImageStore,
    maker: &'a Maker,
}

/// The facts that decide the findings about a model.
#[derive(Serialize)]
struct FindingsRecipe<'a> {
    /// Digest of the model, its sidecar and its preset.
    stated: Digest,
    version: u32,
    maker: &'a Maker,
    /// Facts that decide the dark images of the probe, one list per frame; `None` for the entry that the model was opened.
    frames: Option<Vec<Vec<ImageKeyFacts<'a>>>>,
}

impl<'a> StoredFindings<'a> {
    pub(crate) fn new(store: &'a ImageStore, maker: &'a Maker) -> Self {
        Self { store, maker }
    }

    fn key(self, model: &Model, frames: Option<Vec<Vec<ImageKeyFacts<'_>>>>) -> Result<Key> {
        Key::from_recipe(&FindingsRecipe {
            stated: model.stated()?,
            version: darkqa_enhance::VERSION,
            maker: self.maker,
            frames,
        })
    }

    /// True if all models of a command were opened and probed before, so they need not be opened to check them.
    ///
    /// # Errors
    /// If a sidecar has a number that is infinite or NaN.
    pub(crate) fn has_all(self, models: &EnhancerModels<'_>) -> Result<bool> {
        for model in models.models() {
            if !self.store.contains(&self.key(model, None)?) {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// The place of the findings of a model's probe on these frames and conditions.
    ///
    /// # Errors
    /// If a frame cannot be shown in one of its conditions.
    pub(crate) fn place(
        self,
        recipe: &Recipe,
        model: &Model,
        frames: &[(&Source, Vec<Condition>)],
    ) -> Result<FindingsPlace<'a>> {
        let facts = frames
            .iter()
            .map(|(source, conditions)| frame_facts(recipe, source, conditions))
            .collect::<Result<Vec<_>>>()?;
        Ok(FindingsPlace {
            store: self.store,
            opened: self.key(model, None)?,
            probed: self.key(model, Some(facts))?,
            shown: Shown {
                content: Content::Probe,
                enhancer: Some(model.name().to_string()),
                ..Shown::default()
            },
        })
    }
}

/// The facts that decide the images of the middle frame of a source in these conditions, before enhancement.
fn frame_facts<'a>(
    recipe: &'a Recipe,
    source: &'a Source,
    conditions: &[Condition],
) -> Result<Vec<ImageKeyFacts<'a>>> {
    let Some(frame) = source.middle() else {
        return Ok(Vec::new());
    };
    conditions
        .iter()
        .map(|condition| {
            let raw = Condition {
                enhancer: None,
                ..condition.clone()
            };
            recipe.key_facts(&source.name, frame, &raw)
        })
        .collect()
}

/// The place of the findings of a probe in the image store.
#[derive(Debug, Clone)]
pub(crate) struct FindingsPlace<'a> {
    store: &'a ImageStore,
    /// Key of the entry that the model was opened.
    opened: Key,
    probed: Key,
    shown: Shown,
}

impl FindingsPlace<'_> {
    /// The findings; `None` if the store has none.
    pub(crate) fn read(&self) -> Option<Findings> {
        let mut findings: Option<Findings> = None;
        self.store.get(&self.probed, Content::Probe, |entry| {
            findings = serde_json::from_value(entry.facts.notes.clone()).ok();
            findings.is_some()
        })?;
        findings
    }

    /// Writes the findings. `took` is the duration of opening and probing.
    pub(crate) fn write(&self, findings: &Findings, took: Duration) {
        let milliseconds = took.as_millis() as u64;
        for (key, milliseconds, notes) in [
            (&self.probed, milliseconds, serde_json::json!(findings)),
            (&self.opened, 0, serde_json::Value::Null),
        ] {
            let facts = EntryFacts::new(self.shown.clone(), milliseconds, notes);
            self.store.put(key, &Entry::from_facts(facts));
        }
    }
}
