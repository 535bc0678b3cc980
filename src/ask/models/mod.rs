//! Models: remote ones at an endpoint, and built-in ones in this process.

mod contradictions;
mod finish_words;
mod local;
mod model;
mod random;
mod remote;
mod script;
mod stream_fallback;

pub(crate) use local::{Local, LocalAnswer};
pub use model::Model;
pub use random::Random;
pub use remote::Remote;
pub use script::Script;
