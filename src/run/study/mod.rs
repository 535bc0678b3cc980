//! `study`: people in the place of a model.

mod pack;
mod read;

pub use pack::pack;
pub use read::read;
