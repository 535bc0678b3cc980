//! Model name and sampling settings of requests: [`Parameters`].
//!
//! Messages about the judge of open answers, whose settings have flags of their own: [`for_judge`].
//!
//! The field in which a token limit is sent: [`TokenField`].

use std::fmt;
use std::num::NonZeroU32;
use std::str::FromStr;

use clap::{Args, ValueEnum};
use serde::Serialize;
use serde_json::{Map, Value, json};

use super::continued::{ChangedSetting, Continued};
use super::extra_fields::{ExtraFields, Thinking};
use crate::wire_kind::WireSetting;
use darkqa_base::error::{Error, Result};
use darkqa_base::types::Decides;
use darkqa_base::types::flags::flag_words;
use darkqa_base::types::text::words::written_as_text;

/// The name of a model and the settings of its replies; a setting that is `None` is left out of the request.
///
/// The JSON form has everything that can change a reply, and is part of the key of each trial. Settings that are not
/// set are not written or null, so that a new setting changes no earlier key.
#[derive(Debug, Clone, PartialEq, Args, Serialize)]
#[command(next_help_heading = "Model")]
pub struct Parameters {
    /// The model, by the endpoint's name.
    #[arg(skip)]
    pub model: String,
    /// Sampling temperature; default is the server's own; auto is 0; if the model refuses 0, the lowest value that it
    /// states, else the server's own
    #[arg(long, value_name = "T|auto|default", default_value_t = Temperature::Auto, add = Decides::Reply)]
    pub temperature: Temperature,
    /// Nucleus sampling: draw from the likeliest tokens up to this total probability; default: not sent
    #[arg(long, value_name = "P", value_parser = probability, add = Decides::Reply)]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub top_p: Option<f64>,
    /// Maximum tokens of a reply, hidden reasoning included
    ///
    /// A letter needs 16; a reasoning model uses hundreds before it.
    #[arg(long, value_name = "N", default_value_t = Self::MAX_TOKENS, add = Decides::Reply)]
    pub max_tokens: NonZeroU32,
    /// Other token limit with which the run began, which remains in the keys of its trials; `None` if the limit is the
    /// same.
    #[arg(skip)]
    #[serde(skip)]
    pub first_max_tokens: Option<NonZeroU32>,
    /// Where the settings come from; not sent.
    #[arg(skip)]
    #[serde(skip)]
    pub origin: SettingsOrigin,
    /// Field of the token limit; auto is the vendor's field, else max_tokens, or the other one if the server asks for
    /// it
    #[arg(long, value_name = "FIELD", value_enum, default_value_t = TokenField::Auto, add = Decides::Reply)]
    #[serde(skip)]
    pub token_field: TokenField,
    /// Reasoning effort, in the server's words (none, minimal, low, medium, high …); default: not sent
    #[arg(long, value_name = "EFFORT", add = Decides::Reply)]
    pub reasoning_effort: Option<String>,
    /// Turn thinking on or off, in the server's own field (src/ask/thinking.toml); default: not sent
    #[arg(long, value_name = "THINKING", value_enum, add = Decides::Reply)]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub thinking: Option<Thinking>,
    /// Image detail requested from the server; default: not sent
    #[arg(long, value_name = "DETAIL", value_enum, add = Decides::Reply)]
    pub detail: Option<ImageDetail>,
    /// The API: chat in one piece or as a stream, or the Responses API; auto is chat, and what the server asks for
    /// instead
    #[arg(long, value_name = "WIRE", value_enum, default_value_t, add = Decides::Reply)]
    #[serde(skip)]
    pub wire: WireSetting,
    /// Seed of the server's sampling, for servers that support it: replies at a temperature above 0 are then more
    /// reproducible.
    #[arg(skip)]
    pub seed: Option<u64>,
    /// Constraint that the server enforces on the reply.
    #[arg(skip)]
    pub constrain: Constrain,
    /// True to request the probabilities of the top tokens.
    #[arg(skip)]
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub probabilities: bool,
    /// Fields that the user adds to requests or omits.
    #[arg(skip)]
    #[serde(flatten)]
    pub extra: ExtraFields,
}

impl Parameters {
    /// True if the model was told to think.
    pub fn asks_to_think(&self) -> bool {
        let effort = self.reasoning_effort.as_deref();
        self.thinking == Some(Thinking::On) || effort.is_some_and(|effort| effort != "none")
    }

    /// Default token limit; chosen.
    pub const MAX_TOKENS: NonZeroU32 = NonZeroU32::new(1024).unwrap();

    /// Settings that every server accepts: temperature 0, and enough tokens for a reply with reasoning.
    #[must_use]
    pub fn new(model: String) -> Self {
        Self {
            model,
            temperature: Temperature::Auto,
            top_p: None,
            seed: None,
            max_tokens: Self::MAX_TOKENS,
            first_max_tokens: None,
            origin: SettingsOrigin::default(),
            token_field: TokenField::Auto,
            reasoning_effort: None,
            thinking: None,
            detail: None,
            wire: WireSetting::Auto,
            constrain: Constrain::None,
            probabilities: false,
            extra: ExtraFields::default(),
        }
    }

    /// Token limit in requests; `None` to send none.
    pub fn limit(&self) -> Option<u32> {
        (self.token_field != TokenField::Omit).then_some(self.max_tokens.get())
    }

    /// Token limit in requests, if the run began with another one.
    pub fn changed_limit(&self) -> Option<u32> {
        self.limit().filter(|_| self.first_max_tokens.is_some())
    }

    /// Token limit with which the run began.
    pub fn first_limit(&self) -> u32 {
        self.first_max_tokens.unwrap_or(self.max_tokens).get()
    }

    /// True if the user did not set the temperature.
    pub fn is_default_temperature(&self) -> bool {
        self.temperature == Temperature::Auto || self.origin.default_temperature
    }

    /// The settings that differ from those in a run's column of the model; the address is ignored.
    pub fn changes_from_column(&self, column: &Value) -> Vec<ChangedSetting> {
        let own = self.content().as_object().cloned().unwrap_or_default();
        ChangedSetting::between(column, &by_flag(own))
    }

    /// The same settings for a run whose column of the model has other ones, with the changes; its trial keys keep the
    /// column's settings.
    #[must_use]
    pub fn continuing(&self, column: &Value, changes: Vec<ChangedSetting>) -> Self {
        let first = column["--max-tokens"]
            .as_u64()
            .and_then(|limit| NonZeroU32::new(u32::try_from(limit).ok()?))
            .filter(|first| *first != self.max_tokens);
        Self {
            first_max_tokens: first,
            origin: SettingsOrigin {
                continued: Some(Box::new(Continued::new(column, changes))),
                ..self.origin.clone()
            },
            ..self.clone()
        }
    }

    /// The same settings for a run that began with the smaller token limit `first`, which remains in the keys of its
    /// trials. `None` if the limit of these settings is not larger or not sent.
    pub fn raised_from(&self, first: NonZeroU32) -> Option<Self> {
        let is_larger = self.limit()? > first.get();
        is_larger.then(|| Self { first_max_tokens: Some(first), ..self.clone() })
    }

    /// The same settings for a run whose column of the model differs only in a smaller token limit; otherwise `None`.
    pub fn raised_from_column(&self, column: &Value) -> Option<Self> {
        let first = u32::try_from(column["--max-tokens"].as_u64()?).ok()?;
        self.raised_from(NonZeroU32::new(first)?).filter(|raised| raised.match_column(column))
    }

    /// True if the settings that decide a reply equal those in a run's column of the model; the address is ignored.
    pub fn match_column(&self, column: &Value) -> bool {
        let Value::Object(content) = self.content() else {
            return false;
        };
        let mut column = column.as_object().cloned().unwrap_or_default();
        column.remove("--base-url");
        by_flag(content) == column
    }

    /// Checks that the temperature does not change token probabilities.
    ///
    /// # Errors
    /// [`Error::Usage`] unless the temperature is 0 or the server's default.
    pub fn require_greedy(&self) -> Result<()> {
        match self.temperature {
            Temperature::Of(value) if value > 0.0 => Err(Error::usage(
                "--request probabilities",
                "the probabilities of tokens depend on the temperature: --temperature 0, auto or default expected",
            )),
            _ => Ok(()),
        }
    }

    /// Settings that can change a reply, including the API and the token limit, but not the name of its field.
    pub fn content(&self) -> Value {
        if let Some(first) = &self.origin.continued {
            return first.content.clone();
        }
        let mut content = json!(self);
        let first = self.first_max_tokens.map(NonZeroU32::get);
        content["max_tokens"] = first.or(self.limit()).into();
        content["wire"] = self.wire.content().into();
        content
    }
}

/// Renames the keys of a model's settings to flags.
pub fn by_flag(content: Map<String, Value>) -> Map<String, Value> {
    content.into_iter().map(|(name, value)| (flag_name(&name), value)).collect()
}

/// Where the settings of a model come from, besides their values.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SettingsOrigin {
    /// Settings of the run that these settings continue, which remain in the keys of its trials; `None` if they are the
    /// same.
    pub continued: Option<Box<Continued>>,
    /// True if the user did not set the temperature.
    pub default_temperature: bool,
    /// True if the user did not set the seed.
    pub default_seed: bool,
    /// True for the judge of open answers, whose settings have flags of their own.
    pub is_judge: bool,
}

/// Flag that sets a parameter.
pub(super) fn flag_name(parameter: &str) -> String {
    match parameter {
        "seed" => "--sampling-seed".to_owned(),
        // Keys of a models file that are not flags.
        "deployment" => "deployment".to_owned(),
        "reply_headers" => "reply-headers".to_owned(),
        name => format!("--{}", name.replace('_', "-")),
    }
}

/// Parses a probability above 0.
fn probability(text: &str) -> std::result::Result<f64, String> {
    text.parse()
        .ok()
        .filter(|value| 0.0 < *value && *value <= 1.0)
        .ok_or_else(|| "a number above 0 and up to 1 expected".to_owned())
}

/// Sampling temperature of a request.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Temperature {
    /// 0, for the likeliest answer; or the server's default if the model refuses 0, as reasoning models do.
    Auto,
    /// The server's default: no temperature is sent.
    Server,
    /// A given temperature, 0 or more.
    Of(f64),
}

impl fmt::Display for Temperature {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Auto => f.pad("auto"),
            Self::Server => f.pad("default"),
            Self::Of(value) => write!(f, "{value}"),
        }
    }
}

impl FromStr for Temperature {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        match (text, text.parse::<f64>()) {
            ("auto", _) => Ok(Self::Auto),
            ("default", _) => Ok(Self::Server),
            (_, Ok(value)) if value.is_finite() && value >= 0.0 => Ok(Self::Of(value)),
            _ => Err("a number from 0 on, auto or default expected".to_owned()),
        }
    }
}

/// The resolution at which the server reads an image.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum ImageDetail {
    /// As the server decides
    Auto,
    /// Small: what little can be seen in the dark is lost
    Low,
    /// Large
    High,
    /// As large as it is, within the server's limits (the newest models of OpenAI)
    Original,
}

/// The constraint on a model's reply. Any value but `None` measures something else: the model's answer if it must name
/// a letter.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum Constrain {
    /// Anything
    #[default]
    None,
    /// A JSON object with the letter of a choice, by response_format (OpenAI, vLLM, SGLang, llama.cpp, Ollama, Gemini)
    Json,
    /// The letter of a choice alone, by structured_outputs (vLLM from 0.12)
    Choice,
}

written_as_text!(Temperature);

flag_words!(ImageDetail, Constrain);

/// Flags of models, and the judge's flags for the same settings.
const FLAGS: [(&str, &str); 6] = [
    ("--temperature", "--judge-temperature"),
    ("--max-tokens", "--judge-max-tokens"),
    ("--model", "--judge"),
    ("--base-url", "--judge-base-url"),
    ("--api-key-env", "--judge-api-key-env"),
    ("--api-key-file", "--judge-api-key-file"),
];

/// Replaces the flags of models in a message by those of the judge.
pub(crate) fn for_judge(message: &str) -> String {
    FLAGS.iter().fold(message.to_owned(), |text, (flag, of_judge)| text.replace(flag, of_judge))
}

/// The field in which a token limit is sent.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
#[value(rename_all = "snake_case")]
pub enum TokenField {
    /// Known name of the endpoint, else max_tokens; the other one if the server asks for it
    Auto,
    /// Understood by every other server
    MaxTokens,
    /// Required by reasoning models of OpenAI
    MaxCompletionTokens,
    /// No limit is sent
    #[value(name = "none")]
    Omit,
}

flag_words!(TokenField);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_round_trip() {
        for name in ["auto", "max_tokens", "max_completion_tokens", "none"] {
            let field = TokenField::from_str(name, false).unwrap();
            assert_eq!(field.to_string(), name);
        }
        for text in ["auto", "default", "0.5"] {
            assert_eq!(text.parse::<Temperature>().unwrap().to_string(), text);
        }
        for wrong in ["-1", "NaN", "inf", "", "hot"] {
            assert!(wrong.parse::<Temperature>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn settings_that_affect_replies_change_the_content() {
        let base = Parameters::new("m".into());
        let mut others = vec![base.clone(); 15];
        others[0].model = "n".into();
        others[1].temperature = Temperature::Server;
        others[2].token_field = TokenField::Omit;
        others[3].reasoning_effort = Some(String::new());
        others[4].detail = Some(ImageDetail::High);
        others[5].constrain = Constrain::Json;
        others[6].temperature = Temperature::Of(0.0);
        others[7].seed = Some(0);
        others[8].extra.deployment = Some("a".into());
        others[9].extra.system = Some("a".into());
        others[10].extra.body.insert("a".into(), Value::Null);
        others[11].extra.omit = vec!["a".into()];
        others[12].wire = WireSetting::Responses;
        others[13].probabilities = true;
        others[14].thinking = Some(Thinking::Off);
        for other in &others {
            assert_ne!(other.content(), base.content(), "{other:?}");
        }
        let renamed = Parameters { token_field: TokenField::MaxTokens, wire: WireSetting::ChatStream, ..base.clone() };
        assert_eq!(renamed.content(), base.content());
        let mut raised = base.clone();
        raised.max_tokens = NonZeroU32::new(4096).unwrap();
        assert_ne!(raised.content(), base.content());
        let raised = raised.raised_from(base.max_tokens).unwrap();
        assert_eq!(raised.content(), base.content());
        assert_eq!((raised.limit(), raised.changed_limit()), (Some(4096), Some(4096)));
        assert_eq!(base.raised_from(raised.max_tokens), None);
    }

    #[test]
    fn continued_settings_keep_the_content_of_the_run() {
        let mut first = Parameters::new("m".into());
        first.seed = Some(7);
        first.top_p = Some(0.5);
        let column = Value::Object(by_flag(first.content().as_object().unwrap().clone()));
        assert_eq!(first.changes_from_column(&column), []);
        let mut own = Parameters::new("m".into());
        own.temperature = Temperature::Server;
        own.max_tokens = NonZeroU32::new(400).unwrap();
        let changes = own.changes_from_column(&column);
        let flags: Vec<&str> = changes.iter().map(|change| &*change.flag).collect();
        assert_eq!(flags, ["--max-tokens", "--sampling-seed", "--temperature", "--top-p"]);
        let own = own.continuing(&column, changes);
        assert_eq!(own.content(), first.content());
        assert_eq!((own.changed_limit(), own.first_limit()), (Some(400), 1024));
        assert_eq!(own.temperature, Temperature::Server);
    }

    #[test]
    fn flags_are_replaced() {
        assert_eq!(
            for_judge("--temperature default, or another --model with --max-tokens N"),
            "--judge-temperature default, or another --judge with --judge-max-tokens N"
        );
    }
}
