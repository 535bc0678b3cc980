//! The ONNX Runtime library: search, installation, check, loading, and the thread on which it runs.

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
