//! Models: remote ones at an endpoint, and built-in ones in this process.

mod finish_words;
mod local;
mod model;
mod remote;
mod stream_fallback;

pub use local::{Local, LocalAnswer, Random, Script};
pub use model::Model;
pub use remote::Remote;
