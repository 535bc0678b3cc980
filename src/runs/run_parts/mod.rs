//! The parts of a run, read as one run: [`RunParts`]. `report merge` writes that run, and `report` reports on it as it is.

mod coverage;
mod joined;
mod joined_manifest;
mod missing;
mod part;
mod questions;
mod stored_parts;
mod trials;

pub(crate) use joined::RunParts;
pub(crate) use missing::MissingParts;
pub(crate) use stored_parts::{any_run, choice_run, one_kind, runs_in};
