//! Estimates with intervals, tests, and thresholds for clustered replies.
//!
//! - [`estimate`]: a share with its 95 % interval, by Wilson's score interval at the clusters' effective number of replies.
//! - [`significance`]: exact tests of differences, and Holm's correction.
//! - [`bootstrap`]: resamples of clusters; [`threshold`]: the exposure drop at which half of the accuracy above chance is lost.
//! - [`auc`]: how well a number predicts right replies.
//! - [`quantiles`], [`residuals`], [`trapezoid`], [`split_mix`]: helpers of these modules.

#![allow(
    missing_docs,
    reason = "fields and variants for use within this workspace, with descriptive names"
)]
#![cfg_attr(test, allow(clippy::unwrap_used, reason = "a test may panic"))]

pub mod auc;
pub mod bootstrap;
pub mod estimate;
pub mod quantiles;
pub mod residuals;
pub mod significance;
pub mod split_mix;
pub mod threshold;
pub mod trapezoid;
