//! Questions, their families and the bounding boxes of the objects that they are about.

mod outlines;
mod question;
mod run_question;
mod strict_group;

pub use outlines::PixelBox;
pub use question::{Answer, CANNOT_TELL, Choices, Family, Question, QuestionId, Truths, UnreadReason, letter};
pub use run_question::{BANK_ID, QuestionPart, RunQuestion};
pub use strict_group::StrictGroup;
