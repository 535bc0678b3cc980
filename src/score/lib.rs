//! Statistics of a run's records, with their intervals. [`choice`] parses a reply; the primitives ([`estimate`],
//! [`bootstrap`], [`significance`], [`threshold`]) are in `statistics`.
//!
//! [`findings`] is the entry point. It arranges the records as a [`grid`] and computes from it the accuracies
//! and the curves over the levels ([`accuracies`]), the paired differences and the agreement of models
//! ([`comparisons`]), and the answers given against the true ones ([`answers`]).
//!
//! Intervals are computed from the clusters ([`cluster`]). Each method was chosen because its 95 % intervals cover the
//! true value in simulation (`statistics.rs` and `coverage/` in `tests/program/scores`; `src/docs/numbers.md` lists the
//! cases with a coverage below 93 %). The plain percentile bootstrap does not with fewer than about 50 clusters, or
//! near 0 and 1.
//!
//! - shares: Wilson's score interval at the clusters' effective number of replies ([`estimate::Estimate::clustered`]);
//! - differences: Bonett and Price's adjusted interval with the clusters' variance ([`comparisons::paired`]), and an
//!   exact test;
//! - κ: its linear form in the clusters' counts, with the clusters' variance ([`comparisons::Agreement`]);
//! - confidence: the cluster bootstrap, with its bias subtracted for the calibration error ([`calibration`]);
//! - thresholds: the cluster bootstrap ([`bootstrap`]).

#![allow(missing_docs, reason = "fields and variants of this workspace's own use, whose names say what they are")]
#![cfg_attr(test, allow(clippy::unwrap_used, reason = "a test may panic"))]

pub mod accuracies;
pub mod answers;
pub mod calibration;
pub mod choice;
pub mod cluster;
pub mod comparisons;
pub mod findings;
pub mod grid;
pub mod model_in_condition;
pub mod observed;
pub mod open;
pub mod photographs;
pub mod power;
mod statistics;
pub mod suggested_scenes;
pub mod tested_sentences;
#[cfg(test)]
mod tests;
pub mod variation;

pub use statistics::{auc, bootstrap, estimate, significance, threshold};
