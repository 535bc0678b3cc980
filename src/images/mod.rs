//! From a frame to the images of a request: darkened, enhanced, scaled, encoded; with the image store and the notes about each image.
//!
//! A [`source`] is what is shown together. A [`plan`] has its trials by condition. The [`image_pipeline`] makes the images of each
//! condition once, by a [`recipe`], for everything that is asked or written.

pub(crate) mod conditions;
pub(crate) mod dark_frames;
pub(crate) mod enhanced_images;
pub(crate) mod enhancers;
pub(crate) mod frame_work;
pub(crate) mod image_maker;
pub(crate) mod image_notes;
pub(crate) mod image_pipeline;
pub(crate) mod image_recipe;
pub(crate) mod image_steps;
pub(crate) mod image_words;
pub(crate) mod input_tally;
pub(crate) mod montage;
pub(crate) mod photograph;
pub(crate) mod photographs;
pub(crate) mod placed_image;
pub(crate) mod plan;
pub(crate) mod progress;
pub(crate) mod questions;
pub(crate) mod questions_by_rule;
pub(crate) mod recipe;
pub(crate) mod refusals;
pub(crate) mod resting_enhancer;
pub(crate) mod source;
pub(crate) mod stored_findings;
pub(crate) mod stored_images;
pub(crate) mod stored_thumbnails;
pub(crate) mod thumbnail;
pub(crate) mod timings;
pub(crate) mod trial;
pub(crate) mod walk;
pub(crate) mod workers;
