//! Images, frames with their maps, and pixels.

mod display_codes;
mod frame;
mod image;
mod isa;
mod labels;
mod pixels;

#[cfg(feature = "program")]
pub use frame::Frame;
pub use frame::{DepthKind, FrameId, Intrinsics, Segmentation, is_image_ending};
pub use image::{Image, Light, Rgb, Rgb16Image, Sample};
pub use isa::{Isa, Kernel};
pub use labels::{Label, Labels, OTHER_PLACES, SegmentName};
pub use pixels::Pixels;
