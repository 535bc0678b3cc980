//! Estimates with intervals, tests, and thresholds for clustered replies.
//!
//! - [`estimate`]: a share with its 95 % interval, by Wilson's score interval at the clusters' effective number of
//!   replies.
//! - [`significance`]: exact tests of differences, and Holm's correction.
//! - [`bootstrap`]: resamples of clusters; [`threshold`]: the exposure drop at which half of the accuracy above chance
//!   is lost.
//! - [`auc`]: how well a number predicts right replies.
//! - [`quantiles`], [`residuals`], [`trapezoid`], [`split_mix`]: helpers of these modules.

pub mod auc;
pub mod bootstrap;
pub mod estimate;
pub(crate) mod quantiles;
pub(crate) mod residuals;
pub mod significance;
pub(crate) mod split_mix;
pub mod threshold;
pub(crate) mod trapezoid;
