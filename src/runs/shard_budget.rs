//! A shard's share of `--max-cost`: [`ShardBudget`].

use serde_json::json;

use crate::types::manifests::RunManifest;
use crate::types::text::money;

/// Manifest setting with the share of a shard, the amount spent, and the amount left, in US dollars.
const ENTRY: &str = "--max-cost of this part";

/// A shard's share of the cost limit of its run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ShardBudget {
    /// In US dollars.
    share: f64,
    /// Cost of the shard's replies, in US dollars.
    spent: f64,
}

impl ShardBudget {
    pub(crate) fn new(share: f64, spent: f64) -> Self {
        Self { share, spent }
    }

    /// Amount left, in US dollars; at least 0.
    fn left(self) -> f64 {
        (self.share - self.spent).max(0.0)
    }

    /// Notes the budget in the manifest of the shard.
    pub(crate) fn note(self, manifest: &mut RunManifest) {
        let dollars = json!({ "share": self.share, "spent": self.spent, "left": self.left() });
        manifest.settings.insert(ENTRY.to_owned(), dollars);
    }

    /// Removes the note from the manifest of a run joined from shards.
    pub(crate) fn remove_note(manifest: &mut RunManifest) {
        manifest.settings.remove(ENTRY);
    }

    /// The sentence about the amount left.
    pub(crate) fn words(self) -> String {
        format!(
            "{} of its {} of --max-cost are left; other parts do not get them",
            money(self.left()),
            money(self.share)
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn half_budget(spent: f64) -> ShardBudget {
        ShardBudget { share: 0.5, spent }
    }

    #[test]
    fn nothing_is_left_of_a_share_that_is_spent() {
        assert!((half_budget(0.2).left() - 0.3).abs() < 1e-12);
        assert_eq!(half_budget(0.6).left().to_bits(), 0.0_f64.to_bits());
        let words = half_budget(0.25).words();
        assert!(words.contains("0.25") && words.contains("0.50"), "{words}");
    }
}
