//! Outputs of a graph: their choice, and the image made of them.

mod composition;
mod output;
mod reading;

pub(super) use composition::{Composition, ImageTensor, OutputTensor};
pub(super) use output::{Output, in_expression, light_map_line};
pub(super) use reading::{OutOfRange, TensorSamples, nearest};
