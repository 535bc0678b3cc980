//! Stored images: in the image store and in the folder of output.

mod placed_image;
mod refusals;
mod stored_findings;
mod stored_images;
mod stored_thumbnails;

pub(super) use placed_image::differing;
pub(crate) use placed_image::{
    ImageCounts, ImageOrigin, ImageOutcome, OutputFile, Placed, Sidecar,
};
pub(crate) use refusals::Refusals;
pub(super) use stored_findings::FindingsPlace;
pub(crate) use stored_findings::StoredFindings;
pub(super) use stored_images::{MadeNotes, Similarity, StoredImage, StoredPlace};
pub(crate) use stored_images::{Needed, StoredImages};
pub(super) use stored_thumbnails::ThumbnailPlace;
