//! darkqa-eval

pub mod ask;
pub mod error;
pub mod types;
