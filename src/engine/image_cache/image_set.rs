//! Estimate of the bytes that a run would store: [`ImageSet`].

use super::kinds::StoredKinds;

/// Estimated size of a run's images that a store would keep, and the store's capacity, in bytes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ImageSet {
    kinds: StoredKinds,
    bytes: f64,
    room: f64,
}

impl ImageSet {
    /// An empty set, for a store with this capacity in bytes.
    pub(super) fn new(kinds: StoredKinds, room: f64) -> Self {
        Self { kinds, bytes: 0.0, room }
    }

    /// Adds images of this total size in bytes, if the store keeps images of this kind.
    pub(crate) fn add(&mut self, is_enhanced: bool, bytes: f64) {
        if is_enhanced || self.kinds == StoredKinds::All {
            self.bytes += bytes;
        }
    }

    /// Description of the images that the store keeps.
    pub(crate) fn description(&self) -> &'static str {
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
