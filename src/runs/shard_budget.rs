//! The rest of a part's share of `--max-cost`: [`PartCost`].

use serde_json::json;

use crate::report::forecast::money;
use crate::types::manifests::RunManifest;

/// The entry of a manifest's settings with the share of a part, and what is spent and left of it, in US dollars.
const ENTRY: &str = "--max-cost of this part";

/// The share of a part in the limit of cost of its run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PartCost {
    /// The part's budget, in US dollars.
    share: f64,
    /// The cost of its replies, in US dollars.
    spent: f64,
}

impl PartCost {
    /// A share in US dollars, of which this much is spent.
    pub(crate) fn new(share: f64, spent: f64) -> Self {
        Self { share, spent }
    }

    /// The rest of the budget; at least 0.
    fn left(self) -> f64 {
        (self.share - self.spent).max(0.0)
    }

    /// Notes the cost in the manifest of the part.
    pub(crate) fn note(self, manifest: &mut RunManifest) {
        let dollars = json!({ "share": self.share, "spent": self.spent, "left": self.left() });
        manifest.settings.insert(ENTRY.to_owned(), dollars);
    }

    /// Takes the cost of a part out of the manifest of a run that several parts are together.
    pub(crate) fn forget(manifest: &mut RunManifest) {
        manifest.settings.remove(ENTRY);
    }

    /// The cost in words.
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

    #[test]
    fn nothing_is_left_of_a_share_that_is_spent() {
        let cost = |spent| PartCost { share: 0.5, spent };
        assert!((cost(0.2).left() - 0.3).abs() < 1e-12);
        assert_eq!(cost(0.6).left().to_bits(), 0.0_f64.to_bits());
        let words = cost(0.25).words();
        assert!(words.contains("0.25") && words.contains("0.50"), "{words}");
    }
}
