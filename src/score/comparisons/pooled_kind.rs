//! Kinds of comparisons for pooled findings: [`PooledKind`].

use crate::answers::confusion::FalseAnswer;
use crate::grid::GridItem;
use darkqa_base::types::Family;
use darkqa_base::types::degradations::Kind;

/// Comparison that a pooled finding reports: its two sides, and the replies that it counts. Correct replies are
/// counted, except in [`Self::Hallucination`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum PooledKind {
    /// A degraded level against L0, without an enhancer.
    Darkness,
    /// Exposure drop with sensor noise against exposure drop alone, at the same level.
    Noise,
    /// Enhanced images against raw ones, at the same level and variant.
    Enhancer,
    /// Images of one enhancer against those of another, at the same level and variant.
    EnhancerPair,
    /// Raw images against no image.
    Blind,
    /// False answers to presence questions: a degraded level against L0, without an enhancer.
    Hallucination(FalseAnswer),
}

impl PooledKind {
    /// Comparisons that apply to raw images with this degradation; `None` is L0. [`Self::Noise`] needs a degradation
    /// that extends another.
    pub(super) fn for_raw(degradation: Option<Kind>) -> Vec<Self> {
        let Some(degradation) = degradation else {
            return vec![Self::Blind];
        };
        let noise = degradation.base().map(|_| Self::Noise);
        let others =
            [Self::Darkness, Self::Blind, Self::Hallucination(FalseAnswer::No), Self::Hallucination(FalseAnswer::Yes)];
        others.into_iter().chain(noise).collect()
    }

    /// Name of the comparison in CSV files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Darkness => "darkness",
            Self::Noise => "noise",
            Self::Enhancer => "enhancer",
            Self::EnhancerPair => "enhancers",
            Self::Blind => "blind",
            Self::Hallucination(FalseAnswer::No) => "answers no to what is there",
            Self::Hallucination(FalseAnswer::Yes) => "answers yes to what is not there",
        }
    }

    /// Name of the comparison on images with this degradation. [`Self::Darkness`] is named after the cause of the loss,
    /// which depends on the degradation.
    #[must_use]
    pub fn name_on(self, degradation: Option<Kind>) -> &'static str {
        match (self, degradation) {
            (Self::Darkness, Some(degradation)) => degradation.axis().cause,
            _ => self.name(),
        }
    }

    /// Question family to which the comparison is restricted; `None` if it applies to each family and to all of them
    /// together.
    #[must_use]
    pub fn only_family(self) -> Option<&'static Family> {
        match self {
            Self::Hallucination(_) => Some(&Family::Presence),
            _ => None,
        }
    }

    /// True if the effect is assumed to grow with the level, so that the darkest level is tested first.
    ///
    /// Loss in the dark, loss against the blind baseline and missed objects grow with the level. Noise, enhancers and
    /// invented objects may have their largest effect at any level.
    pub(crate) fn grows_with_the_level(self) -> bool {
        matches!(self, Self::Darkness | Self::Blind | Self::Hallucination(FalseAnswer::No))
    }

    /// True if the average over the levels is tested, too, in addition to each level.
    pub(super) fn is_averaged(self) -> bool {
        matches!(self, Self::Darkness | Self::Noise | Self::Enhancer)
    }

    /// True if the comparison includes an item.
    pub(super) fn is_about(self, item: &GridItem<'_>) -> bool {
        match self {
            Self::Hallucination(answer) => answer.is_false_for(item),
            _ => true,
        }
    }

    /// True if a parsed reply to an item is counted: for [`Self::Hallucination`] a false answer, else a correct reply.
    pub(super) fn counts(self, item: &GridItem<'_>, chosen: Option<u8>) -> bool {
        match self {
            Self::Hallucination(answer) => answer.is_given(item, chosen),
            _ => item.is_right(chosen),
        }
    }

    /// Gain of the first side over the second, given the difference of their counted replies. More false answers are a
    /// loss: the sign is reversed for [`Self::Hallucination`].
    pub(super) fn gain(self, difference: f64) -> f64 {
        match self {
            Self::Hallucination(_) => -difference,
            _ => difference,
        }
    }
}
