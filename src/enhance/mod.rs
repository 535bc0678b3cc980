//! Stage 3, enhance: a degraded image → an enhanced one, by the user's ONNX model on ONNX Runtime's CPU provider.
//!
//! ```text
//! RuntimeSearch::open ─► Runtime ─┐
//!                                 ├─► Enhancer::open ─► Enhancer::enhance : Rgb → Rgb
//! ModelFile::read ─► name, digest ┘
//! ```
//!
//! The convention of a model (how it is fed and read) comes from its graph (layout, type, sizes), else from a sidecar
//! `MODEL.onnx.toml`, else from a preset (`zero-dce:FILE`), else from what published models do (RGB, 0..1). A model that
//! still lacks something is refused, with its name. [`ModelFile::read`] needs no runtime: a file that is not an ONNX model
//! is refused before anything is searched or installed, and a resumed run knows its digest.

mod built_in;
mod convention;
mod describe;
mod enhancer;
mod feeding;
mod file;
mod graph;
mod install;
mod library;
mod memory;
mod output;
mod planes;
mod plausible;
mod port;
mod preset;
mod probe;
mod probe_run;
mod protobuf;
mod reading;
pub(crate) mod runtime;
mod search;
mod session;
mod settings;
mod sidecar;
mod signature;
mod tiles;
mod usage;
mod weights;

pub use enhancer::Enhancer;
pub use file::ModelFile;
pub(crate) use plausible::{DARK, brightness};
pub(crate) use probe::FRAMES;
pub(crate) use probe_run::Implausible;
pub use runtime::{Install, Runtime, RuntimeSearch, forbid_telemetry};
pub(crate) use session::Stopper;
pub(crate) use settings::{EnhancerArgs, ProbeArgs, RuntimeArgs, SizeArgs};
pub use tiles::Tiling;
pub(crate) use usage::Usage;

/// Version of feeding and reading models, raised whenever a pixel changes, so that results of an older version are not
/// reused.
pub const VERSION: u32 = 1;
