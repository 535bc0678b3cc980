//! A model at an endpoint: [`Remote`].

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use reqwest::header::HeaderMap;
use serde_json::{Value, json};
use tracing::warn;

use super::call::Message;
use super::constraint::letter_of;
use super::endpoint::{Endpoint, Request};
use super::failure::AskError;
use super::failure_class::FailureClass;
use super::field::{AdaptableField, RequestFields, SentFields};
use super::parameters::{Constrain, Parameters, Temperature, TokenField};
use super::wire::Wire;
use crate::error::Result;
use crate::types::{FailureKind, Reply};

/// One model of an endpoint, asked through one API with one set of parameters.
#[derive(Debug)]
pub struct Remote {
    endpoint: Arc<Endpoint>,
    wire: Wire,
    headers: HeaderMap,
    parameters: Parameters,
    /// The fields that the server accepts, as far as is known.
    fields: Mutex<RequestFields>,
    /// Whether a question to the model has come to an end. Until the first has, the others wait: what the server refuses in all requests
    /// is then found out by one.
    scouted: tokio::sync::Mutex<bool>,
    /// Whether the warning about an unconstrained reply was printed.
    warned_unconstrained: AtomicBool,
}

impl Remote {
    /// The model that `parameters` name; models of one endpoint share its connections and its pauses.
    ///
    /// # Errors
    /// If a header value has characters that HTTP does not allow.
    pub fn open(endpoint: Arc<Endpoint>, wire: Wire, parameters: Parameters) -> Result<Self> {
        Ok(Self {
            headers: endpoint.headers(wire)?,
            fields: Mutex::new(RequestFields::first(&parameters, endpoint.host())),
            endpoint,
            wire,
            parameters,
            scouted: tokio::sync::Mutex::new(false),
            warned_unconstrained: AtomicBool::new(false),
        })
    }

    /// The name of the model at the endpoint.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.parameters.model
    }

    /// The endpoint at which the model is asked.
    #[must_use]
    pub fn endpoint(&self) -> &Endpoint {
        &self.endpoint
    }

    /// The parameters of every request.
    #[must_use]
    pub fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    /// The changes to requests after the server refused a field: settings that are left to the program (`auto`) are adapted
    /// once for all requests, and never for a single one.
    #[must_use]
    pub fn adapted(&self) -> Vec<String> {
        let (first, now) = (
            RequestFields::first(&self.parameters, self.endpoint.host()),
            self.fields(),
        );
        let field = (now.token_field != first.token_field)
            .then(|| format!("the token limit is sent as {}", now.token_field));
        let temperature = (now.temperature != first.temperature)
            .then(|| "no temperature is sent: the server's own holds".to_owned());
        field.into_iter().chain(temperature).collect()
    }

    /// The API and all parameters that can change a reply.
    pub(super) fn content(&self) -> Value {
        let mut content = self.parameters.content();
        content["wire"] = json!(self.wire);
        content
    }

    /// The path in a line of a Batch API's file; `None` if the API has no batches.
    pub(super) fn batch_url(&self) -> Option<&'static str> {
        self.wire.batch_url()
    }

    /// Sends the single message of a conversation with this number of choices; 0 if the question is open.
    pub async fn ask(&self, message: Message<'_>, choices: usize) -> Result<Reply, AskError> {
        let mut scouted = self.scouted.lock().await;
        if *scouted {
            drop(scouted);
            return self.ask_adapting(message, choices).await;
        }
        let outcome = self.ask_adapting(message, choices).await;
        *scouted = true;
        outcome
    }

    /// Asks, and again after each field that is adapted.
    async fn ask_adapting(&self, message: Message<'_>, choices: usize) -> Result<Reply, AskError> {
        let mut attempts = 0;
        loop {
            let fields = self.fields();
            match self.ask_with(fields, message, choices).await {
                Err(error) if self.adapt(fields, error.refused_field) => attempts += error.attempts,
                Err(error) => {
                    let attempts = attempts + error.attempts;
                    return Err(AskError { attempts, ..error });
                }
                Ok(reply) => {
                    let attempts = attempts + reply.attempts;
                    let text = self.letter_or_text(reply.text, choices);
                    return Ok(Reply {
                        text,
                        attempts,
                        ..reply
                    });
                }
            }
        }
    }

    /// The body of a request as it would be sent now, in one piece.
    ///
    /// # Errors
    /// If it cannot be written as JSON.
    pub fn body(&self, message: Message<'_>, choices: usize) -> Result<Vec<u8>, serde_json::Error> {
        let (parameters, fields) = (&self.parameters, self.fields());
        let body = self.wire.body(parameters, fields, message, choices)?;
        Ok(body.joined())
    }

    async fn ask_with(
        &self,
        fields: RequestFields,
        message: Message<'_>,
        choices: usize,
    ) -> Result<Reply, AskError> {
        let parameters = &self.parameters;
        let body = self.wire.body(parameters, fields, message, choices);
        let body = body.map_err(|error| {
            let message = format!("the request could not be written: {error}");
            AskError::new(FailureKind::Request, message, 0)
        })?;
        let request = Request {
            wire: self.wire,
            headers: &self.headers,
            body,
            sent: SentFields {
                parameters,
                fields,
                has_image: !message.images.is_empty(),
                has_key: self.endpoint.has_key(),
            },
        };
        self.endpoint.ask(&request).await
    }

    fn fields(&self) -> RequestFields {
        *self.fields.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Changes the field for which a request with the fields `sent` was refused, if its setting is `auto`. Returns whether to
    /// ask again.
    fn adapt(&self, sent: RequestFields, refused_field: Option<AdaptableField>) -> bool {
        let first = RequestFields::first(&self.parameters, self.endpoint.host());
        let mut now = self.fields.lock().unwrap_or_else(PoisonError::into_inner);
        if *now != sent {
            // Another request has changed the fields in the meantime.
            return refused_field.is_some();
        }
        match refused_field {
            Some(AdaptableField::TokenField)
                if self.parameters.token_field == TokenField::Auto
                    && sent.token_field == first.token_field =>
            {
                now.token_field = match sent.token_field {
                    TokenField::MaxTokens => TokenField::MaxCompletionTokens,
                    _ => TokenField::MaxTokens,
                };
                warn!(
                    "{}: the token limit is sent as {} from here on, as the server asks",
                    self.name(),
                    now.token_field
                );
                true
            }
            Some(AdaptableField::Temperature)
                if self.parameters.temperature == Temperature::Auto
                    && sent.temperature.is_some() =>
            {
                now.temperature = None;
                warn!(
                    "{}: the server refuses a temperature of 0; its default is used for the whole run",
                    self.name()
                );
                true
            }
            _ => false,
        }
    }

    /// Adapts further requests to a refused line of a batch; whether the request may succeed now.
    pub(super) fn adapt_to_refusal(&self, status: u16, body: &[u8]) -> bool {
        let fields = self.fields();
        let sent = SentFields {
            parameters: &self.parameters,
            fields,
            has_image: true,
            has_key: self.endpoint.has_key(),
        };
        let complaint = self.wire.complaint(body);
        let class = FailureClass::of(status, &complaint, self.wire, sent);
        self.adapt(fields, class.refused_field)
    }

    /// The letter in a constrained reply, else the text. Warns once if the server does not follow the constraint.
    fn letter_or_text(&self, text: String, choices: usize) -> String {
        let constrain = self.parameters.constrain;
        if constrain == Constrain::None {
            return text;
        }
        letter_of(constrain, choices, &text).unwrap_or_else(|| {
            if !self.warned_unconstrained.swap(true, Ordering::Relaxed) {
                warn!(
                    "{}: a reply does not have the form that --constrain {constrain} requests; the server may not support it, or the \
                     reply was truncated (--max-tokens)",
                    self.name()
                );
            }
            text
        })
    }
}
