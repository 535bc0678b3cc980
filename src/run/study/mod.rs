//! `study`: people in the place of a model.

mod pack;
mod read;

pub(crate) use pack::{PackArgs, pack};
pub(crate) use read::{ReadArgs, read};
