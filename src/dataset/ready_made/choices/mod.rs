//! Choices of a question: its options and its answer.

mod answers;
mod lettered;
mod offered;
mod options;
mod truths;

pub(super) use answers::{Reading, digit, yes_or_no};
pub(super) use lettered::{Lettered, in_question};
pub(in crate::dataset) use offered::one_line;
pub(super) use offered::{AllOffered, Offered};
pub(super) use options::Options;
pub(super) use truths::{Answered, is_own, truths};
