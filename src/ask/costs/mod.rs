//! Costs of requests: prices, token counts, and the spending limit of a run.

mod charge_ratios;
mod image_token_check;
mod image_tokens;
mod prices;
mod spending;
mod tier_factors;
mod token_bound;

pub(crate) use charge_ratios::ChargeRatios;
pub(crate) use image_token_check::ImageTokenCheck;
pub(super) use image_tokens::image_tokens;
pub(crate) use image_tokens::scaling_image_tokens;
pub(crate) use prices::{Price, Prices, Unpriced, stated_charge};
pub(super) use spending::Charge;
pub(crate) use spending::{PricedRequest, ReplyExcess, Reservation, Spending};
#[cfg(test)]
pub(super) use tier_factors::TierFactors;
pub(crate) use token_bound::TokenBound;
