//! The images that a run keeps, before they are made: [`ImageSet`].

use super::kinds::StoredKinds;

/// The number of bytes of all images of a run that a store would keep, and the room that it has.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ImageSet {
    kinds: StoredKinds,
    bytes: f64,
    room: f64,
}

impl ImageSet {
    /// The set of no image yet, for a store with this room in bytes.
    pub(super) fn new(kinds: StoredKinds, room: f64) -> Self {
        Self {
            kinds,
            bytes: 0.0,
            room,
        }
    }

    /// Adds images of this many bytes in all, if the store keeps such images.
    pub(crate) fn add(&mut self, is_enhanced: bool, bytes: f64) {
        if is_enhanced || self.kinds == StoredKinds::All {
            self.bytes += bytes;
        }
    }

    /// Which images these are, in words.
    pub(crate) fn words(&self) -> &'static str {
        match self.kinds {
            StoredKinds::Enhanced => "enhanced images",
            StoredKinds::All => "images",
        }
    }

    pub(crate) fn bytes(&self) -> f64 {
        self.bytes
    }

    pub(crate) fn room(&self) -> f64 {
        self.room
    }
}
