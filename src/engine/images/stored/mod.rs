//! Stored images: in the image store and in the output folder.

mod output_image;
mod stored_images;

pub(super) use output_image::differing_fields;
pub(super) use stored_images::{FindingsPlace, Similarity, StoredImage, StoredNotes, StoredPlace};

pub use output_image::{ImageCounts, ImageOrigin, ImageOutcome, ImageRefusals, OutputFile, OutputImage, Sidecar};
pub use stored_images::{Needed, StoredFindings, StoredImages};
