//! Answers: their records, their mistakes, and their dependence on the image.

pub mod confusion;
mod image_dependence;
pub mod record;

pub use image_dependence::{ImageDependence, Independence, LitReply, MIN_REPLIES};
