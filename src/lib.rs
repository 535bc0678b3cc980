//! darkqa-eval

pub mod enhance;
pub mod error;
pub mod types;
