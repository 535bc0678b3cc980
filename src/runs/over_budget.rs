//! Note in a manifest that a run cost more than `--max-cost`: [`OverBudget`].

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use serde_json::json;

use crate::types::manifests::RunManifest;
use crate::types::text::money;

/// Manifest setting with the note.
const ENTRY: &str = "--max-cost exceeded";

/// Cost of a run that exceeded its limit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct OverBudget {
    /// The limit, in US dollars.
    pub(crate) limit: f64,
    /// The cost, in US dollars.
    pub(crate) spent: f64,
    /// Number of replies that were charged more tokens than their limit, by model.
    #[serde(default)]
    pub(crate) longer_replies: BTreeMap<String, usize>,
    /// Number of replies that were charged more than the price table says, by model.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub(crate) dearer_replies: BTreeMap<String, usize>,
}

impl OverBudget {
    /// Replaces the note in a manifest; removes it if the run is within its limit.
    pub(crate) fn note(over: Option<&Self>, manifest: &mut RunManifest) {
        manifest.settings.remove(ENTRY);
        if let Some(over) = over {
            manifest.settings.insert(ENTRY.to_owned(), json!(over));
        }
    }

    /// Reads the note in a manifest; `None` if there is none.
    pub(crate) fn read(manifest: &RunManifest) -> Option<Self> {
        serde_json::from_value(manifest.settings.get(ENTRY)?.clone()).ok()
    }

    /// A sentence about the cost, with the cause if it is known.
    pub(crate) fn sentence(&self) -> String {
        let causes = [
            (&self.longer_replies, "replies that were charged more tokens than --max-tokens"),
            (&self.dearer_replies, "replies that were charged more than the price table"),
        ];
        let cause: String = causes
            .into_iter()
            .filter(|(replies, _)| !replies.is_empty())
            .map(|(replies, what)| {
                let replies: Vec<String> = replies.iter().map(|(model, count)| format!("{model} ({count})")).collect();
                format!("; {what}: {}", replies.join(", "))
            })
            .collect();
        format!("The requests cost {}, more than the {} of --max-cost{cause}.", money(self.spent), money(self.limit))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sentence_names_the_models_that_exceeded_their_limit() {
        let mut over =
            OverBudget { limit: 0.5, spent: 2.0, longer_replies: BTreeMap::new(), dearer_replies: BTreeMap::new() };
        let plain = "The requests cost $2.00, more than the $0.5000 of --max-cost.";
        assert_eq!(over.sentence(), plain);
        over.longer_replies.insert("m".to_owned(), 3);
        assert!(over.sentence().ends_with("than --max-tokens: m (3)."));
        over.longer_replies.clear();
        over.dearer_replies.insert("m".to_owned(), 2);
        let sentence = over.sentence();
        assert!(sentence.ends_with("; replies that were charged more than the price table: m (2)."));
    }
}
