//! Enhancement: the models of a command, and images that were enhanced elsewhere.

mod dark_frames;
mod enhanced_images;
pub(crate) mod enhancers;
mod resting_enhancer;

pub(super) use dark_frames::{DarkFrames, dark_frames};
pub(crate) use dark_frames::{darkened, evenly};
pub(super) use enhanced_images::{DarkImage, EnhancedImages};
pub(super) use resting_enhancer::RestingEnhancer;
