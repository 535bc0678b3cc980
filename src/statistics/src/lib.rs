//! Estimates with their intervals, tests and thresholds, of replies that come in clusters.
//!
//! - [`estimate`]: a share with its 95 % interval, by Wilson's score interval at the clusters' effective number of replies.
//! - [`significance`]: exact tests of differences, and Holm's correction.
//! - [`bootstrap`]: resamples of clusters; [`threshold`]: the exposure drop at which half of the accuracy above chance is lost.
//! - [`auc`]: how well a number ranks right replies before wrong ones.
//! - [`quantiles`], [`residuals`], [`trapezoid`], [`split_mix`]: what these share.

#![allow(
    missing_docs,
    reason = "fields and variants of this workspace's own use, whose names say what they are"
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
