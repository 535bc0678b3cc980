//! Degradations and conditions: the processing of a frame before a model sees it, and the light of photographs.

mod axis_level;
mod condition;
mod condition_columns;
mod degradation;
mod exposure_facts;
mod kind_set;
mod pair_dark;
mod pair_facts;
mod run_group;
mod set_light;
mod severity;
mod treatment;
mod treatment_set;

pub use axis_level::{AxisLevel, Variant};
pub use condition::{Condition, EnhancerName};
pub use condition_columns::ConditionColumns;
pub use degradation::{Degradation, Kind, ProfileName};
pub use exposure_facts::ExposureFacts;
pub use kind_set::KindSet;
pub use pair_dark::{PairDark, PhotoName};
pub use pair_facts::PairFacts;
pub use run_group::RunGroup;
pub use set_light::SetLight;
pub use severity::{Axis, Severity};
pub use treatment::Treatment;
pub use treatment_set::TreatmentSet;
