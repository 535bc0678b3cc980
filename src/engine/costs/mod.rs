//! Costs of a run: its limit, bounds, estimates and measured tokens.

mod budget;
pub mod estimate;
mod money;
mod token_check;

pub use budget::text_tokens;

pub(super) use budget::{Budget, Permit, RunModels};
pub(super) use money::{MoneyArgs, MoneySettings};
pub(super) use token_check::{BudgetNotes, InFlightCost, MeasuredTokens, TokenCheck};
