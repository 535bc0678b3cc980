//! Request fields that not all servers accept: [`RequestField`] describes one field for the analysis of a refusal,
//! [`RequestFields`] has the values of the fields that the program adapts.
//!
//! Replies constrained to one letter: the JSON [`schema`] in the request, and the [`constrained_letter`] in the reply.
//!
//! The range of temperatures in a server's refusal: [`least_temperature`].

use std::sync::LazyLock;

use regex::Regex;
use serde_json::{Map, Value, json};

use super::extra_fields::ThinkingSwitch;
use super::parameters::{Constrain, Parameters, Temperature, TokenField};
use crate::endpoints::BaseUrl;
use crate::failures::ApiError;
use crate::vendors::Vendor;
use crate::wire_kind::{Wire, WireSetting};
use darkqa_base::error::{Error, Result};
use darkqa_base::types::questions::letter;

/// Field that a server may refuse and that the program can send in another way.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AdaptableField {
    /// Token limit, which has two names.
    TokenField,
    /// Temperature; some models accept only their default, or only positive ones.
    Temperature {
        /// Least temperature that the server accepts, in hundredths; `None` if it accepts only its own or states none.
        least: Option<u16>,
    },
    /// Seed of the sampling; many servers have none.
    Seed,
    /// API, to the one that the server asks for.
    Wire(Wire),
    /// Request for token counts in a stream.
    StreamUsage,
    /// Request for token probabilities.
    Logprobs,
    /// Number of top tokens whose probabilities are requested.
    TopLogprobs,
}

/// Values of the adaptable fields. They are the same for all requests of a run, except after a refusal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RequestFields {
    /// The API.
    pub wire: Wire,
    /// Name of the token limit; never `Auto`.
    pub token_field: TokenField,
    /// Temperature; `None` to send none.
    pub temperature: Option<f64>,
    /// Seed of the sampling; `None` to send none.
    pub seed: Option<u64>,
    /// True to request token counts in a stream.
    pub stream_usage: bool,
    /// Number of top tokens whose probabilities are requested; `None` to request none.
    pub top_logprobs: Option<u8>,
    /// Switch that turns thinking on or off; `None` to send none.
    pub thinking: Option<&'static ThinkingSwitch>,
}

/// Maximum number of top tokens of OpenAI's API and most other servers.
const TOP_LOGPROBS: u8 = 20;

/// Maximum number of top tokens of some servers, such as Text Generation Inference.
const FEWER_LOGPROBS: u8 = 5;

impl RequestFields {
    /// Fields of the first request to a server.
    ///
    /// # Errors
    /// If the server has no known switch for `--thinking`, or if the switch is the reasoning effort and
    /// `--reasoning-effort` is also set.
    pub fn initial(parameters: &Parameters, base: &BaseUrl, vendor: Option<&Vendor>) -> Result<Self> {
        let thinking = parameters.thinking.map(|thinking| thinking.switch_for(base)).transpose()?;
        let sets_effort = thinking.is_some_and(|switch| switch.effort.is_some());
        if sets_effort && parameters.reasoning_effort.is_some() {
            let problem = "this server takes it as the reasoning effort, which --reasoning-effort sets already";
            return Err(Error::usage("--thinking", problem));
        }
        Ok(Self {
            wire: parameters.wire.initial(),
            token_field: Vendor::token_field_at(vendor, parameters.token_field),
            temperature: match parameters.temperature {
                Temperature::Auto => Some(0.0),
                Temperature::Server => None,
                Temperature::Of(value) => Some(value),
            },
            seed: parameters.seed,
            stream_usage: true,
            top_logprobs: parameters.probabilities.then_some(TOP_LOGPROBS),
            thinking,
        })
    }

    /// Reasoning effort: from the user, or from the switch for thinking.
    pub fn effort<'p>(&self, parameters: &'p Parameters) -> Option<&'p str> {
        parameters.reasoning_effort.as_deref().or_else(|| self.thinking?.effort.as_deref())
    }

    /// Body fields of the switch for thinking.
    pub fn thinking_body(&self) -> Option<&'static Map<String, Value>> {
        self.thinking.map(|switch| &switch.body)
    }

    /// Body fields of the switch for thinking, as fields that a server may refuse.
    pub fn thinking_fields<'a>(self) -> impl Iterator<Item = RequestField<'a>> {
        self.thinking_body().into_iter().flat_map(Map::keys).map(|name| RequestField {
            name,
            state: FieldState::Sent,
            hint: "leave --thinking out: the model or its server has no such switch",
            adaptable: None,
        })
    }

    /// Adapts the fields after the refusal of one of them; `None` if the user set the field, or if no other way is
    /// left. A token limit is first sent under its other name and then omitted.
    pub fn after_refusal(self, field: AdaptableField, initial: Self, parameters: &Parameters) -> Option<Self> {
        let adapted = match field {
            AdaptableField::Wire(wire) if parameters.wire == WireSetting::Auto => Self { wire, ..self },
            AdaptableField::TokenField if parameters.token_field == TokenField::Auto => {
                let is_initial = self.token_field == initial.token_field;
                let token_field = match self.token_field {
                    TokenField::MaxTokens if is_initial => TokenField::MaxCompletionTokens,
                    _ if is_initial => TokenField::MaxTokens,
                    _ => TokenField::Omit,
                };
                // The Responses API has only one name.
                let token_field = match self.wire {
                    Wire::Responses => TokenField::Omit,
                    _ => token_field,
                };
                Self { token_field, ..self }
            }
            AdaptableField::Temperature { least } if parameters.is_default_temperature() => {
                Self { temperature: self.least_accepted(least, parameters), ..self }
            }
            AdaptableField::Seed if parameters.origin.default_seed => Self { seed: None, ..self },
            AdaptableField::StreamUsage => Self { stream_usage: false, ..self },
            AdaptableField::Logprobs => Self { top_logprobs: None, ..self },
            AdaptableField::TopLogprobs => {
                Self { top_logprobs: Some(FEWER_LOGPROBS).filter(|_| self.top_logprobs == Some(TOP_LOGPROBS)), ..self }
            }
            _ => return None,
        };
        (adapted != self).then_some(adapted)
    }

    /// Temperature after the refusal of a lower one: the least that the server accepts, which is closest to the
    /// likeliest answer, or none. None with probabilities, because some servers compute them at the temperature.
    fn least_accepted(self, least: Option<u16>, parameters: &Parameters) -> Option<f64> {
        let least = f64::from(least.filter(|_| !parameters.probabilities)?) / 100.0;
        (self.temperature? < least).then_some(least)
    }

    /// True if a field differs from the `initial` fields.
    pub fn differs(self, field: AdaptableField, initial: Self) -> bool {
        match field {
            AdaptableField::Wire(_) => self.wire != initial.wire,
            AdaptableField::TokenField => self.token_field != initial.token_field,
            AdaptableField::Temperature { .. } => self.temperature != initial.temperature,
            AdaptableField::Seed => self.seed != initial.seed,
            AdaptableField::StreamUsage => self.stream_usage != initial.stream_usage,
            AdaptableField::Logprobs | AdaptableField::TopLogprobs => self.top_logprobs != initial.top_logprobs,
        }
    }

    /// Differences from the `initial` fields, as phrases for messages.
    pub fn changes(self, initial: Self) -> Vec<String> {
        let wire = match self.wire {
            wire if wire == initial.wire => None,
            Wire::Responses => Some("it is asked through the Responses API".to_owned()),
            _ => Some("its replies are streamed".to_owned()),
        };
        let field = (self.token_field != initial.token_field).then(|| match self.token_field {
            TokenField::Omit => "no token limit is sent".to_owned(),
            field => format!("the token limit is sent as {field}"),
        });
        let temperature = (self.temperature != initial.temperature).then(|| match self.temperature {
            Some(least) => {
                format!("the temperature is sent as {least}, the least that it takes")
            }
            None => "no temperature is sent: the server's own is used".to_owned(),
        });
        let seed = (self.seed != initial.seed)
            .then(|| "no seed is sent: replies at a temperature above 0 differ each time".to_owned());
        let usage = (self.stream_usage != initial.stream_usage)
            .then(|| "a stream is not asked for the number of its tokens".to_owned());
        let logprobs = (self.top_logprobs != initial.top_logprobs).then(|| match self.top_logprobs {
            Some(top) => format!("the probabilities of {top} tokens are asked for"),
            None => "it states no probabilities: its confidence is not available".to_owned(),
        });
        [wire, field, temperature, seed, usage, logprobs].into_iter().flatten().collect()
    }
}

/// Content of a request, for the analysis of a refusal.
#[derive(Debug, Clone, Copy)]
pub struct SentFields<'a> {
    pub parameters: &'a Parameters,
    pub fields: RequestFields,
    pub has_image: bool,
    pub has_key: bool,
}

impl<'a> SentFields<'a> {
    /// Flags of the fields sent that not all providers take, those of the user first.
    pub fn optional_flags(self) -> Vec<String> {
        let parameters = self.parameters;
        let extra: Vec<&str> = parameters.extra.body.keys().map(String::as_str).collect();
        let flags = [
            (parameters.probabilities, "--request probabilities"),
            (parameters.constrain != Constrain::None, "--request constrain"),
            (parameters.reasoning_effort.is_some(), "--reasoning-effort"),
            (parameters.thinking.is_some(), "--thinking"),
            (parameters.top_p.is_some(), "--top-p"),
        ];
        let own = flags.into_iter().filter(|(is_sent, _)| *is_sent).map(|(_, flag)| flag.to_owned());
        let extra = (!extra.is_empty()).then(|| format!("--extra-body ({})", extra.join(", ")));
        let sent = [
            (self.fields.seed.is_some(), "the seed (--sampling-seed none)"),
            (self.fields.temperature.is_some(), "the temperature (--temperature default)"),
            (self.fields.token_field != TokenField::Omit, "the token limit (--request token-field=none)"),
        ];
        let sent = sent.into_iter().filter(|(is_sent, _)| *is_sent).map(|(_, flag)| flag.to_owned());
        own.chain(extra).chain(sent).collect()
    }

    /// Fields that the user adds: the system message and `--extra-body`.
    pub fn user_fields(self) -> impl Iterator<Item = RequestField<'a>> {
        let extra = &self.parameters.extra;
        let body_fields = extra.body.keys().map(|name| RequestField {
            name,
            state: FieldState::Sent,
            adaptable: None,
            hint: "leave this field out of --extra-body, or give a value that the server takes",
        });
        ["system", "instructions"]
            .into_iter()
            .map(move |name| RequestField {
                name,
                state: FieldState::sent_if(extra.system.is_some()),
                adaptable: None,
                hint: "leave --system out: the model takes no system message",
            })
            .chain(body_fields)
    }
}

/// Phrases for an unsupported field or value, as opposed to a wrong value.
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

/// Presence of a field in a request.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FieldState {
    /// The field is sent.
    Sent,
    /// The field is no longer sent, because the server refused it.
    Withdrawn,
    /// The field was never sent, so it cannot be the cause of a refusal.
    Absent,
}

impl FieldState {
    /// State of a field that the program does not adapt.
    pub fn sent_if(sent: bool) -> Self {
        if sent { Self::Sent } else { Self::Absent }
    }

    /// State of an adaptable field. If it is not sent, either it was omitted from the start or the server has refused
    /// it.
    pub fn until_refused(sent: bool, omitted: bool) -> Self {
        match (sent, omitted) {
            (true, _) => Self::Sent,
            (false, true) => Self::Absent,
            (false, false) => Self::Withdrawn,
        }
    }
}

/// Field names that are also ordinary words: in an error message they count only in quotation marks.
const ORDINARY_WORDS: [&str; 5] = ["detail", "effort", "format", "reasoning", "seed"];

/// Field of a request, with the remedy if it is refused.
#[derive(Debug, Clone, Copy)]
pub struct RequestField<'a> {
    pub name: &'a str,
    /// Presence in the request.
    pub state: FieldState,
    /// Remedy for the user: the flag that changes the field.
    pub hint: &'static str,
    /// The adaptable field, if the program can send it in another way.
    pub adaptable: Option<AdaptableField>,
}

impl<'a> RequestField<'a> {
    /// The temperature or seed sent, if the error is about it and no other field: it mentions no other sent field.
    pub fn subject<'f>(fields: &'f [RequestField<'a>], api_error: &ApiError) -> Option<&'f RequestField<'a>> {
        let mut mentioned = fields.iter().filter(|field| {
            let is_adapted = matches!(field.adaptable, Some(AdaptableField::Temperature { .. } | AdaptableField::Seed));
            let is_ordinary = ORDINARY_WORDS.contains(&field.name) && !is_adapted;
            field.state == FieldState::Sent
                && field.is_mentioned(api_error)
                && (!is_ordinary || field.is_quoted(api_error))
        });
        mentioned
            .next()
            .filter(|_| mentioned.next().is_none())
            .filter(|field| matches!(field.adaptable, Some(AdaptableField::Temperature { .. } | AdaptableField::Seed)))
    }

    /// Flags of the setting that decides the field, if a run may continue with another value after a refusal.
    pub fn forced_flags(&self) -> &'static [&'static str] {
        match self.name {
            "temperature" => &["--temperature"],
            "seed" => &["--sampling-seed"],
            "top_p" => &["--top-p"],
            "max_tokens" | "max_completion_tokens" | "max_output_tokens" => &["--max-tokens"],
            _ => &[],
        }
    }

    /// True if the server names the field as the cause: in the `param` of the error, or in a message about an
    /// unsupported field.
    pub fn is_named(&self, api_error: &ApiError) -> bool {
        if self.is_param(api_error) {
            return true;
        }
        let is_unquoted_name = !ORDINARY_WORDS.contains(&self.name) && self.is_mentioned(api_error);
        is_unsupported(api_error) && (is_unquoted_name || self.is_quoted(api_error))
    }

    /// True if the `param` of the error is the field, alone or at the end of a path.
    pub fn is_param(&self, api_error: &ApiError) -> bool {
        api_error.param.as_deref().is_some_and(|path| last_segment(path) == self.name)
    }

    /// True if the error message mentions the field.
    pub fn is_mentioned(&self, api_error: &ApiError) -> bool {
        mentions(&api_error.message.to_lowercase(), self.name)
    }

    /// True if the error message has the field in quotation marks, alone or at the end of a path.
    fn is_quoted(&self, api_error: &ApiError) -> bool {
        api_error
            .message
            .split(['`', '\'', '"', '“', '”', '‘', '’'])
            .skip(1)
            .step_by(2)
            .any(|path| last_segment(path) == self.name)
    }
}

/// Last segment of a path with dots or slashes.
fn last_segment(path: &str) -> &str {
    path.rsplit(['.', '/']).next().unwrap_or(path)
}

/// True if the error is about an unsupported field or value.
pub(crate) fn is_unsupported(api_error: &ApiError) -> bool {
    let codes = ["unsupported_parameter", "unsupported_value", "unknown_parameter"];
    api_error.mentions_any(&UNSUPPORTED) || api_error.has_code(&codes)
}

/// True if a text contains a name as a whole word: `max_tokens` is not in `max_tokens_total`.
fn mentions(text: &str, name: &str) -> bool {
    text.split(|c: char| !c.is_alphanumeric() && c != '_').any(|word| word == name)
}

/// Name of the only field in a reply with `--request constrain=json`.
pub(crate) const ANSWER: &str = "answer";

/// JSON schema of an object whose only field is one of the letters.
pub(crate) fn schema(letters: &[char]) -> Value {
    json!({
        "type": "object", "additionalProperties": false, "required": [ANSWER],
        "properties": {ANSWER: {"type": "string", "enum": letters}},
    })
}

/// Letter in a constrained reply; `None` without a constraint, or if the server did not follow it.
pub(crate) fn constrained_letter(constrain: Constrain, choices: usize, reply: &str) -> Option<String> {
    let object: Option<Value> = match constrain {
        Constrain::None => return None,
        Constrain::Json => serde_json::from_str(without_fence(reply)).ok(),
        Constrain::Choice => None,
    };
    let text = match &object {
        Some(object) if object.as_object()?.len() == 1 => object.get(ANSWER)?.as_str()?,
        Some(_) => return None,
        None => reply,
    };
    (0..choices).map(|index| letter(index).to_string()).find(|letter| letter == text.trim())
}

/// The content of a fenced code block that is the whole text; other texts are returned as they are.
fn without_fence(text: &str) -> &str {
    let fenced = || {
        let inner = text.trim().strip_prefix("```")?.strip_suffix("```")?;
        let (language, block) = inner.split_once('\n')?;
        language.trim().chars().all(char::is_alphanumeric).then_some(block)
    };
    fenced().unwrap_or(text)
}

/// Matches a lower bound that is accepted itself: `[0.01, 2]`, `between 0.01 and 2`, `0.01 … 2`, `at least 0.01`. One
/// group has the bound.
static CLOSED: LazyLock<Regex> = LazyLock::new(|| {
    compiled(
        r"(?i)\[\s*(\d*\.?\d+)\s*[,;]|\b(?:between|range(?: of)?|from|at least|no less than|minimum(?: is| of| value:?)?)\s+\[?(\d*\.?\d+)|(?:>=|≥|⩾|greater than or equal to|不小于|大于等于|不低于)\s*(\d*\.?\d+)|(\d*\.?\d+)\s*(?:…|\.\.+|~|–|\bto\b|至|到)\s*\d",
    )
});

/// Matches a lower bound that is not accepted itself: `(0, 1]`, `greater than 0`, `> 0`. One group has the bound.
static OPEN: LazyLock<Regex> = LazyLock::new(|| {
    compiled(
        r"(?i)\(\s*(\d*\.?\d+)\s*[,;]|\b(?:greater|higher|larger|more|bigger) than\s+(\d*\.?\d+)|\babove\s+(\d*\.?\d+)|>\s*(\d*\.?\d+)|大于\s*(\d*\.?\d+)",
    )
});

/// Words for a bound of 0 that is not accepted itself.
const POSITIVE: [&str; 5] = ["positive", "non-zero", "nonzero", "正数", "positiv"];

/// Step above a bound that is not accepted itself, in hundredths; chosen, the least temperature of several servers.
const STEP: u16 = 1;

/// Largest bound that is not a mistake of this parser, in hundredths: servers take temperatures up to 2.
const MAX_BOUND: u16 = 200;

/// Least temperature that a server accepts by its refusal of a lower one, in hundredths. `None` if the refusal states
/// no range.
pub(crate) fn least_temperature(message: &str) -> Option<u16> {
    let lower = message.to_lowercase();
    // Only one temperature is accepted: the server's own.
    if lower.contains("only") {
        return None;
    }
    let open = first_bound(&OPEN, &lower).map(|bound| bound + STEP);
    let closed = first_bound(&CLOSED, &lower).map(|bound| bound.max(STEP));
    let positive = POSITIVE.iter().any(|word| lower.contains(word)).then_some(STEP);
    closed.or(open).or(positive).filter(|bound| *bound <= MAX_BOUND)
}

/// First number in a group of the pattern, in hundredths, rounded up.
fn first_bound(pattern: &Regex, text: &str) -> Option<u16> {
    let captures = pattern.captures(text)?;
    let number: f64 = captures.iter().skip(1).flatten().next()?.as_str().parse().ok()?;
    let hundredths = (number * 100.0).ceil();
    (0.0..=f64::from(MAX_BOUND)).contains(&hundredths).then_some(hundredths as u16)
}

fn compiled(pattern: &str) -> Regex {
    Regex::new(pattern).unwrap_or_else(|e| unreachable!("a test compiles it: {e}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_letter_of_a_constrained_reply_is_found() {
        use Constrain::{Choice, Json};
        for (constrain, reply, letter) in [
            (Json, "{\"answer\": \"B\"}", Some("B")),
            (Json, " {\n\"answer\" : \"A\" }\n", Some("A")),
            (Json, "```json\n{\"answer\": \"B\"}\n```\n", Some("B")),
            (Json, "```\n{\"answer\": \"A\"}```", Some("A")),
            (Json, "```json\n{\"answer\": \"C\"}\n```", None),
            (Json, "{\"answer\":\"C\"}", None),
            (Json, "{\"answer\":\"B", None),
            (Json, "{\"answer\":\"B\",\"why\":\"x\"}", None),
            (Json, "The answer is B", None),
            (Choice, "B", Some("B")),
            (Choice, " A\n", Some("A")),
            (Choice, "a", None),
            (Choice, "B. yes", None),
        ] {
            assert_eq!(constrained_letter(constrain, 2, reply).as_deref(), letter, "{reply}");
        }
    }

    #[test]
    fn ranges_are_found() {
        for (message, least) in [
            ("Input validation error: `temperature` must be strictly positive", Some(1)),
            ("invalid params, temperature should be in (0, 1] (2013)", Some(1)),
            ("temperature must be in (0,1]", Some(1)),
            ("temperature should be in the range 0.01 … 2", Some(1)),
            ("temperature: Input should be greater than 0", Some(1)),
            ("temperature must be > 0.1", Some(11)),
            ("temperature must be at least 0.05", Some(5)),
            ("temperature: Input should be greater than or equal to 0.01", Some(1)),
            ("temperature must be between 0.1 and 1.0", Some(10)),
            ("temperature 取值范围 [0.01, 2]", Some(1)),
            ("temperature 必须大于0", Some(1)),
            ("temperature must be in [0, 1]", Some(1)),
            ("invalid temperature: only 1 is allowed for this model", None),
            ("invalid temperature: only 0.6 is allowed for this model", None),
            ("`temperature` is deprecated for this model.", None),
            ("`temperature` may only be set to 1 when thinking is enabled.", None),
            ("'temperature' does not support 0.0 with this model.", None),
            ("temperature must be at least 500", None),
        ] {
            assert_eq!(least_temperature(message), least, "{message}");
        }
    }
}
