//! Comparisons of subjects on the same items, and their tests.

mod agreement;
mod baseline;
mod best;
mod by_profile;
mod claim;
mod comparison;
pub mod paired;
mod pooled;
mod pooled_kind;
mod ranks;
pub mod self_agreement;

pub use agreement::{Agreement, AgreementCounts, clustered_kappa};
pub(super) use agreement::{agreements, kappa, light_agreements};
pub use baseline::{BaselineRow, BaselineSide, baseline_rows};
pub use best::{BestInTheDark, Crossing, DarkAccuracy, DarkGain, DarkPair, LevelLead, best_in_the_dark};
pub(super) use by_profile::by_profile;
pub use by_profile::{EffectInProfile, FindingByProfile, NoiseHypothesis, Robustness, Support, TestedEffect};
pub use claim::Claim;
pub use comparison::{Comparison, ComparisonKind, MIN_PAIRS, TestedComparison, compares_enhancers, compares_models};
pub(super) use comparison::{comparisons, lights_between};
pub(super) use pooled::family_contrasts;
pub(super) use pooled::models_left_out;
pub use pooled::{ContrastTest, FamilyContrast, ModelsLeftOut, PooledDifference, PooledFinding, pool, pooled};
pub use pooled_kind::PooledKind;
pub use ranks::{RankRange, rank_ranges};
