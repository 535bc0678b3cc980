//! Degradations and conditions: the processing of a frame before a model sees it, and the light of photographs.

mod condition;
mod degradation;
mod pair_dark;
mod treatment_set;

pub use condition::{AxisLevel, Condition, ConditionColumns, EnhancerName, RunGroup, Treatment, Variant};
pub use degradation::{Axis, Degradation, Kind, ProfileName, Severity};
pub use pair_dark::{ExposureFacts, PairDark, PairFacts, PhotoName, SetLight};
pub use treatment_set::{KindSet, TreatmentSet};
