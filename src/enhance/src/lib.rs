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
//! [`Enhancer::enhance`] makes a plan for the size of an image (`size_plan`): whole, padded, in tiles, or resized if a flag allows it.
//! Properties that a graph does not declare are found by trial: the multiple or the traced size that it accepts (`size_search`, `frozen`),
//! and how far a pixel sees (`reach`). Memory is estimated before (`memory_check`), time is limited (`time_limit`), and a library is
//! checked before it is loaded (`library_file`, `receipt`).
//!
//! A wrong convention gives a wrong image and no error. So a model is tried on dark frames before a run ([`Enhancer::probe`]), and its
//! images are checked during it ([`Usage::judge`]), both by the rules in `plausible`. `doctor` shows the model's images with each
//! convention.

#![cfg_attr(test, allow(clippy::unwrap_used, reason = "a test may panic"))]

mod built_in;
mod channel_slice;
mod composition;
mod control_group;
mod convention;
mod describe;
mod doctor;
mod enhanced_folder;
mod enhancer;
mod expression;
mod extra;
mod failure;
mod fed_image;
mod feeding;
mod file;
mod findings;
mod frozen;
mod further_input;
mod graph;
mod install;
mod library;
mod library_file;
mod memory;
mod memory_check;
mod memory_limit;
mod network;
mod noise;
mod onnx_message;
mod output;
mod parser;
mod planes;
mod plausible;
mod port;
mod preset;
mod probe;
mod probe_run;
mod protobuf;
mod random_operators;
mod reach;
mod reading;
mod receipt;
pub mod runtime;
mod runtime_thread;
mod search;
mod session;
mod settings;
mod sidecar;
mod signature;
mod size_plan;
mod size_search;
mod sizes;
mod tensor;
mod term;
mod texture;
mod tiles;
mod time_limit;
mod usage;
mod weights;

pub use darkqa_models::ROOM_NET;
pub use doctor::{Examination, ImageOutput, ProposedLine, Settled};
pub use enhanced_folder::EnhancedFolder;
pub use enhancer::twin::sets_in_memory;
pub use enhancer::{Enhancer, Fitting};
pub use file::ModelFile;
pub use findings::Findings;
pub use graph::LoadLimits;
pub use memory_limit::MemoryLimit;
pub use network::Network;
pub use plausible::{DARK, brightness};
pub use preset::list_of_presets;
pub use probe::FRAMES;
pub use runtime::{Install, Runtime, RuntimeSearch, forbid_telemetry};
pub use session::Stopper;
pub use settings::{EnhancerArgs, ProbeArgs, RuntimeArgs, SizeArgs};
pub use tiles::Tiling;
pub use time_limit::TimeLimit;
pub use usage::{ImageUse, Implausible, Usage};

/// Version of feeding and reading models, raised whenever a pixel changes, so that results of an older version are not
/// reused.
pub const VERSION: u32 = 2;
