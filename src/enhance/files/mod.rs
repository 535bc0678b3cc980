//! ONNX files of models, read without ONNX Runtime: protobuf messages, weights and operators.

mod built_in;
mod computed_products;
mod file;
mod onnx_message;
mod protobuf;
mod random_operators;
mod traced_sizes;
mod value_info;
mod weights;

pub(super) use computed_products::computed_products;
pub use file::ModelFile;
pub(super) use random_operators::RandomOperators;
pub(super) use traced_sizes::traced_sizes;
