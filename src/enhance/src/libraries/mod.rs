//! ONNX Runtime's library: its search, installation, check and opening, and the thread on which it works.

mod install;
mod library;
mod library_file;
mod receipt;
mod runtime;
mod runtime_thread;
mod search;

pub(super) use library::PINNED;
pub use runtime::{Install, Runtime, RuntimeSearch, disable_telemetry};
pub(super) use runtime_thread::{JobEnd, JobLimits};
