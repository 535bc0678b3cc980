//! The ONNX Runtime library: search, installation, check, loading, and the thread on which it runs.

mod install;
mod library_file;
mod runtime;
mod search;

pub(super) use library_file::PINNED;
pub(super) use runtime::{JobEnd, JobLimits};

pub use runtime::{Install, Runtime, RuntimeSearch, disable_telemetry};
