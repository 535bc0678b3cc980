//! From a frame to the images of a request: degraded, enhanced, scaled, encoded; with the image store and the notes
//! about each image.
//!
//! A [`frames::Source`] contains the frames that are shown together, and a [`trials::Plan`] lists the trials by source
//! and condition. The [`image_pipeline`] makes the images of each condition once, by a [`recipes::Recipe`], for all
//! commands that ask or write them.

pub(crate) mod enhancement;
pub(crate) mod frame_work;
pub(crate) mod frames;
pub(crate) mod image_pipeline;
pub(crate) mod notes;
pub(crate) mod progress;
pub(crate) mod recipes;
pub(crate) mod stored;
pub(crate) mod timings;
pub(crate) mod trials;
pub(crate) mod workers;
