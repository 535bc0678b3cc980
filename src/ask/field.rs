//! The fields of a request that servers quarrel about: [`fields`].

use super::complaint::Complaint;
use super::parameters::{Constrain, TokenField};
use super::verdict::Sent;

/// A field that a server does not take and that can be sent otherwise.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Refused {
    /// The token limit, by this name.
    TokenField,
    /// Any temperature but its own.
    Temperature,
}

/// How servers say that they do not know a field or do not take its value, rather than that it does not fit this request.
const UNSUPPORTED: [&str; 10] = [
    "unsupported",
    "not supported",
    "does not support",
    "unrecognized",
    "unknown",
    "unexpected",
    "not permitted",
    "not allowed",
    "extra inputs",
    "instead",
];

/// A field of a request with what is known of it.
pub(super) struct Field {
    name: &'static str,
    /// Whether it was sent; what was not is not to blame.
    pub(super) sent: bool,
    /// How to send it otherwise.
    pub(super) hint: &'static str,
    /// What it is, where the program can send it otherwise.
    pub(super) refused: Option<Refused>,
}

/// The fields that a server may complain about.
pub(super) fn fields(sent: Sent<'_>) -> [Field; 7] {
    let parameters = sent.parameters;
    let limit = |field| parameters.max_tokens.is_some() && sent.fields.token_field == field;
    let field = |name, sent, hint| Field {
        name,
        sent,
        hint,
        refused: None,
    };
    [
        Field {
            refused: Some(Refused::Temperature),
            ..field(
                "temperature",
                sent.fields.temperature.is_some(),
                "leave the temperature to the server: --temperature default",
            )
        },
        Field {
            refused: Some(Refused::TokenField),
            ..field(
                "max_tokens",
                limit(TokenField::MaxTokens),
                "send the limit otherwise: --token-field max_completion_tokens (or none), or another --max-tokens",
            )
        },
        Field {
            refused: Some(Refused::TokenField),
            ..field(
                "max_completion_tokens",
                limit(TokenField::MaxCompletionTokens),
                "send the limit otherwise: --token-field max_tokens (or none), or another --max-tokens",
            )
        },
        field(
            "reasoning_effort",
            parameters.reasoning_effort.is_some(),
            "leave --reasoning-effort out, or give a value the model takes",
        ),
        field(
            "detail",
            sent.has_image && parameters.detail.is_some(),
            "leave --detail out, or give a value the server takes",
        ),
        field(
            "response_format",
            parameters.constrain == Constrain::Json,
            "leave --constrain out: the server does not take it",
        ),
        field(
            "structured_outputs",
            parameters.constrain == Constrain::Choice,
            "leave --constrain out, or try --constrain json",
        ),
    ]
}

impl Field {
    /// Whether the server names it as what is wrong.
    pub(super) fn is_named(&self, complaint: &Complaint) -> bool {
        let param = complaint.param.as_deref();
        param.is_some_and(|param| param.rsplit(['.', '/']).next() == Some(self.name))
    }

    /// Whether the server's words speak of it.
    pub(super) fn is_mentioned(&self, complaint: &Complaint) -> bool {
        mentions(&complaint.message, self.name)
    }
}

/// Whether the server does not know the field, or does not take any value like it.
pub(super) fn is_unsupported(complaint: &Complaint) -> bool {
    let codes = [
        "unsupported_parameter",
        "unsupported_value",
        "unknown_parameter",
    ];
    complaint.says_any(&UNSUPPORTED) || complaint.is_any(&codes)
}

/// Whether a text holds a name as a whole word: `max_tokens` is not in `max_tokens_total`.
fn mentions(text: &str, name: &str) -> bool {
    let inside = |c: char| c.is_alphanumeric() || c == '_';
    text.split(|c: char| !inside(c)).any(|word| word == name)
}
