//! Options and answers of the questions in a set.

mod answer_format;
mod lettered;
mod option_list;
mod options;
mod truths;

pub(super) use answer_format::{AnswerFormat, digit_index, yes_no_index};
pub(super) use lettered::{LetteredOptions, find_in_question};
pub(crate) use option_list::one_line;
pub(super) use option_list::{OptionInterner, OptionList};
pub(super) use options::Options;
pub(super) use truths::{SetQuestion, find_truths, is_native_format};
