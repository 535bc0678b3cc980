//! Degradations and conditions: what was done to a frame before a model saw it, and the light of photographs.

mod axis_level;
mod condition;
mod condition_columns;
mod degradation;
mod exposure_facts;
mod kind_set;
mod light_group;
mod pair_dark;
mod pair_facts;
mod set_light;
mod severity;
mod treatment;
mod treatment_set;

pub use axis_level::{AxisLevel, Variant};
pub use condition::{Condition, EnhancerName};
pub use condition_columns::ConditionColumns;
pub use degradation::{Degradation, Kind, ReadingName};
pub use exposure_facts::ExposureFacts;
pub use kind_set::KindSet;
pub use light_group::RunGroup;
pub use pair_dark::{PairDark, PhotoName};
pub use pair_facts::PairFacts;
pub use set_light::SetLight;
pub use severity::{Axis, Severity};
pub use treatment::Treatment;
pub use treatment_set::TreatmentSet;
