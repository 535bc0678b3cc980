//! What runs hold, from their records alone, as files and in words.

pub(crate) mod choice;
mod combine;
mod cost;
pub(crate) mod open;
mod runs;

pub use runs::report;
