//! Rows that cannot be asked and are left out.

mod contradiction;
mod left_out;
mod skip_bad;

pub(super) use contradiction::{find_contradictions, omit_contradictions};
pub(super) use left_out::{OmissionReason, Omissions};
pub(crate) use skip_bad::SkipBad;
