//! Digests, canonical JSON, a cache, and shared values.

#[cfg(feature = "program")]
mod canonical;
mod digest;
mod recent;
mod shared;

pub use digest::Digest;
pub use recent::Recent;
pub use shared::{Distinct, Shared};
