//! Inputs of a graph: the encoded image, and further values.

mod further_input;
mod input_encoding;
mod tensor;

pub(super) use further_input::{FurtherInput, is_map_or_noise};
pub(super) use input_encoding::InputEncoding;
pub(super) use tensor::{DegradedImage, FedImage, Tensor, TensorData};
