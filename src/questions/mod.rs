//! Stage 2a, WORDS: frames → questions, by rule (DarkQA, arXiv 2512.24985, Algorithm 1).
//!
//! First each frame is measured ([`statistics`]), by integers alone; then the rules ([`rules`], `rules.toml`) see what was
//! measured and nothing else: what room it is ([`room`]), then one file a family. [`generate()`] is the door. There is no
//! random state: what has to be picked is a function of the frame's name ([`pick`]), and nothing depends on the order in which
//! frames come.

mod affordance;
pub(crate) mod balance;
mod closest;
mod color;
#[cfg(test)]
mod color_tree;
pub(crate) mod colors;
pub(crate) mod frequency;
pub(crate) mod generate;
pub(crate) mod observer;
pub(crate) mod pick;
mod presence;
pub(crate) mod reason;
pub(crate) mod room;
mod room_type;
pub(crate) mod rule_context;
pub(crate) mod rules;
pub(crate) mod statistics;
pub(crate) mod summary;
#[cfg(test)]
mod tests;

pub use generate::{Generated, QuestionRequest, generate};
pub use rule_context::GeneratedQuestion;
