//! Enhancement: the models of a command, and images that other programs enhanced.

mod dark_frames;
mod enhanced_images;
pub(crate) mod enhancers;
pub(crate) mod latency;

pub(super) use dark_frames::{DarkFrames, dark_frames};
pub(super) use enhanced_images::{DarkImage, EnhancedImages};
pub(super) use enhancers::LazyEnhancer;

pub(crate) use dark_frames::{dark_or_darkened, evenly_spaced_indices};
