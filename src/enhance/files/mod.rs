//! ONNX files of models, read without ONNX Runtime: protobuf messages, weights and operators.

mod computed_products;
mod file;
mod protobuf;
mod random_operators;
mod traced_sizes;

pub(super) use computed_products::computed_products;
pub(super) use random_operators::RandomOperators;
pub(super) use traced_sizes::traced_sizes;

pub use file::ModelFile;
