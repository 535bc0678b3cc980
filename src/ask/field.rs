//! The fields of a request about which servers differ: [`RequestField`] is one of them, [`RequestFields`] are those that are adapted.

use super::complaint::Complaint;
use super::parameters::{Parameters, Temperature, TokenField};

/// A field that a server does not take and that can be sent otherwise.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AdaptableField {
    /// The token limit, by this name.
    TokenField,
    /// Any temperature but its own.
    Temperature,
}

/// Which of the fields about which servers differ a request has; found out once for a whole run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct RequestFields {
    /// The name of the token limit, never `Auto`.
    pub(super) token_field: TokenField,
    /// The temperature, where one is sent.
    pub(super) temperature: Option<f64>,
}

impl RequestFields {
    /// What is tried first at a host.
    pub(super) fn first(parameters: &Parameters, host: &str) -> Self {
        Self {
            token_field: parameters.token_field.at(host),
            temperature: match parameters.temperature {
                Temperature::Auto => Some(0.0),
                Temperature::Server => None,
                Temperature::Of(value) => Some(value),
            },
        }
    }
}

/// What a request has in it that a server may complain about.
#[derive(Debug, Clone, Copy)]
pub(super) struct SentFields<'a> {
    pub(super) parameters: &'a Parameters,
    pub(super) fields: RequestFields,
    pub(super) has_image: bool,
    pub(super) has_key: bool,
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
pub(super) struct RequestField {
    pub(super) name: &'static str,
    /// Whether it was sent; what was not is not to blame.
    pub(super) sent: bool,
    /// How to send it otherwise.
    pub(super) hint: &'static str,
    /// What it is, where the program can send it otherwise.
    pub(super) refused: Option<AdaptableField>,
}

impl RequestField {
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
