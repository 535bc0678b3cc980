//! From a frame to the images of a request: degraded, enhanced, scaled, encoded; with the image store and the notes
//! about each image.
//!
//! A [`frames::Source`] contains the frames that are shown together, and a [`trials::Plan`] lists the trials by source
//! and condition. The [`image_pipeline`] makes the images of each condition once, by a [`recipes::Recipe`], for all
//! commands that ask or write them.

pub mod enhancement;
pub mod frame_work;
pub mod frames;
pub mod image_pipeline;
pub mod notes;
pub mod progress;
pub mod recipes;
pub mod stored;
pub mod timings;
pub mod trials;
pub mod workers;
