//! Omissions: rows that cannot be asked.

mod contradiction;
mod left_out;
mod skip_bad;

pub(super) use contradiction::{contradictory, leave_out};
pub(super) use left_out::{OmissionReason, Omissions};
pub(crate) use skip_bad::SkipBad;
