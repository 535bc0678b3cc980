//! Stage 3, enhance: a degraded image → an enhanced one, by the user's ONNX model on ONNX Runtime's CPU provider.
//!
//! ```text
//! RuntimeSearch::open ─► Runtime ─┐
//!                                 ├─► Enhancer::open ─► Enhancer::enhance : Rgb → Rgb
//! ModelFile::read ─► name, digest ┘
//! ```
//!
//! The convention of a model (how its input is prepared and its output is decoded) comes from its graph (layout, type, sizes), else from a
//! sidecar `MODEL.onnx.toml`, else from a preset (`zero-dce:FILE`), else from the convention of most published models (RGB, 0..1). A model
//! that still lacks a statement is refused, with its name. A run takes these steps from the dark image to the result; those in brackets are
//! rare:
//!
//! ```text
//! window ─ [input = EXPRESSION] ─ [luma] ─ range, mean, std ─► InputEncoding      ─┐
//! number, map, noise, from = EXPRESSION ────────────────────► FurtherInput ─┴─► Graph
//! Graph ─► OutputDecoding (range) ─ [image = EXPRESSION] ─ [luma] ─ clamp, rounding ─► Composition
//! ```
//!
//! [`ModelFile::read`] works without ONNX Runtime, so a file that is not an ONNX model is refused before a library is searched or
//! installed, and a resumed run can compare the model's digest.
//!
//! [`Enhancer::enhance`] plans how an image reaches the model (`sizing`): whole, padded, in tiles, or resized if a flag allows it.
//! Properties that a graph does not declare are found by trial: the accepted multiple or traced size (`sizing/size_search`,
//! `files/traced_sizes`), and the distance up to which pixels influence each other (`sizing/reach`). `limits` estimates the memory of a run
//! in advance and limits its time; `libraries` checks a library before loading it.
//!
//! A wrong convention gives a wrong image and no error. So a model is tried on dark frames before a run ([`Enhancer::probe`]), and its
//! images are checked during the run ([`Usage::judge`]), both by the rules in `probes/plausible`. `probes/doctor` draws the model's images
//! in each convention.

#![cfg_attr(test, allow(clippy::unwrap_used, reason = "a test may panic"))]

mod conventions;
mod enhanced_folder;
mod enhancer;
mod expressions;
mod failure;
mod files;
mod graphs;
mod inputs;
mod libraries;
mod limits;
mod outputs;
mod planes;
mod probes;
mod settings;
mod sizing;

pub use conventions::preset::list_of_presets;
pub use darkqa_models::ROOM_NET;
pub use enhanced_folder::EnhancedFolder;
pub use enhancer::twin::sets_in_memory;
pub use enhancer::{Enhancer, Fitting};
pub use files::ModelFile;
pub use graphs::{LoadLimits, Network, Stopper};
pub use libraries::{Install, Runtime, RuntimeSearch, disable_telemetry};
pub use limits::{MemoryLimit, TimeLimit};
pub use probes::{
    DARK, Examination, FRAMES, Findings, ImageOutput, ImageUse, Implausible, ProposedLine, Settled,
    Usage, brightness,
};
pub use settings::{EnhancerArgs, ProbeArgs, RuntimeArgs, SizeArgs};
pub use sizing::Tiling;

/// Version of the input encoding and output decoding. It is raised whenever an enhanced pixel changes, so that stored results of
/// older versions are not reused.
pub const VERSION: u32 = 2;
