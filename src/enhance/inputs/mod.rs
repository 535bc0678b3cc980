//! Inputs of a graph: the encoded image, and further values.

mod fed_image;
mod further_input;
mod input_encoding;
mod noise;
mod tensor;

pub(super) use fed_image::{DarkImage, FedImage};
pub(super) use further_input::{FurtherInput, is_map_or_noise};
pub(super) use input_encoding::InputEncoding;
pub(super) use tensor::{Tensor, TensorData};
