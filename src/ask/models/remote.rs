//! Model at an endpoint: [`Remote`].
//!
//! Checks that the settings of a model do not contradict each other or its vendor: [`check_user_fields`],
//! [`check_vendor`].

use std::collections::BTreeSet;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use reqwest::header::HeaderMap;
use serde_json::{Map, Value};
use tracing::warn;

use super::finish_words::FinishWords;
use super::stream_fallback::{AskedBefore, StreamFallback};
use crate::costs::Reservation;
use crate::endpoints::{Endpoint, ModelIndex};
use crate::failures::{AskError, Reach};
use crate::requests::field::constrained_letter;
use crate::requests::{
    AdaptableField, AfterTimeout, Constrain, Message, Parameters, Request, RequestFields, SentFields, Thinking,
    ThinkingBudget, TokenField,
};
use crate::vendors::Vendor;
use crate::wire_kind::Wire;
use darkqa_base::error::{Error, Result};
use darkqa_base::types::questions::letter;
use darkqa_base::types::{FailureKind, Finish, LostAttempts, Reply};

/// A model of an endpoint with one set of parameters.
#[derive(Debug)]
pub struct Remote {
    endpoint: Arc<Endpoint>,
    /// Index of the model at the endpoint.
    index: ModelIndex,
    /// Headers for each replica of the endpoint.
    headers: Vec<HeaderMap>,
    parameters: Parameters,
    /// Fields of the first request.
    initial: RequestFields,
    /// Fields of the next request: adapted to all refusals so far.
    fields: Mutex<RequestFields>,
    /// Flags of the settings that the server refused.
    forced: Mutex<BTreeSet<&'static str>>,
    /// Outcome of the first question. The other questions wait for it, so that a refusal that concerns all requests
    /// costs a single one.
    first_question: tokio::sync::Mutex<FirstReply>,
    streams: StreamFallback,
    /// True after the first reply.
    has_answered: AtomicBool,
    finish_words: FinishWords,
    /// True after the warning about a reply that does not follow the constraint.
    warned_unconstrained: AtomicBool,
    /// True after the warning about a reply without content.
    warned_other_field: AtomicBool,
}

/// Number of refusals by a status that concerns all questions after which the model is not asked any further, if it has
/// answered none. Chosen: they cost nothing, and the first image alone may be the cause of one.
const REFUSALS_AT_START: usize = 3;

/// Outcome of the first question to a model.
#[derive(Debug)]
enum FirstReply {
    /// No question has ended yet, except this number that were refused by the status alone.
    Pending(usize),
    /// The question has a reply, or a failure that does not concern other questions.
    Ended,
    /// The question failed in a way in which every other question would fail too.
    Refused(AskError),
}

impl Remote {
    /// Prepares a model of an endpoint. All models of one endpoint share its connections and its rate limits.
    ///
    /// # Errors
    /// If a header value has characters that HTTP does not allow, if the server has no known switch for `--thinking`,
    /// or if fields of the user contradict `--request constrain` or `--thinking`.
    pub fn open(endpoint: Arc<Endpoint>, parameters: Parameters) -> Result<Self> {
        let initial = RequestFields::initial(&parameters, endpoint.base(), endpoint.vendor())?;
        check_user_fields(&parameters, initial)?;
        if let Some(vendor) = endpoint.vendor() {
            check_vendor(vendor, &parameters)?;
        }
        Ok(Self {
            headers: endpoint.headers(parameters.wire.initial())?,
            fields: Mutex::new(initial),
            initial,
            forced: Mutex::default(),
            index: endpoint.add_model(&parameters.model),
            endpoint,
            parameters,
            first_question: tokio::sync::Mutex::new(FirstReply::Pending(0)),
            has_answered: AtomicBool::new(false),
            finish_words: FinishWords::default(),
            streams: StreamFallback::default(),
            warned_unconstrained: AtomicBool::new(false),
            warned_other_field: AtomicBool::new(false),
        })
    }

    /// Name of the model at the endpoint.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.parameters.model
    }

    /// Endpoint of the model.
    #[must_use]
    pub fn endpoint(&self) -> &Endpoint {
        &self.endpoint
    }

    /// Maximum number of requests in flight at the endpoint at the moment, within
    /// [`Sending::concurrency`](crate::Sending).
    #[must_use]
    pub fn width(&self) -> usize {
        self.endpoint.width(self.index)
    }

    /// Parameters of every request.
    #[must_use]
    pub fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    /// Maximum number of charged tokens of a reply, including hidden reasoning; `None` if not all of them are limited.
    /// The server may exceed it.
    pub(super) fn reply_limit(&self) -> Option<u64> {
        let parameters = &self.parameters;
        let is_omitted = self.fields().token_field == TokenField::Omit;
        if is_omitted || parameters.extra.omits_token_limit() {
            return None;
        }
        let limit = u64::from(parameters.max_tokens.get());
        let thinks_beyond_limit = self.endpoint.vendor().is_some_and(|vendor| vendor.thinks_beyond_limit);
        match parameters.extra.thinking_budget() {
            Some(ThinkingBudget::Unlimited) => None,
            _ if !thinks_beyond_limit || parameters.thinking == Some(Thinking::Off) => Some(limit),
            Some(ThinkingBudget::Tokens(tokens)) => Some(limit.saturating_add(tokens)),
            None => None,
        }
    }

    /// Changes to requests after the server refused a field. Only settings with the value `auto` are adapted, for all
    /// further requests.
    #[must_use]
    pub fn adapted(&self) -> Vec<String> {
        let mut changes = self.fields().changes(self.initial);
        changes.extend(self.streams.change());
        changes
    }

    /// Flags of the settings that the server refused: they may change within the run.
    #[must_use]
    pub fn forced(&self) -> Vec<&'static str> {
        let forced = self.forced.lock().unwrap_or_else(PoisonError::into_inner);
        forced.iter().copied().collect()
    }

    /// API and all parameters that can change a reply.
    pub(super) fn content(&self) -> Value {
        self.parameters.content()
    }

    /// Path of the API in the lines of a batch file.
    pub(super) fn batch_url(&self) -> &'static str {
        self.fields().wire.batch_url()
    }

    /// Asks a question with this number of choices; 0 for an open question.
    pub async fn ask(&self, message: Message<'_>, choices: usize) -> Result<Reply, AskError> {
        self.ask_within(message, choices, None, false).await
    }

    /// Like [`Self::ask`]; the reservation covers the cost of each request. A question that timed out at a gateway in
    /// an earlier call (`has_timed_out`) is given up at the next timeout.
    pub(super) async fn ask_within(
        &self,
        message: Message<'_>,
        choices: usize,
        reservation: Option<&Reservation>,
        has_timed_out: bool,
    ) -> Result<Reply, AskError> {
        let before =
            if has_timed_out { AskedBefore::timed_out(self.endpoint.paid_retries()) } else { AskedBefore::default() };
        let mut first_question = self.first_question.lock().await;
        let refused = match &*first_question {
            FirstReply::Pending(refused) => *refused,
            FirstReply::Ended => {
                drop(first_question);
                return self
                    .ask_settled(message, choices, reservation, before)
                    .await
                    .map_err(|error| self.resolve_reach(error, Reach::Trial, 0));
            }
            FirstReply::Refused(error) => {
                return Err(AskError { attempts: 0, lost: Box::default(), ..error.clone() });
            }
        };
        let outcome = self
            .ask_settled(message, choices, reservation, before)
            .await
            .map_err(|error| self.resolve_reach(error, Reach::Endpoint, refused));
        *first_question = match &outcome {
            Err(error) if error.reach == Reach::Endpoint => FirstReply::Refused(error.clone()),
            Err(error) if error.reach == Reach::ByStatus => FirstReply::Pending(refused + 1),
            Err(error) if error.reach == Reach::Interrupted => FirstReply::Pending(refused),
            _ => FirstReply::Ended,
        };
        outcome
    }

    /// Decides which requests a failure affects. Before the first reply, [`Reach::Alike`] becomes `alike`; and
    /// [`Reach::ByStatus`] is every request, if `refused` earlier questions make it [`REFUSALS_AT_START`]. After the
    /// first reply, such a status may concern one question.
    fn resolve_reach(&self, error: AskError, alike: Reach, refused: usize) -> AskError {
        let reach = match error.reach {
            Reach::Alike => alike,
            Reach::ByStatus if !self.has_answered.load(Ordering::Relaxed) && refused + 1 >= REFUSALS_AT_START => {
                Reach::Endpoint
            }
            reach => reach,
        };
        AskError { reach, ..error }
    }

    /// Asks a question, and once more if the reply may end in another way.
    async fn ask_settled(
        &self,
        message: Message<'_>,
        choices: usize,
        reservation: Option<&Reservation>,
        before: AskedBefore,
    ) -> Result<Reply, AskError> {
        let first = self.ask_adapting(message, choices, reservation, before).await?;
        self.has_answered.store(true, Ordering::Relaxed);
        if !first.may_heal {
            return Ok(first);
        }
        let mut lost = first.lost;
        lost.add(first.usage);
        let may_pay = lost.attempts <= self.endpoint.paid_retries();
        let before = before.with_charged(lost.attempts);
        self.finish_words
            .settle(first, may_pay, || async {
                self.endpoint.wait_to_ask_again().await;
                self.ask_adapting(message, choices, reservation, before).await
            })
            .await
    }

    /// Asks a question, and again after each adaptation of a refused field, or as a stream after a gateway timeout.
    async fn ask_adapting(
        &self,
        message: Message<'_>,
        choices: usize,
        reservation: Option<&Reservation>,
        mut before: AskedBefore,
    ) -> Result<Reply, AskError> {
        let (mut attempts, mut lost) = (0, LostAttempts::default());
        let paid_retries = self.endpoint.paid_retries();
        loop {
            let fields = self.fields();
            let wire = self.streams.wire(&self.parameters, fields.wire, before);
            let timeouts = self.streams.after_timeout(&self.parameters, wire, before, paid_retries);
            let sent = RequestFields { wire, ..fields };
            let outcome = self.ask_with(sent, timeouts, message, choices, reservation).await;
            if let Err(error) = &outcome {
                let mut forced = self.forced.lock().unwrap_or_else(PoisonError::into_inner);
                forced.extend(error.forced);
            }
            match outcome {
                Err(error) => {
                    attempts += error.attempts;
                    lost = lost.plus(*error.lost);
                    if self.adapt(fields, error.refused_field) {
                        continue;
                    }
                    let wires = (wire, fields.wire);
                    let next = self.streams.next(self.name(), &error, wires, before, timeouts);
                    match next {
                        Some(next) => before = next,
                        None => return Err(error.with_attempts(attempts, lost)),
                    }
                }
                Ok(reply) => {
                    if wire != fields.wire {
                        self.streams.record_reply();
                        if before.is_too_long() {
                            self.keep_streams(fields);
                        }
                    }
                    let reply = self.with_other_field(reply, choices);
                    return Ok(Reply {
                        text: self.letter_or_text(reply.text, choices),
                        attempts: attempts + reply.attempts,
                        lost: lost.plus(reply.lost),
                        ..reply
                    });
                }
            }
        }
    }

    /// Body of a request as it would be sent now.
    ///
    /// # Errors
    /// If it cannot be written as JSON.
    pub fn body(&self, message: Message<'_>, choices: usize) -> Result<Vec<u8>, serde_json::Error> {
        let fields = self.fields();
        let body = fields.wire.body(&self.parameters, fields, message, choices)?;
        Ok(body.concat())
    }

    /// Body of a request in a batch.
    ///
    /// # Errors
    /// If it cannot be written as JSON.
    pub(super) fn batch_body(&self, message: Message<'_>, choices: usize) -> Result<Vec<u8>, serde_json::Error> {
        let fields = self.fields();
        let wire = fields.wire.in_batch();
        let body = wire.body(&self.parameters, fields, message, choices)?;
        Ok(body.concat())
    }

    /// Asks a question with these fields.
    async fn ask_with(
        &self,
        fields: RequestFields,
        timeouts: AfterTimeout,
        message: Message<'_>,
        choices: usize,
        reservation: Option<&Reservation>,
    ) -> Result<Reply, AskError> {
        let parameters = &self.parameters;
        let body = fields.wire.body(parameters, fields, message, choices).map_err(|error| {
            let message = format!("the request could not be written: {error}");
            AskError { attempts: 0, ..AskError::new(FailureKind::Request, message) }
        })?;
        let request = Request {
            model: self.index,
            wire: fields.wire,
            headers: &self.headers,
            body,
            sent: SentFields {
                parameters,
                fields,
                has_image: !message.images.is_empty(),
                has_key: self.endpoint.has_key(),
            },
            affinity: image_hash(message),
            timeouts,
            reservation,
        };
        self.endpoint.ask(&request).await
    }

    /// Asks for streams from now on, unless the fields have changed in the meantime.
    fn keep_streams(&self, before: RequestFields) {
        let mut current = self.fields.lock().unwrap_or_else(PoisonError::into_inner);
        if *current == before {
            warn!(
                "{}: its replies are streamed for the rest of the run, because a gateway does not wait for a long one in one piece",
                self.name()
            );
            current.wire = Wire::ChatStream;
        }
    }

    fn fields(&self) -> RequestFields {
        *self.fields.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Changes the field for which a request with the fields `sent` was refused, if its setting is `auto`. Returns true
    /// to ask again.
    fn adapt(&self, sent: RequestFields, refused_field: Option<AdaptableField>) -> bool {
        let Some(field) = refused_field else {
            return false;
        };
        let mut current = self.fields.lock().unwrap_or_else(PoisonError::into_inner);
        if *current != sent {
            // Another request has changed the fields in the meantime.
            return true;
        }
        let Some(adapted) = sent.after_refusal(field, self.initial, &self.parameters) else {
            return false;
        };
        for change in adapted.changes(sent) {
            warn!("{}: {change} for the whole run, because the server refuses what was sent before", self.name());
        }
        *current = adapted;
        true
    }

    /// Adapts further requests after the refusal of a line of a batch. Returns true if the request may succeed now.
    pub(super) fn adapt_to_refusal(&self, status: u16, body: &[u8]) -> bool {
        let fields = self.fields();
        if self.adapt(fields, self.refused_in_batch(status, body, fields)) {
            return true;
        }
        // The batch may have been created before the fields were changed.
        self.refused_in_batch(status, body, self.initial).is_some_and(|field| fields.differs(field, self.initial))
    }

    /// Field for which a line of a batch with these fields was refused, if the program can send it in another way.
    fn refused_in_batch(&self, status: u16, body: &[u8], fields: RequestFields) -> Option<AdaptableField> {
        self.refusal_in_batch(status, body, fields).refused_field
    }

    /// True if a line of a batch may have been refused for its content alone.
    pub(super) fn may_refuse_content(&self, status: u16, body: &[u8]) -> bool {
        let failed = self.refusal_in_batch(status, body, self.fields());
        failed.reach == Reach::Trial && failed.may_be_content(status)
    }

    /// The refusal of a line of a batch with these fields.
    fn refusal_in_batch(&self, status: u16, body: &[u8], fields: RequestFields) -> AskError {
        let sent =
            SentFields { parameters: &self.parameters, fields, has_image: true, has_key: self.endpoint.has_key() };
        let wire = fields.wire.in_batch();
        let api_error = wire.parse_error(body);
        AskError::refused(status, &api_error, wire, sent)
    }

    /// The reply with the text of another field, if its content is empty and the text of that field is an answer. Warns
    /// about the first reply whose content is empty.
    fn with_other_field(&self, mut reply: Reply, choices: usize) -> Reply {
        let Some(field) = reply.other_field.take() else {
            return reply;
        };
        if reply.text.trim().is_empty() && !self.parameters.asks_to_think() {
            let constrain = self.parameters.constrain;
            let answer = constrained_letter(constrain, choices, &field.text);
            let text = answer.as_deref().unwrap_or(&field.text);
            if is_bare_answer(text, choices) {
                text.clone_into(&mut reply.text);
                // Not an end with thoughts alone.
                reply.may_heal &= !matches!(reply.finish, Finish::Stop | Finish::Unknown);
            }
        }
        let is_read = !reply.text.trim().is_empty();
        let is_cut = reply.finish == Finish::Length;
        if (is_read || !is_cut) && !self.warned_other_field.swap(true, Ordering::Relaxed) {
            let (name, field) = (self.name(), &field.name);
            if is_read {
                warn!(
                    "{name}: answers come in the field {field:?}, with an empty content, and are read there; the server may take them for \
                     thoughts (start it without a reasoning parser) or for tool calls"
                );
            } else {
                warn!(
                    "{name}: a reply has an empty content, and its text is in the field {field:?}, which is not read as an answer: either \
                     the model ended with its thoughts, or the server's reasoning parser takes the answer for thoughts, as it does if \
                     thinking is off; then start the server without its reasoning parser, or ask with thinking on"
                );
            }
        }
        reply
    }

    /// Letter in a constrained reply, otherwise the whole text. Warns once if the server does not follow the
    /// constraint.
    fn letter_or_text(&self, text: String, choices: usize) -> String {
        let constrain = self.parameters.constrain;
        if constrain == Constrain::None {
            return text;
        }
        constrained_letter(constrain, choices, &text).unwrap_or_else(|| {
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

/// True for a text that is an answer and nothing else, so that it cannot be thoughts: the letter of a choice, or a
/// number if there are no choices.
fn is_bare_answer(text: &str, choices: usize) -> bool {
    let text = text.trim();
    let bare = text.strip_prefix('(').unwrap_or(text);
    let bare = bare.trim_end_matches([')', '.', ':']);
    if choices == 0 {
        return !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    }
    (0..choices).any(|index| bare.eq_ignore_ascii_case(&letter(index).to_string()))
}

/// Hash of the images of a message, in any order.
fn image_hash(message: Message<'_>) -> u64 {
    message.images.iter().map(|image| image.facts().digest).fold(0, |sum, digest| {
        let mut first = [0; 8];
        first.copy_from_slice(&digest.as_bytes()[..8]);
        sum ^ u64::from_le_bytes(first)
    })
}

/// Checks that the fields of `--extra-body` do not set the same as a flag.
fn check_user_fields(parameters: &Parameters, initial: RequestFields) -> Result<()> {
    let extra = &parameters.extra;
    if parameters.constrain != Constrain::None
        && let Some(field) =
            ["response_format", "structured_outputs", "text"].into_iter().find(|field| extra.adds(field))
    {
        return conflict(field, "--request constrain");
    }
    if let Some(field) = initial.thinking_body().into_iter().flat_map(Map::keys).find(|field| extra.adds(field)) {
        return conflict(field, "--thinking");
    }
    // The field of the Responses API, which OpenRouter also accepts in chat completions.
    if initial.effort(parameters).is_some() && extra.adds_below("reasoning", "effort") {
        let flag = match parameters.reasoning_effort {
            Some(_) => "--reasoning-effort",
            None => "--thinking",
        };
        return conflict("reasoning.effort", flag);
    }
    if parameters.probabilities && extra.adds("include") {
        return conflict("include", "--request probabilities");
    }
    Ok(())
}

fn conflict(field: &str, flag: &str) -> Result<()> {
    let problem = format_args!("{field} is set by {flag}; leave one of them out");
    Err(Error::usage("--extra-body", problem))
}

/// Checks that the vendor supports a requested constraint and requested probabilities. Warns if requests to it are not
/// repeatable.
fn check_vendor(vendor: &Vendor, parameters: &Parameters) -> Result<()> {
    if vendor.ignores_constraints() && parameters.constrain != Constrain::None {
        let problem =
            format_args!("{} takes a constraint and ignores it, so it would be none; leave it out", vendor.name);
        return Err(Error::usage("--request constrain", problem));
    }
    if parameters.probabilities
        && let Some(reason) = vendor.without_probabilities()
    {
        let problem = format_args!(
            "{} {reason}, so the confidence of {} would not be known; leave it out",
            vendor.name, parameters.model
        );
        return Err(Error::usage("--request probabilities", problem));
    }
    if let Some(field) = &vendor.pin
        && !parameters.extra.adds(field)
    {
        warn!(
            "{}: {} may answer each request in another way unless {field} is set in the body (--extra-body): the run may not be \
             repeatable",
            parameters.model, vendor.name
        );
    }
    Ok(())
}
