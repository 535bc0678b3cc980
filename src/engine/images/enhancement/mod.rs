//! Enhancement: the models of a command, and images that other programs enhanced.

mod dark_frames;
mod enhanced_images;
pub mod enhancers;
pub mod latency;

pub(super) use dark_frames::{DarkFrames, dark_frames};
pub(super) use enhanced_images::{DarkImage, EnhancedImages};
pub(super) use enhancers::LazyEnhancer;

pub use dark_frames::{dark_or_darkened, evenly_spaced_indices};
