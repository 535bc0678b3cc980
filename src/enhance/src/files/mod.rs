//! Files of models: their protobuf messages, weights and operators, read without a runtime.

mod built_in;
mod file;
mod frozen;
mod onnx_message;
mod protobuf;
mod random_operators;
mod weights;

pub use file::ModelFile;
pub(super) use frozen::traced_sizes;
pub(super) use random_operators::RandomOperators;
