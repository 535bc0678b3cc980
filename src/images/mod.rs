//! From a frame to the images of a request: darkened, enhanced, scaled, encoded; with the image store and the notes about each image.
//!
//! A [`frames::Source`] is what is shown together. A [`trials::Plan`] has its trials by condition. The [`image_pipeline`] makes the images
//! of each condition once, by a [`recipes::Recipe`], for everything that is asked or written.

pub(crate) mod enhancement;
pub(crate) mod frame_work;
pub(crate) mod frames;
pub(crate) mod image_pipeline;
pub(crate) mod image_steps;
pub(crate) mod notes;
pub(crate) mod progress;
pub(crate) mod recipes;
pub(crate) mod stored;
pub(crate) mod timings;
pub(crate) mod trials;
pub(crate) mod workers;
