//! The field in which a token limit is sent: [`TokenField`].

use clap::ValueEnum;

use crate::types::flags::flag_words;

/// The field in which a token limit is sent.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
#[value(rename_all = "snake_case")]
pub enum TokenField {
    /// Known name of the endpoint, else max_tokens; the other one if the server asks for it
    Auto,
    /// Understood by every other server
    MaxTokens,
    /// Required by reasoning models of OpenAI
    MaxCompletionTokens,
    /// No limit is sent
    #[value(name = "none")]
    Omit,
}

flag_words!(TokenField);
