//! Comparisons of subjects on the same items, and their tests.

mod agreement;
mod baseline;
pub(crate) mod best;
mod by_profile;
pub(crate) mod comparison;
pub mod paired;
pub(crate) mod pooled;
mod pooled_kind;
pub mod self_agreement;
mod tested;

pub use agreement::{Agreement, AgreementCounts, clustered_kappa};
pub use baseline::{BaselineRow, BaselineSide, baseline_rows};
pub use best::{
    BestInTheDark, Crossing, DarkAccuracy, DarkGain, DarkPair, LevelLead, RankRange, best_in_the_dark, rank_ranges,
};
pub use by_profile::{ClaimVerdict, EffectInProfile, FindingByProfile, NoiseHypothesis, Robustness};
pub use comparison::{
    Comparison, ComparisonKind, MAX_COMPARED_MODELS, MIN_PAIRS, compared_models, compares_enhancers, ranks_models,
};
pub use pooled::{FamilyContrast, ModelsLeftOut, PooledDifference, PooledFinding, pool, pooled};
pub use pooled_kind::PooledKind;
pub use tested::{Claim, Tested};

pub(super) use agreement::{agreements, kappa, light_agreements};
pub(super) use by_profile::by_profile;
pub(super) use comparison::{comparisons, lights_between};
pub(super) use pooled::{family_contrasts, models_left_out};
