//! What the numbers of a frame's maps stand for: [`Labels`], [`SegmentName`].

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};

use super::digest::Digest;

/// What one number of a semantic map stands for.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Label {
    /// The data set's own word, as `night stand`.
    pub name: String,
    /// The class of the canonical label space (mpcat40) that it belongs to, as `chest_of_drawers`.
    pub canonical: String,
}

/// The label space of a data set: its numbers, its words, and the canonical classes they belong to.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Labels {
    /// Its name, as `nyu40`.
    pub space: String,
    /// The numbers that stand for nothing: unlabelled pixels.
    pub void: BTreeSet<u16>,
    /// What each number stands for.
    pub labels: BTreeMap<u16, Label>,
    /// The canonical classes whose absence from a map means that there is none in the picture. A class without a label of
    /// its own may hide under a catch-all, as sinks do under the `objects` of NYU13.
    pub expressible: BTreeSet<String>,
}

impl Labels {
    /// The content of the whole space.
    #[must_use]
    pub fn digest(&self) -> Digest {
        let numbers = self.void.iter().map(|id| vec![id.to_string()]);
        let labels = self
            .labels
            .iter()
            .map(|(id, label)| vec![id.to_string(), label.name.clone(), label.canonical.clone()]);
        let expressible = self.expressible.iter().map(|name| vec![name.clone()]);
        let words: Vec<String> = numbers
            .chain([vec![";".to_owned()]])
            .chain(labels)
            .chain([vec![";".to_owned()]])
            .chain(expressible)
            .flatten()
            .collect();
        Digest::of_parts(words.iter().map(String::as_bytes))
    }
}

/// What is known of one segment by name.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct SegmentName {
    /// The data set's own word, as `kitchen cabinet`.
    pub name: String,
    /// The canonical class, as `cabinet`.
    pub canonical: String,
    /// The region (room) of the scene that it stands in, where that is known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub region: Option<i64>,
}
