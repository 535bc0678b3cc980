//! Costs of requests: prices, token counts, and the spending limit of a run.

mod image_token_check;
mod image_tokens;
mod prices;
mod spending;
mod token_bound;

pub(crate) use image_token_check::ImageTokenCheck;
pub(super) use image_tokens::image_tokens;
pub(crate) use image_tokens::scaling_image_tokens;
pub(crate) use prices::{Price, Prices};
pub(super) use spending::Charge;
pub(crate) use spending::{PricedRequest, ReplyExcess, Reservation, Spending};
pub(crate) use token_bound::TokenBound;
