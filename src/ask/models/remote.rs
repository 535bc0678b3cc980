//! A model at an endpoint: [`Remote`].

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use reqwest::header::HeaderMap;
use serde_json::{Map, Value};
use tracing::warn;

use crate::ask::costs::Reservation;
use crate::ask::endpoints::{Endpoint, ModelIndex};
use crate::ask::failures::{AskError, Reach};
use crate::ask::requests::constraint::letter_of;
use crate::ask::requests::{
    AdaptableField, Constrain, Message, Parameters, Request, RequestFields, SentFields, Thinking,
    ThinkingBudget, TokenField,
};
use crate::ask::vendors::Vendor;
use crate::error::{Error, Result};
use crate::types::{FailureKind, LostAttempts, Reply};

/// One model of an endpoint, asked with one set of parameters.
#[derive(Debug)]
pub struct Remote {
    endpoint: Arc<Endpoint>,
    /// The model at the endpoint.
    number: ModelIndex,
    /// Headers for each replica of the endpoint.
    headers: Vec<HeaderMap>,
    parameters: Parameters,
    /// The fields of the first request.
    first: RequestFields,
    /// The fields that the server accepts, as far as is known.
    fields: Mutex<RequestFields>,
    /// The outcome of the first question to the model. Until it has come to an end, the others wait: what the server refuses in all
    /// requests is then found out by one.
    scout: tokio::sync::Mutex<Scout>,
    /// Whether the warning about an unconstrained reply was printed.
    warned_unconstrained: AtomicBool,
}

/// The outcome of the first question to a model.
#[derive(Debug)]
enum Scout {
    /// None has come to an end.
    Waiting,
    /// It has a reply, or a failure that is its own.
    Ended,
    /// It has a failure that every other question would have, too.
    Refused(AskError),
}

impl Remote {
    /// The model that `parameters` name; models of one endpoint share its connections and its pauses.
    ///
    /// # Errors
    /// If a header value has characters that HTTP does not allow, if `--thinking` cannot be said to the server, or if the user's own
    /// fields contradict `--request constrain` or `--thinking`.
    pub fn open(endpoint: Arc<Endpoint>, parameters: Parameters) -> Result<Self> {
        let first = RequestFields::first(&parameters, endpoint.base(), endpoint.vendor())?;
        check_own_fields(&parameters, first)?;
        if let Some(vendor) = endpoint.vendor() {
            check_vendor(vendor, &parameters)?;
        }
        Ok(Self {
            headers: endpoint.headers(parameters.wire.first())?,
            fields: Mutex::new(first),
            first,
            number: endpoint.add_model(&parameters.model),
            endpoint,
            parameters,
            scout: tokio::sync::Mutex::new(Scout::Waiting),
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

    /// The number of requests that may be in flight now at the endpoint, within [`Sending::concurrency`](crate::ask::Sending).
    #[must_use]
    pub fn width(&self) -> usize {
        self.endpoint.width(self.number)
    }

    /// The parameters of every request.
    #[must_use]
    pub fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    /// The most tokens that a reply is charged, hidden reasoning included, if the server keeps to its limits; `None` if no limit holds
    /// for all of them.
    pub(super) fn reply_limit(&self) -> Option<u64> {
        let parameters = &self.parameters;
        let field = self.fields().token_field;
        let is_sent = field != TokenField::Omit && !parameters.extra.omits_token_limit();
        let limit = u64::from(parameters.max_tokens.get());
        let budget = parameters.extra.thinking_budget();
        let is_apart = self
            .endpoint
            .vendor()
            .is_some_and(|vendor| vendor.thinks_beyond_limit);
        match budget {
            _ if !is_sent => None,
            Some(ThinkingBudget::Unlimited) => None,
            _ if !is_apart || parameters.thinking == Some(Thinking::Off) => Some(limit),
            Some(ThinkingBudget::Tokens(tokens)) => Some(limit.saturating_add(tokens)),
            None => None,
        }
    }

    /// The changes to requests after the server refused a field: settings that are left to the program (`auto`) are adapted
    /// once for all requests, and never for a single one.
    #[must_use]
    pub fn adapted(&self) -> Vec<String> {
        self.fields().changes(self.first)
    }

    /// The API and all parameters that can change a reply.
    pub(super) fn content(&self) -> Value {
        self.parameters.content()
    }

    /// The path in a line of a Batch API's file.
    pub(super) fn batch_url(&self) -> &'static str {
        self.fields().wire.batch_url()
    }

    /// Sends the single message of a conversation with this number of choices; 0 if the question is open.
    pub async fn ask(&self, message: Message<'_>, choices: usize) -> Result<Reply, AskError> {
        self.ask_within(message, choices, None).await
    }

    /// As [`Self::ask`]; each request holds the reservation while it is in flight.
    pub(super) async fn ask_within(
        &self,
        message: Message<'_>,
        choices: usize,
        reservation: Option<&Reservation>,
    ) -> Result<Reply, AskError> {
        let mut scout = self.scout.lock().await;
        match &*scout {
            Scout::Waiting => {}
            Scout::Ended => {
                drop(scout);
                let outcome = self.ask_adapting(message, choices, reservation).await;
                return outcome.map_err(|error| reaching(error, Reach::Trial));
            }
            Scout::Refused(error) => {
                return Err(AskError {
                    attempts: 0,
                    lost: Box::default(),
                    ..error.clone()
                });
            }
        }
        let outcome = self.ask_adapting(message, choices, reservation).await;
        let outcome = outcome.map_err(|error| reaching(error, Reach::Endpoint));
        *scout = match &outcome {
            Err(error) if error.reach == Reach::Endpoint => Scout::Refused(error.clone()),
            Err(error) if error.reach == Reach::Interrupted => Scout::Waiting,
            _ => Scout::Ended,
        };
        outcome
    }

    /// Asks, and again after each field that is adapted.
    async fn ask_adapting(
        &self,
        message: Message<'_>,
        choices: usize,
        reservation: Option<&Reservation>,
    ) -> Result<Reply, AskError> {
        let (mut attempts, mut lost) = (0, LostAttempts::default());
        loop {
            let fields = self.fields();
            match self.ask_with(fields, message, choices, reservation).await {
                Err(error) if self.adapt(fields, error.refused_field) => {
                    attempts += error.attempts;
                    lost = lost.plus(*error.lost);
                }
                Err(error) => {
                    return Err(AskError {
                        attempts: attempts + error.attempts,
                        lost: Box::new(lost.plus(*error.lost)),
                        ..error
                    });
                }
                Ok(reply) => {
                    let text = self.letter_or_text(reply.text, choices);
                    return Ok(Reply {
                        text,
                        attempts: attempts + reply.attempts,
                        lost: lost.plus(reply.lost),
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
        let fields = self.fields();
        let body = fields
            .wire
            .body(&self.parameters, fields, message, choices)?;
        Ok(body.joined())
    }

    /// The body of a request in a batch, in one piece.
    ///
    /// # Errors
    /// If it cannot be written as JSON.
    pub(super) fn batch_body(
        &self,
        message: Message<'_>,
        choices: usize,
    ) -> Result<Vec<u8>, serde_json::Error> {
        let fields = self.fields();
        let wire = fields.wire.in_batch();
        let body = wire.body(&self.parameters, fields, message, choices)?;
        Ok(body.joined())
    }

    async fn ask_with(
        &self,
        fields: RequestFields,
        message: Message<'_>,
        choices: usize,
        reservation: Option<&Reservation>,
    ) -> Result<Reply, AskError> {
        let parameters = &self.parameters;
        let body = fields.wire.body(parameters, fields, message, choices);
        let body = body.map_err(|error| {
            let message = format!("the request could not be written: {error}");
            AskError {
                attempts: 0,
                ..AskError::new(FailureKind::Request, message)
            }
        })?;
        let request = Request {
            model: self.number,
            wire: fields.wire,
            headers: &self.headers,
            body,
            sent: SentFields {
                parameters,
                fields,
                has_image: !message.images.is_empty(),
                has_key: self.endpoint.has_key(),
            },
            affinity: affinity(message),
            reservation,
        };
        self.endpoint.ask(&request).await
    }

    fn fields(&self) -> RequestFields {
        *self.fields.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Changes the field for which a request with the fields `sent` was refused, if its setting is `auto`. Returns whether to
    /// ask again.
    fn adapt(&self, sent: RequestFields, refused_field: Option<AdaptableField>) -> bool {
        let mut now = self.fields.lock().unwrap_or_else(PoisonError::into_inner);
        if *now != sent {
            // Another request has changed the fields in the meantime.
            return refused_field.is_some();
        }
        let adapted =
            refused_field.and_then(|field| sent.after_refusal(field, self.first, &self.parameters));
        let Some(adapted) = adapted else {
            return false;
        };
        for change in adapted.changes(sent) {
            warn!(
                "{}: {change} for the whole run, because the server refuses what was sent before",
                self.name()
            );
        }
        *now = adapted;
        true
    }

    /// Adapts further requests to a refused line of a batch; whether the request may succeed now.
    pub(super) fn adapt_to_refusal(&self, status: u16, body: &[u8]) -> bool {
        let fields = self.fields();
        if self.adapt(fields, self.refused_in_batch(status, body, fields)) {
            return true;
        }
        // The batch may have been made before another one changed the fields.
        let refused_field = self.refused_in_batch(status, body, self.first);
        refused_field.is_some_and(|field| fields.differs(field, self.first))
    }

    /// The field for which a line of a batch with these fields was refused, if the program can send it in another way.
    fn refused_in_batch(
        &self,
        status: u16,
        body: &[u8],
        fields: RequestFields,
    ) -> Option<AdaptableField> {
        let sent = SentFields {
            parameters: &self.parameters,
            fields,
            has_image: true,
            has_key: self.endpoint.has_key(),
        };
        let wire = fields.wire.in_batch();
        let api_error = wire.parse_error(body);
        AskError::refused(status, &api_error, wire, sent).refused_field
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
                    "{}: a reply does not have the form that --request constrain={constrain} requests; the server may not support it, or the \
                     reply was truncated (--max-tokens)",
                    self.name()
                );
            }
            text
        })
    }
}

/// The error, with this reach if requests like it fail alike.
fn reaching(error: AskError, reach: Reach) -> AskError {
    match error.reach {
        Reach::Alike => AskError { reach, ..error },
        _ => error,
    }
}

/// Refuses fields of the user's own that say the same as a flag.
fn check_own_fields(parameters: &Parameters, first: RequestFields) -> Result<()> {
    let own = &parameters.extra;
    let refused = |field: &str, flag: &str| {
        let problem = format_args!("{field} is set by {flag}; leave one of them out");
        Err(Error::usage("--extra-body", problem))
    };
    let mut formats = ["response_format", "structured_outputs", "text"].into_iter();
    if parameters.constrain != Constrain::None
        && let Some(field) = formats.find(|field| own.adds(field))
    {
        return refused(field, "--request constrain");
    }
    let mut switch = first.switch().into_iter().flat_map(Map::keys);
    if let Some(field) = switch.find(|field| own.adds(field)) {
        return refused(field, "--thinking");
    }
    // The Responses API has it there, and OpenRouter takes it there.
    if first.effort(parameters).is_some() && own.adds_below("reasoning", "effort") {
        let flag = match parameters.reasoning_effort {
            Some(_) => "--reasoning-effort",
            None => "--thinking",
        };
        return refused("reasoning.effort", flag);
    }
    if parameters.probabilities && own.adds("include") {
        return refused("include", "--request probabilities");
    }
    Ok(())
}

/// Refuses a constraint and a request for probabilities that the vendor does not keep, and warns if requests to it are not repeatable.
fn check_vendor(vendor: &Vendor, parameters: &Parameters) -> Result<()> {
    if vendor.ignores_constraints() && parameters.constrain != Constrain::None {
        let problem = format_args!(
            "{} takes a constraint and ignores it, so it would be none; leave it out",
            vendor.name
        );
        return Err(Error::usage("--request constrain", problem));
    }
    if let Some(instead) = vendor
        .without_probabilities()
        .filter(|_| parameters.probabilities)
    {
        let problem = format_args!(
            "{} {instead}, so the confidence of {} would not be known; leave it out",
            vendor.name, parameters.model
        );
        return Err(Error::usage("--request probabilities", problem));
    }
    if let Some(field) = vendor
        .pin
        .as_deref()
        .filter(|field| !parameters.extra.adds(field))
    {
        warn!(
            "{}: {} may answer each request in another way unless {field} is set in the body (--extra-body): the run may not be \
             repeatable",
            parameters.model, vendor.name
        );
    }
    Ok(())
}

/// A number that is the same for all questions about the same images.
fn affinity(message: Message<'_>) -> u64 {
    message
        .images
        .iter()
        .map(|image| image.facts().digest)
        .fold(0, |sum, digest| {
            let mut first = [0; 8];
            first.copy_from_slice(&digest.as_bytes()[..8]);
            sum ^ u64::from_le_bytes(first)
        })
}
