//! Costs of requests: prices, token counts, and the spending limit of a run.

mod image_tokens;
mod prices;
mod spending;

#[cfg(test)]
pub(super) use prices::TierFactors;

pub use image_tokens::{ImageTokenCheck, scaling_image_tokens};
pub use prices::{Price, Prices, TokenBound, Unpriced, stated_charge};
pub use spending::{ChargeRatios, PricedRequest, ReplyExcess, Reservation, Spending};

pub(super) use image_tokens::image_tokens;
pub(super) use spending::Charge;
