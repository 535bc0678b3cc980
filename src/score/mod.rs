//! Stage 5, JUDGE: from a reply to a choice, and from records to numbers.
//!
//! [`findings`] is the entry point. It arranges the records as a [`grid`] and computes from it the accuracies
//! ([`accuracy`]), the paired differences ([`comparison`]), the curves over the levels ([`curve`]), the answers given
//! against the true ones ([`confusion`]) and the agreement of models ([`agreement`]).
//!
//! Intervals come from the clusters ([`cluster`]) in one of three ways. Each was chosen because its 95 % intervals hold the
//! truth 93 to 97 times in a hundred in simulation (`tests/program/statistics.rs`). The plain percentile bootstrap does not do so
//! with fewer than about 50 clusters, or near 0 and 1.
//!
//! - shares: Wilson's score interval at the clusters' effective number of replies ([`estimate::Estimate::clustered`]);
//! - differences: Bonett and Price's adjusted interval with the clusters' variance ([`paired`]), and an exact test;
//! - numbers that are computed from many shares (thresholds, areas, κ): the cluster bootstrap ([`bootstrap`]).

pub(crate) mod accuracy;
pub(crate) mod agreement;
pub(crate) mod bootstrap;
pub(crate) mod chance;
pub mod choice;
pub(crate) mod cluster;
pub(crate) mod comparison;
pub(crate) mod confusion;
pub(crate) mod curve;
pub(crate) mod estimate;
pub(crate) mod findings;
pub(crate) mod flips;
pub(crate) mod grid;
pub(crate) mod health;
pub(crate) mod llm_match;
pub(crate) mod observed;
pub(crate) mod open;
pub(crate) mod paired;
pub(crate) mod realism;
mod record;
pub(crate) mod significance;
mod student;
pub(crate) mod subject;
