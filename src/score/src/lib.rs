//! Statistics of a run's records, with their intervals. [`choice`] parses a reply; the primitives ([`estimate`], [`bootstrap`],
//! [`significance`], [`threshold`]) are in the crate `darkqa-statistics`.
//!
//! [`findings`] is the entry point. It arranges the records as a [`grid`] and computes from it the accuracies
//! ([`accuracy`]), the paired differences ([`comparison`]), the curves over the levels ([`curve`]), the answers given
//! against the true ones ([`confusion`]) and the agreement of models ([`agreement`]).
//!
//! Intervals are computed from the clusters ([`cluster`]). Each method was chosen because its 95 % intervals cover the true value in
//! simulation (`statistics.rs` and `coverage/` in `tests/program/scores`; `src/docs/numbers.md` lists the cases with a coverage below
//! 93 %). The plain percentile bootstrap does not do so with fewer than about 50 clusters, or near 0 and 1.
//!
//! - shares: Wilson's score interval at the clusters' effective number of replies ([`estimate::Estimate::clustered`]);
//! - differences: Bonett and Price's adjusted interval with the clusters' variance ([`paired`]), and an exact test;
//! - κ: its linear form in the clusters' counts, with the clusters' variance ([`agreement`]);
//! - confidence: the cluster bootstrap, its bias subtracted for the calibration error ([`calibration`]);
//! - thresholds: the cluster bootstrap ([`bootstrap`]).

#![allow(
    missing_docs,
    reason = "fields and variants of this workspace's own use, whose names say what they are"
)]
#![cfg_attr(test, allow(clippy::unwrap_used, reason = "a test may panic"))]

pub mod accuracy;
pub mod agreement;
pub mod baseline;
pub mod best;
pub mod by_reading;
pub mod calibration;
pub mod chance;
pub mod checks;
pub mod claim;
pub mod cluster;
pub mod common;
pub mod comparison;
pub mod confusion;
mod coverage;
pub mod curve;
pub mod fidelity;
pub mod findings;
pub mod flips;
pub mod grid;
mod head;
pub mod health;
pub mod image_dependence;
pub mod observed;
pub mod open;
pub mod pair_darkness;
pub mod paired;
pub mod photographed_set;
pub mod pooled;
pub mod pooled_kind;
pub mod power;
pub mod ranks;
pub mod realism;
pub mod record;
pub mod self_agreement;
pub mod strict_score;
pub mod subject;
pub mod suggested_scenes;
pub mod tested_sentences;
#[cfg(test)]
mod tests;

pub use darkqa_choice as choice;
pub use darkqa_statistics::{auc, bootstrap, estimate, significance, threshold};
