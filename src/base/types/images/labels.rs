//! Class names of the numbers in semantic and segment maps: [`Labels`], [`SegmentName`].

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};

use crate::types::values::Digest;

/// Suffixes in HM3D-Sem's names of objects seen through a door or window. They name the place of the object, not its
/// class.
pub const OTHER_PLACES: [&str; 5] = ["/otherroom", "/ otherroom", "/other room", "/outside", "/ outside"];

/// The class of one number in a semantic map.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Label {
    /// The name in the data set, as `night stand`.
    pub name: String,
    /// The class in the canonical label space (mpcat40), as `chest_of_drawers`.
    pub canonical: String,
}

/// The label space of a data set: its numbers and names, with their canonical classes.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Labels {
    /// The name of the label space, as `nyu40`.
    pub space: String,
    /// The numbers of unlabelled pixels.
    pub void: BTreeSet<u16>,
    /// The class of each number.
    pub labels: BTreeMap<u16, Label>,
    /// The canonical classes with a label of their own: if the map does not contain one, neither does the image. A
    /// class that is not in this set may be present under a more general label, as sinks are labelled `objects` in
    /// NYU13.
    pub expressible: BTreeSet<String>,
}

impl Labels {
    /// The digest of the numbers, names and canonical classes; the space's name is not in it.
    #[must_use]
    pub fn digest(&self) -> Digest {
        let numbers = self.void.iter().map(|id| vec![id.to_string()]);
        let labels =
            self.labels.iter().map(|(id, label)| vec![id.to_string(), label.name.clone(), label.canonical.clone()]);
        let expressible = self.expressible.iter().map(|name| vec![name.clone()]);
        let words: Vec<String> = numbers
            .chain([vec![";".to_owned()]])
            .chain(labels)
            .chain([vec![";".to_owned()]])
            .chain(expressible)
            .flatten()
            .collect();
        Digest::from_parts(words.iter().map(String::as_bytes))
    }
}

/// The name and class of one segment.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct SegmentName {
    /// The name in the data set, as `kitchen cabinet`.
    pub name: String,
    /// The canonical class, as `cabinet`.
    pub canonical: String,
    /// The region (room) of the scene that the segment is in; `None` if unknown.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub region: Option<i64>,
}
