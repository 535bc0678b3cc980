//! Outputs of a graph: their choice, decoding, and composition to an image.

mod composition;
mod output;
mod output_decoding;

pub(super) use composition::{Composition, ImageTensor, OutputTensor};
pub(super) use output::{Output, expression_name, light_map_line};
pub(super) use output_decoding::{InvalidValues, TensorSamples, round_to_u8};
