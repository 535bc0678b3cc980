//! States of names in a text: denied, excluded, questioned, conditional or repeated.

mod conditions;
mod denials;
pub(super) mod determiner;
mod exclusions;
mod image_words;
mod questions;
mod repetitions;
mod scope;

pub(super) use conditions::conditional;
pub(super) use denials::denied;
pub(super) use exclusions::excluded;
pub(super) use image_words::image_colors;
pub(super) use questions::questioned;
pub(super) use repetitions::repetitions;
