//! The model behind an endpoint: [`OpenAi`].

use std::sync::Arc;

use super::endpoint::Endpoint;
use super::payload::Payload;
use super::request::{self, Parameters, TokenField};
use super::verdict::Sent;
use super::{AskError, Reach, failure};
use crate::types::{Digest, FailureKind, Reply};

/// One model of an OpenAI-compatible endpoint, asked with one set of parameters.
#[derive(Debug, Clone)]
pub struct OpenAi {
    endpoint: Arc<Endpoint>,
    parameters: Parameters,
    token_field: TokenField,
}

impl OpenAi {
    /// The model that `parameters` name; models of one endpoint share its connections and its pauses.
    #[must_use]
    pub fn new(endpoint: Arc<Endpoint>, parameters: Parameters) -> Self {
        Self {
            token_field: parameters.token_field.at(endpoint.host()),
            endpoint,
            parameters,
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

    pub(super) fn digest(&self) -> Digest {
        self.parameters.digest()
    }

    /// Sends a prompt, with an image or in words alone, as the one message of a conversation.
    pub async fn ask(&self, prompt: &str, image: Option<&Payload>) -> Result<Reply, AskError> {
        let body =
            request::body(&self.parameters, self.token_field, prompt, image).map_err(|error| {
                AskError {
                    failure: failure(
                        FailureKind::Request,
                        format!("the request could not be written: {error}"),
                    ),
                    attempts: 0,
                    reach: Reach::Trial,
                }
            })?;
        let sent = Sent {
            parameters: &self.parameters,
            token_field: self.token_field,
            has_image: image.is_some(),
            has_key: self.endpoint.has_key(),
        };
        self.endpoint.ask(&body, sent).await
    }
}
