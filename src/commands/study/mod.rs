//! `study`: collects human answers to the questions of a run.

mod pack;
mod read;

pub(crate) use pack::{PackArgs, pack};
pub(crate) use read::{ReadArgs, read};
