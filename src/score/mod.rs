//! Stage 5, JUDGE: from a reply to a choice, and from records to numbers.
//!
//! [`findings`] is the entry point. It arranges the records as a [`grid`] and computes from it the accuracies
//! ([`accuracy`]), the paired differences ([`comparison`]), the curves over the levels ([`curve`]), the answers given
//! against the true ones ([`confusion`]) and the agreement of models ([`agreement`]).
//!
//! Intervals come from the clusters ([`cluster`]). Each was chosen because its 95 % intervals hold the truth in simulation
//! (`tests/program/statistics.rs` and `coverage/`; `src/docs/numbers.md` says where they do so less than 93 times in a hundred).
//! The plain percentile bootstrap does not do so with fewer than about 50 clusters, or near 0 and 1.
//!
//! - shares: Wilson's score interval at the clusters' effective number of replies ([`estimate::Estimate::clustered`]);
//! - differences: Bonett and Price's adjusted interval with the clusters' variance ([`paired`]), and an exact test;
//! - κ: its linear form in the clusters' counts, with the clusters' variance ([`agreement`]);
//! - confidence: the cluster bootstrap, its bias subtracted for the calibration error ([`calibration`]);
//! - thresholds: the cluster bootstrap ([`bootstrap`]).

pub(crate) mod accuracy;
pub(crate) mod agreement;
pub(crate) mod auc;
pub(crate) mod baseline;
pub(crate) mod best;
pub(crate) mod bootstrap;
pub(crate) mod by_reading;
pub(crate) mod calibration;
pub(crate) mod chance;
pub(crate) mod checks;
pub mod choice;
pub(crate) mod cluster;
pub(crate) mod common;
pub(crate) mod comparison;
pub(crate) mod confusion;
pub(crate) mod curve;
pub(crate) mod estimate;
pub(crate) mod fidelity;
pub(crate) mod findings;
pub(crate) mod flips;
pub(crate) mod grid;
pub(crate) mod health;
pub(crate) mod llm_match;
pub(crate) mod observed;
pub(crate) mod open;
mod option_probabilities;
pub(crate) mod pair_darkness;
pub(crate) mod paired;
pub(crate) mod photographed_set;
pub(crate) mod pooled;
pub(crate) mod pooled_kind;
mod quantiles;
pub(crate) mod ranks;
pub(crate) mod realism;
mod record;
mod residuals;
pub(crate) mod self_agreement;
pub(crate) mod significance;
mod split_mix;
pub(crate) mod strict_score;
pub(crate) mod subject;
#[cfg(test)]
mod tests;
pub(crate) mod threshold;
mod trapezoid;
