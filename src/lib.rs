//! darkqa-eval

pub mod error;
pub mod synthesis;
pub mod types;
