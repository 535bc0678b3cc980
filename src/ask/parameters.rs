//! How a model is to speak: [`Parameters`].

use std::fmt;
use std::str::FromStr;

use serde::Serialize;
use serde_json::{Value, json};

use crate::error::{Error, Result};
use crate::types::words::words;

/// What a model is called and how it is to speak; what is `None` is left out of the request.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameters {
    /// The model, by the endpoint's name.
    pub model: String,
    /// The sampling temperature.
    pub temperature: Temperature,
    /// What the server's sampling starts from, where it takes that: with a temperature above 0 replies are then more alike.
    pub seed: Option<u64>,
    /// The most tokens a reply may have. Reasoning models spend it on hidden reasoning first.
    pub max_tokens: Option<u32>,
    /// The field in which that limit is sent.
    pub token_field: TokenField,
    /// How hard a reasoning model is to think, in the endpoint's words.
    pub reasoning_effort: Option<String>,
    /// In what resolution the image is to be looked at.
    pub detail: Option<Detail>,
    /// What the server lets the model say.
    pub constrain: Constrain,
}

impl Parameters {
    /// The smallest request every server takes: the model at temperature 0 with room for a reasoned reply.
    #[must_use]
    pub fn new(model: String) -> Self {
        Self {
            model,
            temperature: Temperature::Auto,
            seed: None,
            max_tokens: Some(Self::MAX_TOKENS),
            token_field: TokenField::Auto,
            reasoning_effort: None,
            detail: None,
            constrain: Constrain::None,
        }
    }

    /// The token limit where none is set: a letter needs 16, a reasoning model burns hundreds before it.
    pub const MAX_TOKENS: u32 = 1024;

    /// All that can change a reply. The name of the token limit's field does not; whether a limit is sent does.
    pub(super) fn content(&self) -> Value {
        let limit = self
            .max_tokens
            .filter(|_| self.token_field != TokenField::Omit);
        json!({
            "model": self.model,
            "temperature": self.temperature.to_string(),
            "seed": self.seed,
            "max_tokens": limit,
            "reasoning_effort": self.reasoning_effort,
            "detail": self.detail,
            "constrain": self.constrain.to_string(),
        })
    }
}

/// The sampling temperature of a request.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Temperature {
    /// 0, the likeliest answer, as repeatable as the server allows; the server's own where the model refuses any, as
    /// reasoning models do.
    Auto,
    /// The server's own: none is sent.
    Server,
    /// This one.
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
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        match (text, text.parse::<f64>()) {
            ("auto", _) => Ok(Self::Auto),
            ("default", _) => Ok(Self::Server),
            (_, Ok(value)) if value.is_finite() && value >= 0.0 => Ok(Self::Of(value)),
            _ => Err(Error::usage(
                "--temperature",
                format_args!("{text:?} is neither a number from 0 on nor auto or default"),
            )),
        }
    }
}

/// The field in which a token limit is sent.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TokenField {
    /// `max_completion_tokens` at OpenAI itself, `max_tokens` elsewhere; the other one where the server asks for it.
    Auto,
    /// `max_tokens`: what every other server understands.
    MaxTokens,
    /// `max_completion_tokens`: what reasoning models of OpenAI demand.
    MaxCompletionTokens,
    /// None: no limit is sent.
    Omit,
}

impl TokenField {
    /// The field for an endpoint of this host: never `Auto`.
    pub(super) fn at(self, host: &str) -> Self {
        match self {
            Self::Auto if host == "api.openai.com" => Self::MaxCompletionTokens,
            Self::Auto => Self::MaxTokens,
            field => field,
        }
    }
}

/// In what resolution a server is to look at an image.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Detail {
    /// As the server thinks best.
    Auto,
    /// Small: what little can be seen in the dark is lost.
    Low,
    /// Large.
    High,
}

/// What a server lets a model say. Anything but `None` measures something else: what the model would say if it had to
/// name a letter.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Constrain {
    /// Whatever it likes.
    None,
    /// A JSON object with the letter of a choice, by `response_format` (OpenAI, vLLM, SGLang, llama.cpp, Ollama, Gemini).
    Json,
    /// The letter of a choice alone, by `structured_outputs` (vLLM from 0.12).
    Choice,
}

words!(TokenField by "--token-field" {
    Auto = "auto",
    MaxTokens = "max_tokens",
    MaxCompletionTokens = "max_completion_tokens",
    Omit = "none",
});
words!(Detail by "--detail" { Auto = "auto", Low = "low", High = "high" });
words!(Constrain by "--constrain" { None = "none", Json = "json", Choice = "choice" });

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_read_back() {
        for name in ["auto", "max_tokens", "max_completion_tokens", "none"] {
            assert_eq!(name.parse::<TokenField>().unwrap().to_string(), name);
        }
        for name in ["auto", "low", "high"] {
            assert_eq!(name.parse::<Detail>().unwrap().to_string(), name);
        }
        for name in ["none", "json", "choice"] {
            assert_eq!(name.parse::<Constrain>().unwrap().to_string(), name);
        }
        for text in ["auto", "default", "0.5"] {
            assert_eq!(text.parse::<Temperature>().unwrap().to_string(), text);
        }
        for wrong in ["-1", "NaN", "inf", "", "hot"] {
            assert!(wrong.parse::<Temperature>().is_err(), "{wrong}");
        }
        let wrong = "max".parse::<TokenField>().unwrap_err().to_string();
        assert!(wrong.ends_with("none of auto, max_tokens, max_completion_tokens, none"));
        assert!("ultra".parse::<Detail>().is_err());
    }

    #[test]
    fn the_field_depends_on_the_host() {
        let auto = TokenField::Auto;
        assert_eq!(auto.at("api.openai.com"), TokenField::MaxCompletionTokens);
        assert_eq!(auto.at("localhost"), TokenField::MaxTokens);
        assert_eq!(TokenField::Omit.at("api.openai.com"), TokenField::Omit);
    }

    #[test]
    fn the_content_is_what_decides_a_reply() {
        let base = Parameters::new("m".into());
        let mut others = vec![base.clone(); 8];
        others[0].model = "n".into();
        others[1].temperature = Temperature::Server;
        others[2].token_field = TokenField::Omit;
        others[3].reasoning_effort = Some(String::new());
        others[4].detail = Some(Detail::High);
        others[5].constrain = Constrain::Json;
        others[6].temperature = Temperature::Of(0.0);
        others[7].seed = Some(0);
        for other in &others {
            assert_ne!(other.content(), base.content(), "{other:?}");
        }
        let renamed = Parameters {
            token_field: TokenField::MaxTokens,
            ..base.clone()
        };
        assert_eq!(renamed.content(), base.content());
    }
}
