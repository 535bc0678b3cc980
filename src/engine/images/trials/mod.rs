//! Trials: the questions and conditions that are asked.

mod conditions;
mod plan;
pub(crate) mod questions;
mod questions_by_rule;
mod trial;

pub(crate) use conditions::{check_enhanced, check_used, conditions};
pub(crate) use plan::{Plan, SourcePlan, TrialGroup};
pub(crate) use trial::{Item, PreparedGroup, Prompt, Stimulus, Trial};
