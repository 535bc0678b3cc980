//! Notes about images for the report: thumbnails and fidelity.

mod image_notes;
mod montage;
pub(crate) mod thumbnail;

pub(crate) use image_notes::{ImageNotes, MissingNotes};
pub(super) use image_notes::{WantedNotes, fidelity, similarity};
pub(crate) use montage::montage;
