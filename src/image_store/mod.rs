//! The image store (`--images-cache`): images that were made, shared by runs, models, shards and processes ([`ImageStore`]).
//!
//! An image is found by its [`Key`], the digest of all that decides it. What the store holds is made again without it, so its folder may
//! be deleted at any time. A store never fails a run: what cannot be read is made again, and what cannot be written is left out, with
//! one warning.
//!
//! ```text
//! DIR/v1/ab/cdef….img    one image, its facts and a footer (`entry`), written under another name and renamed
//! DIR/v1/.lock           held while files are removed (`sweep`)
//! ```

mod access;
mod counts;
mod entry;
mod folder;
mod image_set;
mod key;
mod kinds;
mod listing;
mod settings;
mod sweep;

pub(crate) use access::ImageStore;
pub(crate) use entry::{Content, Entry, EntryFacts, Shown};
pub(crate) use image_set::ImageSet;
pub(crate) use key::Key;
pub(crate) use kinds::StoredKinds;
pub(crate) use listing::{clear, listing};
pub(crate) use settings::StoreArgs;
