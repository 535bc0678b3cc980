//! Request bodies and reply parsing for each API ([`Wire`]).
//!
//! Retries, rate limits and the removal of keys ([`Endpoint`](super::Endpoint), [`Remote`](super::Remote)) do not
//! depend on the API.

mod chat;
mod finish_reason;
mod logprobs;
mod message_fields;
mod responses;
mod stream;
mod usage;

use reqwest::header::{AUTHORIZATION, HeaderMap, HeaderName, HeaderValue};

use super::bounded_json::parse;
use super::failures::{ApiError, ReplyError};
use super::requests::{Message, Parameters, RequestBody, RequestField, RequestFields, SentFields};
use super::secrets::{KeyHeader, Secret};
use super::wire_kind::Wire;
use darkqa_base::error::{Error, Result};
use darkqa_base::types::{Reply, Usage};

pub(super) use finish_reason::requested_wire;
pub(super) use usage::{cost_in_headers, with_cost};

pub use finish_reason::is_context_full;

impl Wire {
    /// Headers of every request: the key in the header `form`.
    pub(super) fn headers(self, key: Option<&Secret>, form: KeyHeader) -> Result<HeaderMap> {
        match self {
            Self::Chat | Self::ChatStream | Self::Responses => {
                key.map_or_else(|| Ok(HeaderMap::new()), |key| key_header(key, form))
            }
        }
    }

    /// Writes the body of a request with this number of choices; 0 for an open question.
    pub(super) fn body(
        self,
        parameters: &Parameters,
        fields: RequestFields,
        message: Message<'_>,
        choices: usize,
    ) -> Result<RequestBody, serde_json::Error> {
        let fields = RequestFields { wire: self, ..fields };
        match self {
            Self::Chat | Self::ChatStream => chat::body(parameters, fields, message, choices),
            Self::Responses => responses::body(parameters, fields, message, choices),
        }
    }

    /// Fields of a request that a server may refuse.
    pub(super) fn fields(self, sent: SentFields<'_>) -> Vec<RequestField<'_>> {
        let extra = &sent.parameters.extra;
        let mut fields: Vec<RequestField<'_>> = match self {
            Self::Chat | Self::ChatStream => chat::fields(sent),
            Self::Responses => responses::fields(sent),
        };
        fields.extend(sent.fields.thinking_fields());
        // An omitted field cannot be the cause of a refusal.
        fields.retain(|field| !extra.omit.iter().any(|name| name == field.name));
        fields.extend(sent.user_fields());
        fields
    }

    /// Parses the body of a response with a success status; `latency_ms` and `attempts` remain zero.
    pub(super) fn reply(self, body: &[u8], content_type: &str) -> Result<Reply, ReplyError> {
        match self {
            Self::Chat | Self::ChatStream => chat::read(body, content_type),
            Self::Responses => responses::read(body, content_type),
        }
    }

    /// Parses the error in the body of a refused request.
    pub(super) fn parse_error(self, body: &[u8]) -> ApiError {
        match self {
            Self::Chat | Self::ChatStream | Self::Responses => ApiError::from_body(&String::from_utf8_lossy(body)),
        }
    }
}

/// Parses the body of a reply in a batch file. Only replies of the Responses API have an `output`.
pub(super) fn batch_reply(body: &str) -> Result<Reply, ReplyError> {
    let parsed = parse(body).ok();
    let is_response = parsed.is_some_and(|body| body.get("output").is_some());
    let wire = if is_response { Wire::Responses } else { Wire::Chat };
    wire.reply(body.as_bytes(), "application/json")
}

/// Token usage in the body of a reply or an error; `None` without one.
pub(super) fn body_usage(body: &str) -> Option<Usage> {
    let body = parse(body).ok()?;
    usage::in_body(&body)
}

/// Header with the key, in the form of OpenAI or Azure.
fn key_header(key: &Secret, form: KeyHeader) -> Result<HeaderMap> {
    let (name, text) = match form {
        KeyHeader::ApiKey => (HeaderName::from_static("api-key"), key.expose().to_owned()),
        _ => (AUTHORIZATION, format!("Bearer {}", key.expose())),
    };
    let mut value = HeaderValue::try_from(text)
        .map_err(|_| Error::usage("key", "it has characters that an HTTP header cannot carry"))?;
    value.set_sensitive(true);
    Ok(HeaderMap::from_iter([(name, value)]))
}
