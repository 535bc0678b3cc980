//! The fields of a request that not all servers accept: [`RequestField`] is one of them, [`RequestFields`] are those that the
//! program adapts.

use serde_json::{Map, Value};

use super::parameters::{Parameters, Temperature};
use super::thinking::ThinkingSwitch;
use super::token_field::TokenField;
use crate::ask::endpoints::BaseUrl;
use crate::ask::failures::ApiError;
use crate::ask::vendors::Vendor;
use crate::ask::wire_kind::{Wire, WireSetting};
use crate::error::{Error, Result};

/// A field that a server may refuse and that the program can send in another way.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AdaptableField {
    /// The token limit, which has two names.
    TokenField,
    /// The temperature; some models accept only their default.
    Temperature,
    /// The wire, to the one that the server asks for.
    Wire(Wire),
    /// The request for the number of tokens in a stream.
    StreamUsage,
    /// The request for the probabilities of tokens.
    Logprobs,
    /// How many of the likeliest tokens are asked for.
    TopLogprobs,
}

/// The adaptable fields of a request, as found out once for a whole run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::ask) struct RequestFields {
    /// The API.
    pub(in crate::ask) wire: Wire,
    /// The name of the token limit, never `Auto`.
    pub(in crate::ask) token_field: TokenField,
    /// The temperature; `None` if none is sent.
    pub(in crate::ask) temperature: Option<f64>,
    /// Whether a stream is asked for the number of its tokens.
    pub(in crate::ask) stream_usage: bool,
    /// How many of the likeliest tokens are asked for; `None` if their probabilities are not.
    pub(in crate::ask) top_logprobs: Option<u8>,
    /// The switch for thinking; `None` if requests do not mention it.
    pub(in crate::ask) thinking: Option<&'static ThinkingSwitch>,
}

/// The most likeliest tokens that OpenAI's API states, and most servers after it.
const TOP_LOGPROBS: u8 = 20;

/// The most that others state, Text Generation Inference among them.
const FEWER_LOGPROBS: u8 = 5;

impl RequestFields {
    /// The fields of the first request to a server.
    ///
    /// # Errors
    /// If `--thinking` cannot be said to the server, or is said twice.
    pub(in crate::ask) fn first(
        parameters: &Parameters,
        base: &BaseUrl,
        vendor: Option<&Vendor>,
    ) -> Result<Self> {
        let thinking = parameters.thinking.map(|thinking| thinking.at(base));
        let thinking = thinking.transpose()?;
        let says_effort = thinking.is_some_and(|switch| switch.effort.is_some());
        if says_effort && parameters.reasoning_effort.is_some() {
            let problem = "this server takes it as the reasoning effort, which --reasoning-effort sets already";
            return Err(Error::usage("--thinking", problem));
        }
        Ok(Self {
            wire: parameters.wire.first(),
            token_field: Vendor::token_field_at(vendor, parameters.token_field),
            temperature: match parameters.temperature {
                Temperature::Auto => Some(0.0),
                Temperature::Server => None,
                Temperature::Of(value) => Some(value),
            },
            stream_usage: true,
            top_logprobs: parameters.probabilities.then_some(TOP_LOGPROBS),
            thinking,
        })
    }

    /// The reasoning effort: as the user set it, or as the server's switch for thinking.
    pub(in crate::ask) fn effort<'p>(&self, parameters: &'p Parameters) -> Option<&'p str> {
        let own = parameters.reasoning_effort.as_deref();
        own.or_else(|| self.thinking?.effort.as_deref())
    }

    /// The fields that tell the server whether the model thinks.
    pub(in crate::ask) fn switch(&self) -> Option<&'static Map<String, Value>> {
        self.thinking.map(|switch| &switch.body)
    }

    /// The fields of the switch for thinking, as a server may refuse them.
    pub(in crate::ask) fn switched<'a>(self) -> impl Iterator<Item = RequestField<'a>> {
        self.switch()
            .into_iter()
            .flat_map(Map::keys)
            .map(|name| RequestField {
                name,
                state: FieldState::Sent,
                hint: "leave --thinking out: the model or its server has no such switch",
                adaptable: None,
            })
    }

    /// These fields after a server refused one of them; `None` if the user set it, or if it was changed before: a token limit is sent
    /// by its other name and then not at all.
    pub(in crate::ask) fn after_refusal(
        self,
        field: AdaptableField,
        first: Self,
        parameters: &Parameters,
    ) -> Option<Self> {
        let adapted = match field {
            AdaptableField::Wire(wire) if parameters.wire == WireSetting::Auto => {
                Self { wire, ..self }
            }
            AdaptableField::TokenField if parameters.token_field == TokenField::Auto => {
                let is_first = self.token_field == first.token_field;
                let token_field = match self.token_field {
                    TokenField::MaxTokens if is_first => TokenField::MaxCompletionTokens,
                    _ if is_first => TokenField::MaxTokens,
                    _ => TokenField::Omit,
                };
                // The Responses API has one name for it.
                let token_field = match self.wire {
                    Wire::Responses => TokenField::Omit,
                    _ => token_field,
                };
                Self {
                    token_field,
                    ..self
                }
            }
            AdaptableField::Temperature if parameters.temperature == Temperature::Auto => Self {
                temperature: None,
                ..self
            },
            AdaptableField::StreamUsage => Self {
                stream_usage: false,
                ..self
            },
            AdaptableField::Logprobs => Self {
                top_logprobs: None,
                ..self
            },
            AdaptableField::TopLogprobs => Self {
                top_logprobs: Some(FEWER_LOGPROBS)
                    .filter(|_| self.top_logprobs == Some(TOP_LOGPROBS)),
                ..self
            },
            _ => return None,
        };
        (adapted != self).then_some(adapted)
    }

    /// Whether a field is sent in another way than in the `first` request.
    pub(in crate::ask) fn differs(self, field: AdaptableField, first: Self) -> bool {
        match field {
            AdaptableField::Wire(_) => self.wire != first.wire,
            AdaptableField::TokenField => self.token_field != first.token_field,
            AdaptableField::Temperature => self.temperature != first.temperature,
            AdaptableField::StreamUsage => self.stream_usage != first.stream_usage,
            AdaptableField::Logprobs | AdaptableField::TopLogprobs => {
                self.top_logprobs != first.top_logprobs
            }
        }
    }

    /// Changes since the `first` request, in words.
    pub(in crate::ask) fn changes(self, first: Self) -> Vec<String> {
        let wire = match self.wire {
            wire if wire == first.wire => None,
            Wire::Responses => Some("it is asked through the Responses API".to_owned()),
            _ => Some("its replies are streamed".to_owned()),
        };
        let field = (self.token_field != first.token_field).then(|| match self.token_field {
            TokenField::Omit => "no token limit is sent".to_owned(),
            field => format!("the token limit is sent as {field}"),
        });
        let temperature = (self.temperature != first.temperature)
            .then(|| "no temperature is sent: the server's own is used".to_owned());
        let usage = (self.stream_usage != first.stream_usage)
            .then(|| "a stream is not asked for the number of its tokens".to_owned());
        let logprobs = (self.top_logprobs != first.top_logprobs).then(|| match self.top_logprobs {
            Some(top) => format!("the probabilities of {top} tokens are asked for"),
            None => "it states no probabilities: its confidence is not available".to_owned(),
        });
        let changes = [wire, field, temperature, usage, logprobs];
        changes.into_iter().flatten().collect()
    }
}

/// The contents of a request that a server may refuse.
#[derive(Debug, Clone, Copy)]
pub(in crate::ask) struct SentFields<'a> {
    pub(in crate::ask) parameters: &'a Parameters,
    pub(in crate::ask) fields: RequestFields,
    pub(in crate::ask) has_image: bool,
    pub(in crate::ask) has_key: bool,
}

impl<'a> SentFields<'a> {
    /// The user's own fields.
    pub(in crate::ask) fn own(self) -> impl Iterator<Item = RequestField<'a>> {
        let extra = &self.parameters.extra;
        let of_body = extra.body.keys().map(|name| RequestField {
            name,
            state: FieldState::Sent,
            adaptable: None,
            hint: "leave this field out of --extra-body, or give a value that the server takes",
        });
        let of_system = ["system", "instructions"].map(|name| RequestField {
            name,
            state: FieldState::set(extra.system.is_some()),
            adaptable: None,
            hint: "leave --system out: the model takes no system message",
        });
        of_system.into_iter().chain(of_body)
    }
}

/// Words by which servers state that they do not support a field or its value, and not that the value is wrong.
const UNSUPPORTED: [&str; 24] = [
    "unsupported",
    "not supported",
    "does not support",
    "doesn't support",
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
    "may only be set to",
    "valid values are",
    "supported values are",
    "unavailable",
    "not available",
    "not enabled",
    "instead",
];

/// Whether a field is in a request.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::ask) enum FieldState {
    /// It is.
    Sent,
    /// It is not sent any more, because the server refused it before.
    Withdrawn,
    /// It was never sent, so it is not the cause of a refusal.
    Absent,
}

impl FieldState {
    /// The state of a field that is sent if it is set.
    pub(in crate::ask) fn set(sent: bool) -> Self {
        if sent { Self::Sent } else { Self::Absent }
    }

    /// The state of a field that is sent until the server refuses it, unless the user leaves it out.
    pub(in crate::ask) fn until_refused(sent: bool, left_out: bool) -> Self {
        match (sent, left_out) {
            (true, _) => Self::Sent,
            (false, true) => Self::Absent,
            (false, false) => Self::Withdrawn,
        }
    }
}

/// Names of fields that are ordinary words, too: in a message they count only in quotation marks.
const ORDINARY_WORDS: [&str; 5] = ["detail", "effort", "format", "reasoning", "seed"];

/// A field of a request, with the remedy if it is refused.
#[derive(Debug, Clone, Copy)]
pub(in crate::ask) struct RequestField<'a> {
    pub(in crate::ask) name: &'a str,
    /// Whether the field was sent.
    pub(in crate::ask) state: FieldState,
    /// The remedy for the user: the flag that changes the field.
    pub(in crate::ask) hint: &'static str,
    /// The kind of field, if the program can send it in another way.
    pub(in crate::ask) adaptable: Option<AdaptableField>,
}

impl RequestField<'_> {
    /// Whether the server names the field as the cause: in the error's own field for it, or in words of refusal that name it.
    pub(in crate::ask) fn is_named(&self, api_error: &ApiError) -> bool {
        if self.is_param(api_error) {
            return true;
        }
        let is_ordinary = ORDINARY_WORDS.contains(&self.name);
        let in_words = self.is_mentioned(api_error) && !is_ordinary;
        is_unsupported(api_error) && (in_words || self.is_quoted(api_error))
    }

    /// Whether the error's own field for it names the field, alone or at the end of a path.
    pub(in crate::ask) fn is_param(&self, api_error: &ApiError) -> bool {
        let param = api_error.param.as_deref();
        let param = param.and_then(|param| param.rsplit(['.', '/']).next());
        param == Some(self.name)
    }

    /// Whether the server's text mentions the field.
    pub(in crate::ask) fn is_mentioned(&self, api_error: &ApiError) -> bool {
        mentions(&api_error.message.to_lowercase(), self.name)
    }

    /// Whether the server's text has the field in quotation marks, alone or at the end of a path.
    fn is_quoted(&self, api_error: &ApiError) -> bool {
        let quoted = api_error
            .message
            .split(['`', '\'', '"', '“', '”', '‘', '’']);
        quoted
            .skip(1)
            .step_by(2)
            .any(|path| path.rsplit(['.', '/']).next() == Some(self.name))
    }
}

/// Whether the server states that it does not support a field or a kind of value.
pub(in crate::ask) fn is_unsupported(api_error: &ApiError) -> bool {
    let codes = [
        "unsupported_parameter",
        "unsupported_value",
        "unknown_parameter",
    ];
    api_error.mentions_any(&UNSUPPORTED) || api_error.has_code(&codes)
}

/// Whether a text has a name as a whole word: `max_tokens` is not in `max_tokens_total`.
fn mentions(text: &str, name: &str) -> bool {
    let is_name = |c: char| c.is_alphanumeric() || c == '_';
    text.split(|c: char| !is_name(c)).any(|word| word == name)
}
