//! `study`: people in the place of a model.

mod pack;
mod read;

pub use pack::{PackArgs, pack};
pub use read::{ReadArgs, read};
