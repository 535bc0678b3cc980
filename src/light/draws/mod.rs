//! Random numbers and their distributions.

mod lanes;
mod piecewise;
pub(super) mod poisson;
mod quantile;
mod random;

pub(super) use lanes::{LANES, Lanes};
pub(super) use piecewise::Piecewise;
pub(super) use quantile::Quantile;
pub use quantile::tukey_lambda;
#[cfg(test)]
pub(super) use random::RandomField;
pub use random::{Component, NoiseKey, Site};
pub(super) use random::{SiteWords, Stream};
