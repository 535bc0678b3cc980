//! Estimates with intervals, tests, and thresholds for clustered replies.
//!
//! - [`estimate`]: a share with its 95 % interval, by Wilson's score interval at the clusters' effective number of
//!   replies.
//! - [`significance`]: exact tests of differences, and Holm's correction.
//! - [`bootstrap`]: resamples of clusters; [`threshold`]: the exposure drop at which half of the accuracy above chance
//!   is lost.
//! - [`auc`]: how well a number predicts right replies.
//! - [`estimate`], [`estimate`], [`threshold`], [`bootstrap`]: helpers of these modules.

pub mod auc;
pub mod bootstrap;
pub mod estimate;
pub mod significance;
pub mod threshold;
