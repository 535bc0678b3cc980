//! Stage 3, mend: a dark image through the user's own ONNX model on ONNX Runtime's CPU provider.
//!
//! ```text
//! RuntimeSearch::open ─► Runtime ─┐
//!                                 ├─► Enhancer::open ─► Enhancer::enhance : Rgb → Rgb
//! ModelFile::read ─► name, digest ┘
//! ```
//!
//! A model takes one float32 tensor 1 × 3 × height × width (NCHW), RGB, 0..1, of fixed or dynamic size, and gives back one
//! of the same shape. Every other convention is refused by name, never guessed. [`ModelFile::read`] needs no runtime: a
//! file that is no ONNX model is found out before anything is searched or installed, and a resumed run knows its digest.

pub mod file;
mod install;
mod library;
pub mod onnx;
mod protobuf;
pub mod runtime;
mod search;
mod sidecar;
mod signature;
mod tensor;
mod weights;

pub use file::ModelFile;
pub use onnx::{Enhancer, Stopper};
pub use runtime::{Install, Runtime, RuntimeSearch, forbid_telemetry};

/// The version of the way to and from a model: raised whenever a pixel changes, so that no result of an older one is taken
/// for its own.
pub const VERSION: u32 = 1;
