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
mod entry;
mod folder;

pub use access::{ImageStore, StoreArgs};
pub use entry::{Entry, EntryFacts, EntryType, ImageSet, Key, Shown, StoredKinds};
pub use folder::{clear, listing};
