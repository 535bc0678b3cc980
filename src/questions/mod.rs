//! Stage 2a, WORDS: frames → questions, by rule (DarkQA, arXiv 2512.24985, Algorithm 1).
//!
//! First each frame is measured ([`statistics`]), with integers only. The rules ([`rules`], `rules.toml`) see only these
//! measurements. They find the type of room ([`room`]) and then the questions, one file per family. [`generate()`] is the
//! entry point. There is no random state: a pick is a function of the frame's name ([`pick`]), so the order of the frames
//! does not matter.

mod affordance;
pub(crate) mod balance;
mod closest;
mod color;
#[cfg(test)]
mod color_tree;
pub(crate) mod colors;
pub(crate) mod frequency;
pub(crate) mod generate;
pub(crate) mod look;
pub(crate) mod observer;
pub(crate) mod pick;
mod presence;
pub(crate) mod reason;
mod relative;
pub(crate) mod room;
mod room_type;
pub(crate) mod rule_context;
pub(crate) mod rules;
pub(crate) mod statistics;
pub(crate) mod summary;
#[cfg(test)]
mod tests;
mod views;
mod vocabulary;

pub use generate::{Generated, QuestionRequest, generate};
pub use rule_context::GeneratedQuestion;
