//! Costs of a run: its limit, bounds, estimates and measured tokens.

mod budget;
mod budget_notes;
pub(super) mod estimate;
mod in_flight_cost;
mod measured_tokens;
mod money;
pub(crate) mod plan_costs;
mod planned_images;
mod prompt_bounds;
mod stored_costs;
mod token_check;

pub(crate) use budget::text_tokens;
pub(super) use budget::{Budget, Permit, RunModels};
pub(super) use budget_notes::BudgetNotes;
pub(super) use in_flight_cost::InFlightCost;
pub(super) use measured_tokens::MeasuredTokens;
pub(super) use money::{MoneyArgs, MoneySettings};
pub(super) use token_check::TokenCheck;
