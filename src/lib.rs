//! darkqa-eval

pub mod enhance;
pub mod ask;
pub mod error;
pub mod synthesis;
pub mod score;
pub mod types;
