//! Stored images: in the image store and in the output folder.

mod output_image;
mod refusals;
mod stored_findings;
mod stored_images;
mod stored_thumbnails;

pub(super) use output_image::differing_fields;
pub(crate) use output_image::{ImageCounts, ImageOrigin, ImageOutcome, OutputFile, OutputImage, Sidecar};
pub(crate) use refusals::Refusals;
pub(super) use stored_findings::FindingsPlace;
pub(crate) use stored_findings::StoredFindings;
pub(crate) use stored_images::{Needed, StoredImages};
pub(super) use stored_images::{Similarity, StoredImage, StoredNotes, StoredPlace};
