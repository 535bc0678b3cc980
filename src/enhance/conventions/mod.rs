//! Input and output conventions of models, from sidecars, presets and graphs.

mod convention;
mod describe;
mod extra;
pub(super) mod preset;
pub(super) mod sidecar;
mod signature;

pub(super) use convention::{
    ChannelOrder, Channels, ElementType, LUMA, Locality, Normalisation, Padding, Rounding, TensorLayout, ValueRange,
    ValueScale,
};
pub(super) use describe::Description;
pub(super) use extra::{ExtraValue, NoiseStatement, SidecarNumber};
pub(super) use signature::{ImageInput, Signature};
