//! Stage 2a, WORDS: frames → questions, by rule (DarkQA, arXiv 2512.24985, Algorithm 1).
//!
//! Each frame is first measured ([`statistics`]), with integers only. The rules ([`rules`], `rules.toml`) use only
//! these measurements: they classify the room ([`room`]) and then generate the questions, one file per family.
//! [`generate()`] is the entry point. Random picks are hashes of the frame's name ([`rule_context`]), so the order of the
//! frames does not matter.

#![allow(missing_docs, reason = "fields and variants of this workspace's own use, whose names say what they are")]
#![cfg_attr(test, allow(clippy::unwrap_used, reason = "a test may panic"))]

mod affordance;
pub mod appearance;
pub mod balance;
mod closest;
mod color;
#[cfg(test)]
mod color_tree;
pub mod colors;
pub mod frequency;
pub mod generate;
pub mod observer;
pub mod predicted;
mod presence;
pub mod reason;
pub mod room;
mod room_type;
pub mod rule_context;
pub mod rules;
pub mod statistics;
pub mod summary;
#[cfg(test)]
mod tests;
mod vocabulary;

use colors::Palette;
use darkqa_base::types::Family;
use rule_context::{RuleContext, RuleResult};

pub use generate::{Generated, QuestionRequest, generate};
pub use rule_context::GeneratedQuestion;

/// The candidates of a family in a frame; none for a category of a ready-made set.
fn candidates(family: &Family, context: &RuleContext<'_>, palette: &Palette) -> Vec<RuleResult> {
    match family {
        Family::RoomType => room_type::candidates(context),
        Family::Affordance => affordance::candidates(context),
        Family::Presence => presence::candidates(context),
        Family::Color => color::candidates(context, palette),
        Family::Closest => closest::candidates(context),
        Family::Other(_) => Vec::new(),
    }
}
