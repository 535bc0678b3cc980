//! Stage 3, enhance: runs the user's ONNX model on degraded images, with ONNX Runtime's CPU execution provider.
//!
//! ```text
//! RuntimeSearch::open ─► Runtime ─┐
//!                                 ├─► Enhancer::open ─► Enhancer::enhance : Rgb → Rgb
//! ModelFile::read ─► name, digest ┘
//! ```
//!
//! The convention of a model defines how its input is prepared and how its output is decoded. Each setting is taken
//! from the first source that defines it:
//!
//! 1. the graph (layout, element type, sizes)
//! 2. a sidecar `MODEL.onnx.toml`
//! 3. a preset (`zero-dce:FILE`)
//! 4. the convention of most published models (RGB, 0..1)
//!
//! A model with a setting that no source defines is refused; the error names the setting.
//!
//! An image passes these steps; those in brackets are rare:
//!
//! ```text
//! window ─ [input = EXPRESSION] ─ [luma] ─ range, mean, std ─► InputEncoding ─┐
//! number, map, noise, from = EXPRESSION ─────────────────────► FurtherInput ──┴─► Graph
//! Graph ─► OutputDecoding (range) ─ [image = EXPRESSION] ─ [luma] ─ clamp, rounding ─► Composition
//! ```
//!
//! [`ModelFile::read`] works without ONNX Runtime. A file that is not an ONNX model is therefore refused before ONNX
//! Runtime is located or installed, and a resumed run can check the model's digest without it.
//!
//! [`Enhancer::enhance`] passes an image to the model whole, padded, in tiles, or resized if a flag allows it
//! (`sizing`). Trial inferences find properties that a graph does not declare: the required multiple of the input size
//! or the size fixed by tracing (`sizing/size_search`, `files/traced_sizes`), and the receptive field (`sizing/reach`).
//! `limits` estimates the memory of an inference in advance and limits its time. `libraries` checks a shared library
//! before loading it.
//!
//! A wrong convention gives a wrong image, not an error. Each model is therefore tested on dark frames before a run
//! ([`Enhancer::probe`]), and its images are checked during the run ([`Usage::judge`]). Both use the rules in
//! `probes/plausible`. `probes/doctor` renders the model's images under each convention.

#![cfg_attr(test, allow(clippy::unwrap_used, reason = "a test may panic"))]

mod conventions;
pub(crate) mod enhancer;
pub(crate) mod expressions;
mod failure;
mod files;
mod graphs;
mod inputs;
mod libraries;
pub(crate) mod limits;
mod outputs;
mod planes;
mod probes;
mod settings;
mod sizing;

pub use conventions::preset::list_of_presets;
pub use darkqa_models::ROOM_NET;
pub use enhancer::{Enhancer, Fitting, sets_in_memory};
pub use files::ModelFile;
pub use graphs::{LoadLimits, Network, Stopper};
pub use libraries::{Install, Runtime, RuntimeSearch, disable_telemetry};
pub use limits::{MemoryLimit, TimeLimit};
pub use probes::{
    DARK, Examination, FRAMES, ImageOutput, ImageUse, Implausible, ProbeFindings, ProposedLine, Settled, Usage,
    brightness, burnt_out, shows_nothing,
};
pub use settings::{EnhancedFolder, EnhancerArgs, ProbeArgs, RuntimeArgs, SizeArgs};
pub use sizing::Tiling;

/// Version of the input encoding and output decoding. Any change to enhanced pixels increments it, so that results
/// stored by an older version are not reused.
pub const VERSION: u32 = 2;
