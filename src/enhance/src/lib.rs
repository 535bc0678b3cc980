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
//! window ─ [input = EXPRESSION] ─ [luma] ─ range, mean, std ─► Feeding      ─┐
//! number, map, noise, from = EXPRESSION ────────────────────► FurtherInput ─┴─► Graph
//! Graph ─► OutputReading (range) ─ [image = EXPRESSION] ─ [luma] ─ clamp, rounding ─► Composition
//! ```
//!
//! [`ModelFile::read`] needs no runtime: a file that is not an ONNX model
//! is refused before anything is searched or installed, and a resumed run knows its digest.
//!
//! [`Enhancer::enhance`] makes a plan for the size of an image (`sizing`): whole, padded, in tiles, or resized if a flag allows it.
//! Properties that a graph does not declare are found by trial: the multiple or the traced size that it accepts (`sizing/size_search`,
//! `files/frozen`), and how far a pixel sees (`sizing/reach`). Memory is estimated before and time is limited (`limits`), and a library is
//! checked before it is loaded (`libraries`).
//!
//! A wrong convention gives a wrong image and no error. So a model is tried on dark frames before a run ([`Enhancer::probe`]), and its
//! images are checked during it ([`Usage::judge`]), both by the rules in `probes/plausible`. `probes/doctor` shows the model's images with
//! each convention.

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

/// Version of feeding and reading models, raised whenever a pixel changes, so that results of an older version are not
/// reused.
pub const VERSION: u32 = 2;
