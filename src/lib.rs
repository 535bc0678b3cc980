//! darkqa-eval

pub mod error;
pub mod score;
pub mod types;
