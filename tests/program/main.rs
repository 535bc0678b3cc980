//! The tests of the program and the library as a whole, a module a subject. They are one program, because each test
//! program links the library anew: `cargo test --test program report::` runs one module.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

#[path = "../support/mod.rs"]
mod support;

mod architecture;
mod batches;
mod cli;
mod data;
mod deployments;
mod documentation;
mod endpoints;
mod images;
mod models;
mod reports;
mod robustness;
mod runs;
mod scores;
