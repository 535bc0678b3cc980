//! Cached findings about enhancers in the image store: opened models and results of their probes ([`StoredFindings`]).

use std::time::Duration;

use serde::Serialize;

use crate::engine::image_cache::{Content, Entry, EntryFacts, ImageStore, Key, Shown};
use crate::engine::images::enhancement::enhancers::{EnhancerModels, Model};
use crate::engine::images::frames::Source;
use crate::engine::images::recipes::{ImageKeyFacts, Maker, Recipe};
use crate::error::Result;
use crate::types::{Condition, Digest};
use darkqa_enhance::{self, Findings};

/// Findings in the image store that were made with one set of enhancer settings.
#[derive(Debug, Clone, Copy)]
pub(crate) struct StoredFindings<'a> {
    store: &'a ImageStore,
    maker: &'a Maker,
}

/// Inputs of a store key: everything that can change the findings about a model.
#[derive(Serialize)]
struct FindingsRecipe<'a> {
    /// Digest of the model, its sidecar and its preset.
    stated: Digest,
    version: u32,
    maker: &'a Maker,
    /// Inputs of the probe's dark images, one list per source. `None` in the key that records an opened model.
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

    /// True if all models of a command were opened and probed before. Such models need not be opened again to be
    /// checked.
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

    /// Location in the store of the findings of a model's probe on these frames and conditions.
    ///
    /// # Errors
    /// If a frame cannot be shown in one of its conditions, or a sidecar has a number that is infinite or NaN.
    pub(crate) fn place(
        self,
        recipe: &Recipe,
        model: &Model,
        frames: &[(&Source, Vec<Condition>)],
    ) -> Result<FindingsPlace<'a>> {
        let facts = frames
            .iter()
            .map(|(source, conditions)| middle_frame_facts(recipe, source, conditions))
            .collect::<Result<Vec<_>>>()?;
        Ok(FindingsPlace {
            store: self.store,
            opened_key: self.key(model, None)?,
            probe_key: self.key(model, Some(facts))?,
            shown: Shown { content: Content::Probe, enhancer: Some(model.name().to_string()), ..Shown::default() },
        })
    }
}

/// Key facts of a source's middle frame in each condition, before enhancement; empty if the source has no middle frame.
fn middle_frame_facts<'a>(
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
            let unenhanced = Condition { enhancer: None, ..condition.clone() };
            recipe.key_facts(&source.name, frame, &unenhanced)
        })
        .collect()
}

/// Location of the findings of a probe in the image store.
#[derive(Debug, Clone)]
pub(crate) struct FindingsPlace<'a> {
    store: &'a ImageStore,
    /// Key of the entry that marks the model as opened.
    opened_key: Key,
    /// Key of the entry with the findings.
    probe_key: Key,
    shown: Shown,
}

impl FindingsPlace<'_> {
    /// Reads the findings; `None` if the store does not have them.
    pub(crate) fn read(&self) -> Option<Findings> {
        let mut findings: Option<Findings> = None;
        self.store.get(&self.probe_key, Content::Probe, |entry| {
            findings = serde_json::from_value(entry.facts.notes.clone()).ok();
            findings.is_some()
        })?;
        findings
    }

    /// Writes the findings, then marks the model as opened. `took` is the duration of opening and probing.
    pub(crate) fn write(&self, findings: &Findings, took: Duration) {
        let milliseconds = took.as_millis() as u64;
        for (key, milliseconds, notes) in [
            (&self.probe_key, milliseconds, serde_json::json!(findings)),
            (&self.opened_key, 0, serde_json::Value::Null),
        ] {
            let facts = EntryFacts::new(self.shown.clone(), milliseconds, notes);
            self.store.put(key, &Entry::from_facts(facts));
        }
    }
}
