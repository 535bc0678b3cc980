//! Enhancement: the models of a command, and images that other programs enhanced.

mod dark_frames;
mod enhanced_images;
pub(crate) mod enhancers;
mod lazy_enhancer;

pub(super) use dark_frames::{DarkFrames, dark_frames};
pub(crate) use dark_frames::{dark_or_darkened, evenly_spaced_indices};
pub(super) use enhanced_images::{DarkImage, EnhancedImages};
pub(super) use lazy_enhancer::LazyEnhancer;
