//! The fields of a request that not all servers accept: [`RequestField`] is one of them, [`RequestFields`] are those that the
//! program adapts.

use super::complaint::Complaint;
use super::parameters::{Parameters, Temperature, TokenField};
use super::vendor::Vendor;

/// A field that a server may refuse and that the program can send in another way.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AdaptableField {
    /// The token limit, which has two names.
    TokenField,
    /// The temperature; some models accept only their default.
    Temperature,
}

/// The adaptable fields of a request, as found out once for a whole run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct RequestFields {
    /// The name of the token limit, never `Auto`.
    pub(super) token_field: TokenField,
    /// The temperature; `None` if none is sent.
    pub(super) temperature: Option<f64>,
}

impl RequestFields {
    /// The fields of the first request to a host.
    pub(super) fn first(parameters: &Parameters, host: &str) -> Self {
        Self {
            token_field: Vendor::token_field_at(host, parameters.token_field),
            temperature: match parameters.temperature {
                Temperature::Auto => Some(0.0),
                Temperature::Server => None,
                Temperature::Of(value) => Some(value),
            },
        }
    }
}

/// The contents of a request that a server may refuse.
#[derive(Debug, Clone, Copy)]
pub(super) struct SentFields<'a> {
    pub(super) parameters: &'a Parameters,
    pub(super) fields: RequestFields,
    pub(super) has_image: bool,
    pub(super) has_key: bool,
}

/// Words by which servers say that they do not support a field or its value, and not that the value is wrong.
const UNSUPPORTED: [&str; 18] = [
    "unsupported",
    "not supported",
    "does not support",
    "unrecognized",
    "unknown",
    "unexpected",
    "not permitted",
    "not allowed",
    "extra inputs",
    "extra_forbidden",
    "deprecated",
    "only the default",
    "no longer",
    "removed",
    "cannot be set",
    "must be set to",
    "not enabled",
    "instead",
];

/// A field of a request, with the remedy if it is refused.
pub(super) struct RequestField<'a> {
    pub(super) name: &'a str,
    /// Whether the field was sent; otherwise it is not the cause.
    pub(super) sent: bool,
    /// The remedy for the user: the flag that changes the field.
    pub(super) hint: &'static str,
    /// The kind of field, if the program can send it in another way.
    pub(super) adaptable: Option<AdaptableField>,
}

impl RequestField<'_> {
    /// Whether the server names the field as the cause.
    pub(super) fn is_named(&self, complaint: &Complaint) -> bool {
        let param = complaint.param.as_deref();
        param.is_some_and(|param| param.rsplit(['.', '/']).next() == Some(self.name))
    }

    /// Whether the server's text mentions the field.
    pub(super) fn is_mentioned(&self, complaint: &Complaint) -> bool {
        mentions(&complaint.message, self.name)
    }
}

/// Whether the server says that it does not support a field or a kind of value.
pub(super) fn is_unsupported(complaint: &Complaint) -> bool {
    let codes = [
        "unsupported_parameter",
        "unsupported_value",
        "unknown_parameter",
    ];
    complaint.mentions_any(&UNSUPPORTED) || complaint.has_code(&codes)
}

/// Whether a text has a name as a whole word: `max_tokens` is not in `max_tokens_total`.
fn mentions(text: &str, name: &str) -> bool {
    let is_name = |c: char| c.is_alphanumeric() || c == '_';
    text.split(|c: char| !is_name(c)).any(|word| word == name)
}
