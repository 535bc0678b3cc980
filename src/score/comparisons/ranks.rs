//! Ranks of models as ranges: [`RankRange`].

use super::best::BestInTheDark;
use crate::significance::Significance;

/// Possible ranks of a model among all compared models, from `first` to `last` inclusive.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct RankRange {
    /// Number of models that are shown to be better, plus 1.
    pub first: usize,
    /// Number of models that are not shown to be worse.
    pub last: usize,
}

/// Ranks of the models of a comparison, in its order. Models without a detected difference share ranks.
pub fn rank_ranges(best: &BestInTheDark) -> Vec<RankRange> {
    best.models
        .iter()
        .map(|model| {
            let (mut better, mut worse) = (0, 0);
            for pair in &best.pairs {
                let (is_first, is_second) = (pair.first == model.model, pair.second == model.model);
                match pair.significance {
                    Significance::Better if is_second => better += 1,
                    Significance::Worse if is_first => better += 1,
                    Significance::Better if is_first => worse += 1,
                    Significance::Worse if is_second => worse += 1,
                    _ => {}
                }
            }
            RankRange { first: better + 1, last: best.models.len() - worse }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::super::best::{DarkAccuracy, DarkGain, DarkPair};
    use super::*;
    use crate::estimate::Estimate;
    use crate::significance::SwapMethod;
    use darkqa_base::types::Variant;

    fn best(names: &[&str], shown: &[(&str, &str, Significance)]) -> BestInTheDark {
        let share = Estimate { value: 0.5, low: 0.4, high: 0.6, n: 10 };
        let models = names.iter().map(|name| DarkAccuracy {
            model: (*name).to_owned(),
            mean: share,
            lighter: 0.5,
            by_level: Vec::new(),
            clean: share,
            loss: None,
        });
        let pairs = shown.iter().map(|(first, second, significance)| DarkPair {
            first: (*first).to_owned(),
            second: (*second).to_owned(),
            difference: share,
            p: 0.01,
            p_if_answered: 0.01,
            p_by: SwapMethod::Counted,
            holm: 0.01,
            significance: *significance,
        });
        BestInTheDark {
            variant: Variant::NONE,
            levels: Vec::new(),
            lighter: Vec::new(),
            gain: DarkGain { is_against_blind: false, difference: share, p: 1.0, p_report: None },
            crossing: None,
            p_report: None,
            asked: Vec::new(),
            without: Vec::new(),
            models: models.collect(),
            not_shown_better_than: Vec::new(),
            pairs: pairs.collect(),
            items: 10,
            dropped: 0,
            clusters: 10,
            least_p: 0.01,
        }
    }

    /// Ranges of ranks of four models.
    fn ranges(shown: &[(&str, &str, Significance)]) -> Vec<(usize, usize)> {
        rank_ranges(&best(&["a", "b", "c", "d"], shown)).into_iter().map(|rank| (rank.first, rank.last)).collect()
    }

    #[test]
    fn ties_share_their_places() {
        use Significance::{Better, NotShown, TooFewClusters, Worse};
        // No difference is detected, whether or not the clusters allow it.
        let unshown = [("a", "b", NotShown), ("a", "c", TooFewClusters)];
        assert_eq!(ranges(&unshown), [(1, 4); 4]);
        // The first is shown to be better than all others, the last worse than the first alone.
        let first =
            [("a", "b", Better), ("a", "c", Better), ("a", "d", Better), ("b", "c", NotShown), ("b", "d", Better)];
        assert_eq!(ranges(&first), [(1, 1), (2, 3), (2, 4), (3, 4)]);
        // A pair counts the same from its other side.
        assert_eq!(ranges(&[("b", "a", Worse)]), ranges(&[("a", "b", Better)]));
    }
}
