//! Limits of memory and time for enhancers.

mod control_group;
pub(super) mod memory;
mod memory_check;
mod memory_limit;
mod time_limit;

pub(super) use memory_check::{MemoryCheck, out_of_memory};
pub use memory_limit::MemoryLimit;
pub use time_limit::TimeLimit;
pub(super) use time_limit::{ImageClock, MAX_CONSECUTIVE_OVERRUNS, PATIENCE};
