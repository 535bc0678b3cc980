//! Random numbers and their distributions.

pub(super) mod poisson;
mod random;

#[cfg(test)]
pub(super) use random::RandomField;

pub(super) use poisson::{Piecewise, Quantile};
pub(super) use random::{LANES, Lanes, SiteWords, Stream};

pub use poisson::tukey_lambda;
pub use random::{Component, NoiseKey, Site};
