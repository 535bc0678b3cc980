//! Conventions of models: statements of sidecars, presets and graphs, and their description.

mod convention;
mod describe;
mod extra;
pub(super) mod preset;
pub(super) mod sidecar;
mod signature;

#[cfg(test)]
pub(super) use convention::Normalisation;
pub(super) use convention::{
    ChannelOrder, Channels, ElementType, LUMA, Padding, Rounding, TensorLayout, Tile, ValueRange,
    ValueScale,
};
pub(super) use describe::Description;
pub(super) use extra::{ExtraValue, NoiseStatement, Number};
pub(super) use signature::{ImageInput, Signature};
