//! One pooled difference and its tests: [`PooledFinding`].

use crate::choice::ParsingMode;
use crate::comparisons::pooled_kind::PooledKind;
use crate::comparisons::tested::{Claim, Tested};
use crate::estimate::largest;
use crate::significance::Verdict;
use darkqa_base::types::degradations::Kind;
use darkqa_base::types::{AxisLevel, EnhancerName, Family, Variant};

/// Difference of two conditions at one level, pooled over models, in both parsings.
#[derive(Debug, Clone, PartialEq)]
pub struct PooledFinding {
    /// The two sides of the comparison, and the counted replies.
    pub kind: PooledKind,
    /// Question family; `None` for all families together. Findings about false answers are only about
    /// [`Family::Presence`].
    pub family: Option<Family>,
    /// Kind of degradation of the first side, with its noise profile; [`Variant::NONE`] for L0 against no image.
    pub variant: Variant,
    /// Enhancer of the first side; `None` for raw images.
    pub enhancer: Option<EnhancerName>,
    /// Enhancer of the second side; `None` except for two enhancers.
    pub against: Option<EnhancerName>,
    /// Level of the first side; the darkest level for a mean over several.
    pub level: AxisLevel,
    /// All levels of a mean over several, sorted; empty for one level.
    pub mean_over: Vec<AxisLevel>,
    /// Models, sorted; the same for all findings of one set (kind, variant and enhancers).
    pub models: Vec<String>,
    /// Models without images on the second side, sorted; empty for other kinds of findings. The same as `models` if
    /// these were also asked without images.
    pub blind_models: Vec<String>,
    /// Difference in the strict parsing, which is the main result.
    pub strict: PooledDifference,
    /// Difference in the lenient parsing.
    pub lenient: PooledDifference,
    /// Share of the replies of each side that follow the answer format, so that the strict parsing finds a choice.
    pub format: [f64; 2],
    /// Number of findings in the set.
    pub levels: usize,
    /// Number of items that every model answered on both sides.
    pub items: usize,
    /// Number of items that some model was asked on both sides, left out because a model has no reply.
    pub dropped: usize,
    /// Number of items that every model was asked on both sides, and of which a reply is missing on one side only. The
    /// intervals and verdicts hold for all values of the missing replies.
    pub missing: usize,
    /// Number of clusters of the items.
    pub clusters: usize,
    /// Smallest p-value that this number of clusters, c, allows: 2 / 2ᶜ.
    pub least_p: f64,
    /// Smallest corrected p-value that the clusters allow; no verdict is possible if it is 0.05 or more.
    pub least_holm: f64,
}

/// A pooled difference in one parsing of the replies.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PooledDifference {
    /// Accuracy or rate of false answers of the first side: mean over the items of the mean over the models.
    pub first: f64,
    /// Accuracy or rate of false answers of the second side.
    pub second: f64,
    /// `first` minus `second`, for all models at once; its `n` is the number of items. Holm's correction is over the
    /// levels of its set: the same kind, variant, enhancer and family.
    pub tested: Tested,
}

impl PooledFinding {
    /// Returns the finding with the largest difference in either direction, the first of several; `None` without
    /// findings.
    #[must_use]
    pub fn largest<'f>(levels: &[&'f Self]) -> Option<&'f Self> {
        largest(levels, |finding| finding.strict.tested.difference)
    }

    /// The statement that sentences may make.
    #[must_use]
    pub fn claim(&self) -> Claim {
        Claim::new([&self.strict.tested, &self.lenient.tested], |difference| self.kind.gain(difference))
    }

    /// Verdict in tables and figures, which is that of the sentences; `None` if no sentence is about the finding.
    #[must_use]
    pub fn verdict(&self) -> Option<Verdict> {
        self.claim().verdict(&self.strict.tested)
    }

    /// True if the level, or every level of a mean, is in the darker part of the ladder: L4 (7.5 EV) and darker, or for
    /// another kind of degradation the fourth step and beyond. The paper's claims about enhancers divide L1–L3 and
    /// L4–L5 in the same way.
    #[must_use]
    pub fn is_severe(&self) -> bool {
        is_severe(self.level, self.variant.kind)
    }

    pub(crate) fn parsed_mut(&mut self, mode: ParsingMode) -> &mut PooledDifference {
        mode.of([&mut self.strict, &mut self.lenient])
    }

    /// Difference in a parsing.
    #[must_use]
    pub fn parsed(&self, mode: ParsingMode) -> &PooledDifference {
        mode.of([&self.strict, &self.lenient])
    }
}

/// True for the darker part of the ladder of a kind.
pub(super) fn is_severe(level: AxisLevel, kind: Option<Kind>) -> bool {
    let fourth = kind.and_then(|kind| Some(AxisLevel::new(kind, *kind.ladder().get(3)?)));
    fourth.is_some_and(|fourth| level.value() >= fourth.value())
}
