//! The APIs through which models are asked: [`Wire`].
//!
//! A wire defines the bytes of requests and replies. Waits, retries, rates and the removal of keys from messages
//! ([`Endpoint`](super::Endpoint), [`Remote`](super::Remote)) do not depend on it.

mod chat_reply;
mod chat_request;
mod stream;

use reqwest::header::{AUTHORIZATION, HeaderMap, HeaderName, HeaderValue};
use serde::Serialize;

use super::body::Parts;
use super::call::Message;
use super::complaint::{Complaint, UnreadableReply};
use super::field::{RequestField, RequestFields, SentFields};
use super::key_header::KeyHeader;
use super::parameters::Parameters;
use super::secret::Secret;
use crate::error::{Error, Result};
use crate::types::Reply;

/// An API through which a model is asked.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Wire {
    /// OpenAI's chat completions, which most servers support.
    #[default]
    Chat,
}

impl Wire {
    pub(super) const ALL: [Self; 1] = [Self::Chat];

    /// The path of requests, below the base URL.
    pub(super) fn path(self) -> &'static str {
        match self {
            Self::Chat => "chat/completions",
        }
    }

    /// The path in a line of a Batch API's file; `None` if the API has no batches of OpenAI's form.
    #[expect(clippy::unnecessary_wraps, reason = "other APIs have no such batches")]
    pub(super) fn batch_url(self) -> Option<&'static str> {
        match self {
            Self::Chat => Some("/v1/chat/completions"),
        }
    }

    /// The headers of every request: the key, in the header that `form` names.
    pub(super) fn headers(self, key: Option<&Secret>, form: KeyHeader) -> Result<HeaderMap> {
        match self {
            Self::Chat => key.map_or_else(|| Ok(HeaderMap::new()), |key| key_header(key, form)),
        }
    }

    /// The body of one request with this number of choices; 0 if the question is open.
    pub(super) fn body(
        self,
        parameters: &Parameters,
        fields: RequestFields,
        message: Message<'_>,
        choices: usize,
    ) -> Result<Parts, serde_json::Error> {
        match self {
            Self::Chat => chat_request::body(parameters, fields, message, choices),
        }
    }

    /// The fields of a request that a server may refuse.
    pub(super) fn fields(self, sent: SentFields<'_>) -> Vec<RequestField<'_>> {
        match self {
            Self::Chat => chat_request::fields(sent),
        }
    }

    /// Reads the body of a reply with a status of success; `latency_ms` and `attempts` stay zero.
    pub(super) fn reply(self, body: &[u8], content_type: &str) -> Result<Reply, UnreadableReply> {
        match self {
            Self::Chat => chat_reply::read(body, content_type),
        }
    }

    /// Reads the body of a refused request.
    pub(super) fn complaint(self, body: &[u8]) -> Complaint {
        match self {
            Self::Chat => Complaint::of_body(&String::from_utf8_lossy(body)),
        }
    }
}

/// The header with the key, as OpenAI and Azure expect it.
fn key_header(key: &Secret, form: KeyHeader) -> Result<HeaderMap> {
    let (name, text) = match form {
        KeyHeader::ApiKey => (HeaderName::from_static("api-key"), key.expose().to_owned()),
        _ => (AUTHORIZATION, format!("Bearer {}", key.expose())),
    };
    let invalid = |_| Error::usage("key", "it has characters that an HTTP header cannot carry");
    let mut value = HeaderValue::try_from(text).map_err(invalid)?;
    value.set_sensitive(true);
    Ok(HeaderMap::from_iter([(name, value)]))
}
