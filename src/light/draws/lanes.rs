//! Batches of samples: [`Lanes`].

/// Samples that a kernel processes at once.
pub(crate) const LANES: usize = 64;

/// Batch of [`LANES`] numbers, one per sample.
pub(crate) type Lanes<T> = [T; LANES];
