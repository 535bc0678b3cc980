//! Stage 5, JUDGE: a reply → a choice; records → numbers.
//!
//! [`findings`] is the door to what records say: it lays them out as a [`grid`], and takes from there the accuracies
//! ([`accuracy`]), every difference that is of interest ([`comparison`]), the curves over darkness ([`curve`]), the answers
//! given against the true ones ([`confusion`]) and how far models agree ([`agreement`]).
//!
//! How sure a number is comes from the clusters ([`cluster`]) in one of three ways, each chosen because its 95 % intervals
//! hold the truth 93 to 97 times in a hundred in simulation (`tests/statistics.rs`), which the plain percentile bootstrap
//! does not below some 50 clusters or near 0 and 1:
//!
//! - shares: Wilson's score interval at the clusters' effective number of replies ([`estimate::Estimate::clustered`]);
//! - differences: Bonett and Price's adjusted interval with the clusters' variance ([`paired`]), and an exact test;
//! - whatever is computed from many shares (thresholds, areas, κ): the cluster bootstrap ([`bootstrap`]).

pub mod accuracy;
pub mod agreement;
pub mod bootstrap;
pub mod chance;
pub mod choice;
pub mod cluster;
pub mod comparison;
pub mod confusion;
pub mod curve;
pub mod estimate;
pub mod findings;
pub mod flips;
pub mod grid;
pub mod health;
pub mod llm_match;
pub mod open;
pub mod paired;
pub mod realism;
mod record;
pub mod significance;
mod student;
pub mod subject;
