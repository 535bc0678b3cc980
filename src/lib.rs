//! darkqa-eval

pub mod error;
pub mod types;
