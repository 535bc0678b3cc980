//! Scores: statistics, intervals and calibration, held to simulations.

mod confidence;
mod coverage;
mod draws;
mod fair;
mod fidelity;
mod flattered;
mod statistics;
