//! Judging replies: from what a model said to which choice it made.

pub mod choice;
