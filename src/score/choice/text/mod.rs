//! The text of a reply: cleaned, without markup, and cut into words and clauses.

mod clauses;
mod marks;
pub(super) mod plain;
mod ranges;
pub(super) mod reasoning;
mod refusal;
pub(super) mod tokens;

pub(super) use clauses::{Boundary, Clauses, Element};
pub(super) use plain::{RANGE, fold, plain};
pub(super) use ranges::Ranges;
pub(super) use refusal::declines;
pub(super) use tokens::{Token, TokenKind, tokens};
