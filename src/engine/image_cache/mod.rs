//! Image store (`--images-cache`): a cache of images shared by runs, models, shards and processes ([`ImageStore`]).
//!
//! An image is found by its [`Key`], the digest of everything that determines it. The folder may be deleted at any
//! time, because all its content can be computed again. The store never makes a run fail: images that cannot be read
//! are computed again, and images that cannot be written are left out, with one warning.
//!
//! ```text
//! DIR/v1/ab/cdef….img    one image, its facts and a footer (`entry`), written under another name and renamed
//! DIR/v1/.lock           locked while files are removed (`sweep`)
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
