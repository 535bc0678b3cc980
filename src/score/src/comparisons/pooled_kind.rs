//! Kinds of pooled findings: the compared sides and the counted replies, [`PooledKind`].

use crate::answers::confusion::FalseAnswer;
use crate::grid::GridItem;
use darkqa_ground::types::Family;
use darkqa_ground::types::degradations::Kind;

/// The two sides of a pooled finding. Right replies are counted unless a variant defines others.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum PooledKind {
    /// A degraded level against L0, without an enhancer.
    Darkness,
    /// Sensor noise against exposure drop alone, at the same level.
    Noise,
    /// Enhanced against raw, at the same level and variant.
    Enhancer,
    /// Raw images against no image.
    Blind,
    /// A degraded level against L0, without an enhancer: false answers to presence questions.
    Hallucination(FalseAnswer),
}

impl PooledKind {
    /// Kinds for raw images of a kind of degradation; `None` is L0.
    pub(super) fn for_raw(degradation: Option<Kind>) -> Vec<Self> {
        let Some(degradation) = degradation else {
            return vec![Self::Blind];
        };
        let noise = degradation.base().map(|_| Self::Noise);
        let others = [
            Self::Darkness,
            Self::Blind,
            Self::Hallucination(FalseAnswer::No),
            Self::Hallucination(FalseAnswer::Yes),
        ];
        others.into_iter().chain(noise).collect()
    }

    /// Name of the kind in CSV files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Darkness => "darkness",
            Self::Noise => "noise",
            Self::Enhancer => "enhancer",
            Self::Blind => "blind",
            Self::Hallucination(FalseAnswer::No) => "answers no to what is there",
            Self::Hallucination(FalseAnswer::Yes) => "answers yes to what is not there",
        }
    }

    /// Name of the kind for images of a kind of degradation; for [`Self::Darkness`], the cause of the loss there.
    #[must_use]
    pub fn name_on(self, degradation: Option<Kind>) -> &'static str {
        match (self, degradation) {
            (Self::Darkness, Some(degradation)) => degradation.axis().cause,
            _ => self.name(),
        }
    }

    /// The only family that findings of this kind are about; `None` if they are about each family and all together.
    #[must_use]
    pub fn only_family(self) -> Option<&'static Family> {
        match self {
            Self::Hallucination(_) => Some(&Family::Presence),
            _ => None,
        }
    }

    /// True if the effect is assumed to grow with the level, so that the darkest level is tested first: loss in the dark, accuracy below
    /// the blind baseline, missed objects. The effects of noise and enhancers and false objects may be largest at any level.
    pub(crate) fn grows_with_the_level(self) -> bool {
        matches!(
            self,
            Self::Darkness | Self::Blind | Self::Hallucination(FalseAnswer::No)
        )
    }

    /// True if levels are also tested together: for the costs of darkness and noise, and the effect of enhancers.
    pub(super) fn is_averaged(self) -> bool {
        matches!(self, Self::Darkness | Self::Noise | Self::Enhancer)
    }

    /// True if findings of this kind include an item.
    pub(super) fn is_about(self, item: &GridItem<'_>) -> bool {
        match self {
            Self::Hallucination(answer) => answer.is_false_for(item),
            _ => true,
        }
    }

    /// True if a parsed reply to an item is counted.
    pub(super) fn counts(self, item: &GridItem<'_>, chosen: Option<u8>) -> bool {
        match self {
            Self::Hallucination(answer) => answer.is_given(item, chosen),
            _ => item.is_right(chosen),
        }
    }

    /// Gain of the first side over the second, given the difference of their counted replies.
    pub(super) fn gain(self, difference: f64) -> f64 {
        match self {
            Self::Hallucination(_) => -difference,
            _ => difference,
        }
    }
}
