//! Stored findings about enhancers: that a model was opened, and the result of its probe ([`StoredFindings`]).

use std::time::Duration;

use serde::Serialize;

use crate::error::Result;
use crate::image_store::{Content, Entry, EntryFacts, ImageStore, Key, Shown};
use crate::images::enhancement::enhancers::{Model, OpenEnhancers};
use crate::images::frames::Source;
use crate::images::recipes::{ImageKeyFacts, Maker, Recipe};
use crate::types::{Condition, Digest};
use darkqa_enhance::{self, Findings};

/// The store, with what decides how enhancers run.
#[derive(Debug, Clone, Copy)]
pub(crate) struct StoredFindings<'a> {
    store: &'a ImageStore,
    maker: &'a Maker,
}

/// All that decides what opening and trying a model finds.
#[derive(Serialize)]
struct FindingsRecipe<'a> {
    /// The model, its sidecar and its preset.
    stated: Digest,
    version: u32,
    maker: &'a Maker,
    /// Facts that determine the dark frames on which the model is tried, by frame; `None` for the note that it was opened.
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

    /// Whether all models of a command were opened and tried before, so that they need not be opened to see whether they can be.
    ///
    /// # Errors
    /// If a sidecar has a number that is infinite or NaN.
    pub(crate) fn know_all(self, models: &OpenEnhancers<'_>) -> Result<bool> {
        for model in models.models() {
            if !self.store.contains(&self.key(model, None)?) {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// The place of what a model's probe finds on these frames, each of which it may be tried on in these conditions.
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
            tried: self.key(model, Some(facts))?,
            shown: Shown {
                content: Content::Probe,
                enhancer: Some(model.name().to_string()),
                ..Shown::default()
            },
        })
    }
}

/// All that decides the images of the middle frame of a source in these conditions before they are enhanced.
fn frame_facts<'a>(
    recipe: &'a Recipe,
    source: &'a Source,
    conditions: &[Condition],
) -> Result<Vec<ImageKeyFacts<'a>>> {
    let Some(frame) = source.middle() else {
        return Ok(Vec::new());
    };
    let of = |condition: &Condition| {
        let light = Condition {
            enhancer: None,
            ..condition.clone()
        };
        recipe.facts(&source.name, frame, &light)
    };
    conditions.iter().map(of).collect()
}

/// The place of what a probe found in a store.
#[derive(Debug, Clone)]
pub(crate) struct FindingsPlace<'a> {
    store: &'a ImageStore,
    /// Key of the note that the model was opened.
    opened: Key,
    tried: Key,
    shown: Shown,
}

impl FindingsPlace<'_> {
    /// The findings; `None` if the store has none.
    pub(crate) fn read(&self) -> Option<Findings> {
        let mut findings: Option<Findings> = None;
        self.store.get(&self.tried, Content::Probe, |entry| {
            findings = serde_json::from_value(entry.facts.notes.clone()).ok();
            findings.is_some()
        })?;
        findings
    }

    /// Adds what was found, which took this time.
    pub(crate) fn write(&self, findings: &Findings, took: Duration) {
        let entry = |milliseconds, notes| {
            Entry::from_facts(EntryFacts::new(self.shown.clone(), milliseconds, notes))
        };
        let found = entry(took.as_millis() as u64, serde_json::json!(findings));
        self.store.put(&self.tried, &found);
        self.store
            .put(&self.opened, &entry(0, serde_json::Value::Null));
    }
}
