//! The model behind an endpoint: [`OpenAi`].

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use tracing::warn;

use super::endpoint::Endpoint;
use super::field::Refused;
use super::parameters::{Constrain, Parameters, Temperature, TokenField};
use super::request::{self, Asked, Fields};
use super::verdict::Sent;
use super::{AskError, Message, Reach, failure};
use crate::types::{Digest, FailureKind, Reply};

/// One model of an OpenAI-compatible endpoint, asked with one set of parameters.
#[derive(Debug)]
pub struct OpenAi {
    endpoint: Arc<Endpoint>,
    parameters: Parameters,
    /// The fields that the server takes, as far as is known.
    fields: Mutex<Fields>,
    /// Whether a reply has come that no constraint was put on.
    unconstrained: AtomicBool,
}

impl OpenAi {
    /// The model that `parameters` name; models of one endpoint share its connections and its pauses.
    #[must_use]
    pub fn new(endpoint: Arc<Endpoint>, parameters: Parameters) -> Self {
        Self {
            fields: Mutex::new(Fields::first(&parameters, endpoint.host())),
            endpoint,
            parameters,
            unconstrained: AtomicBool::new(false),
        }
    }

    /// The model, by the endpoint's name.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.parameters.model
    }

    /// Where it is asked.
    #[must_use]
    pub fn endpoint(&self) -> &Endpoint {
        &self.endpoint
    }

    /// How it is asked.
    #[must_use]
    pub fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    /// How the requests differ from the first one, where the server has refused a field of it: what is left to the
    /// program (`auto`) is adapted once for all requests, and never for one alone.
    #[must_use]
    pub fn adapted(&self) -> Vec<String> {
        let (first, now) = (
            Fields::first(&self.parameters, self.endpoint.host()),
            self.fields(),
        );
        let field = (now.token_field != first.token_field)
            .then(|| format!("the token limit is sent as {}", now.token_field));
        let temperature = (now.temperature != first.temperature)
            .then(|| "no temperature is sent: the server's own holds".to_owned());
        field.into_iter().chain(temperature).collect()
    }

    pub(super) fn digest(&self) -> Digest {
        self.parameters.digest()
    }

    /// Sends the one message of a conversation, which offers so many choices (0 where the answer is open).
    pub async fn ask(&self, message: Message<'_>, choices: usize) -> Result<Reply, AskError> {
        let asked = Asked { message, choices };
        let mut attempts = 0;
        loop {
            let fields = self.fields();
            let result = self.ask_with(fields, asked).await;
            match result {
                Err(error) if self.adapt(fields, error.refused) => attempts += error.attempts,
                Err(error) => {
                    let attempts = attempts + error.attempts;
                    return Err(AskError { attempts, ..error });
                }
                Ok(reply) => {
                    let attempts = attempts + reply.attempts;
                    let text = self.unwrapped(reply.text, choices);
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
    /// Where it cannot be written as JSON.
    pub fn body(&self, message: Message<'_>, choices: usize) -> Result<Vec<u8>, serde_json::Error> {
        let asked = Asked { message, choices };
        request::body(&self.parameters, self.fields(), asked).map(|parts| parts.joined())
    }

    async fn ask_with(&self, fields: Fields, asked: Asked<'_>) -> Result<Reply, AskError> {
        let body = request::body(&self.parameters, fields, asked).map_err(|error| AskError {
            failure: failure(
                FailureKind::Request,
                format!("the request could not be written: {error}"),
            ),
            attempts: 0,
            reach: Reach::Trial,
            refused: None,
        })?;
        let sent = Sent {
            parameters: &self.parameters,
            fields,
            has_image: !asked.message.images.is_empty(),
            has_key: self.endpoint.has_key(),
        };
        self.endpoint.ask(&body, sent).await
    }

    fn fields(&self) -> Fields {
        *self.fields.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Changes the field that a request with `sent` was refused for, where that is left to the program; whether it is worth
    /// asking again.
    fn adapt(&self, sent: Fields, refused: Option<Refused>) -> bool {
        let first = Fields::first(&self.parameters, self.endpoint.host());
        let mut now = self.fields.lock().unwrap_or_else(PoisonError::into_inner);
        if *now != sent {
            // Another request has found out in the meanwhile.
            return refused.is_some();
        }
        match refused {
            Some(Refused::TokenField)
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
            Some(Refused::Temperature)
                if self.parameters.temperature == Temperature::Auto
                    && sent.temperature.is_some() =>
            {
                now.temperature = None;
                warn!(
                    "{}: it takes no temperature of 0, so the server's own holds for the whole run",
                    self.name()
                );
                true
            }
            _ => false,
        }
    }

    /// The letter in a reply that was constrained to be one; said once where the server does not keep to it.
    fn unwrapped(&self, text: String, choices: usize) -> String {
        let constrain = self.parameters.constrain;
        if constrain == Constrain::None {
            return text;
        }
        request::constrained_letter(constrain, choices, &text).unwrap_or_else(|| {
            if !self.unconstrained.swap(true, Ordering::Relaxed) {
                warn!(
                    "{}: a reply is not what --constrain {constrain} asked for; the server may not know it, or the reply was cut \
                     (--max-tokens)",
                    self.name()
                );
            }
            text
        })
    }
}
