//! States of names in a text: denied, excluded, questioned, conditional or repeated.

mod conditions;
pub(super) mod denials;

pub(super) use conditions::{conditional, questioned, repetitions};
pub(super) use denials::{denied, excluded, image_colors};
