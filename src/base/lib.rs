//! Errors, files, types and label spaces, shared by all crates of darkqa-eval.
//!
//! - [`error`]: the one error type.
//! - [`types`]: the vocabulary, without input or output.
//! - [`files`]: files and folders, read with bounds and written whole.
//! - [`labels`]: the label spaces NYU40, mpcat40, ADE150 and NYU13.

#![cfg_attr(test, allow(clippy::unwrap_used, reason = "a test may panic"))]

pub mod error;
pub mod files;
#[cfg(feature = "program")]
pub mod labels;
pub mod types;

pub use error::{Error, Result};
