//! Prompt templates, of this program and of OpenEQA.

pub(crate) mod openeqa;
mod prompt;

pub use prompt::Prompts;
