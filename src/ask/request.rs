//! What is said to an endpoint: [`Parameters`] and the JSON of one request.

use std::fmt;
use std::str::FromStr;

use bytes::Bytes;
use serde::Serialize;

use super::body::Parts;
use super::payload::Payload;
use crate::error::{Error, Result};
use crate::types::Digest;

/// What a model is called and how it is to speak; what is `None` is left out of the request.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameters {
    /// The model, by the endpoint's name.
    pub model: String,
    /// The sampling temperature. Reasoning models refuse any.
    pub temperature: Option<f64>,
    /// The most tokens a reply may have. Reasoning models spend it on hidden reasoning first.
    pub max_tokens: Option<u32>,
    /// The field in which that limit is sent.
    pub token_field: TokenField,
    /// How hard a reasoning model is to think, in the endpoint's words.
    pub reasoning_effort: Option<String>,
    /// In what resolution the image is to be looked at.
    pub detail: Option<Detail>,
}

impl Parameters {
    /// The smallest request every server takes: the model at temperature 0 with room for a reasoned reply.
    #[must_use]
    pub fn new(model: String) -> Self {
        Self {
            model,
            temperature: Some(Self::TEMPERATURE),
            max_tokens: Some(Self::MAX_TOKENS),
            token_field: TokenField::Auto,
            reasoning_effort: None,
            detail: None,
        }
    }

    /// The temperature where none is set: the likeliest answer, as repeatable as the server allows.
    pub const TEMPERATURE: f64 = 0.0;

    /// The token limit where none is set: a letter needs 16, a reasoning model burns hundreds before it.
    pub const MAX_TOKENS: u32 = 1024;

    /// The digest of all that can change a reply. How the limit is called does not; whether it is sent does.
    pub(super) fn digest(&self) -> Digest {
        let limit = self
            .max_tokens
            .filter(|_| self.token_field != TokenField::Omit);
        let words = [
            Some(self.model.clone()),
            self.temperature.map(|value| value.to_string()),
            limit.map(|value| value.to_string()),
            self.reasoning_effort.clone(),
            self.detail.map(|detail| detail.to_string()),
        ];
        let parts = words.map(|word| word.map_or(String::new(), |word| format!("={word}")));
        Digest::of_parts(parts.iter().map(String::as_bytes))
    }
}

/// The field in which a token limit is sent.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TokenField {
    /// `max_completion_tokens` at OpenAI itself, `max_tokens` elsewhere.
    Auto,
    /// `max_tokens`: what every other server understands.
    MaxTokens,
    /// `max_completion_tokens`: what reasoning models of OpenAI demand.
    MaxCompletionTokens,
    /// None: no limit is sent.
    Omit,
}

impl TokenField {
    const NAMES: [(Self, &str); 4] = [
        (Self::Auto, "auto"),
        (Self::MaxTokens, "max_tokens"),
        (Self::MaxCompletionTokens, "max_completion_tokens"),
        (Self::Omit, "none"),
    ];

    /// The field for an endpoint of this host: never `Auto`.
    pub(super) fn at(self, host: &str) -> Self {
        match self {
            Self::Auto if host == "api.openai.com" => Self::MaxCompletionTokens,
            Self::Auto => Self::MaxTokens,
            field => field,
        }
    }
}

impl fmt::Display for TokenField {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = Self::NAMES.iter().find(|(field, _)| field == self);
        f.pad(name.map_or("", |(_, name)| name))
    }
}

impl FromStr for TokenField {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let found = Self::NAMES.iter().find(|(_, name)| *name == text);
        found.map(|(field, _)| *field).ok_or_else(|| {
            Error::usage(
                "--token-field",
                format_args!("{text:?} is none of auto, max_tokens, max_completion_tokens, none"),
            )
        })
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

impl Detail {
    const NAMES: [(Self, &str); 3] = [
        (Self::Auto, "auto"),
        (Self::Low, "low"),
        (Self::High, "high"),
    ];
}

impl fmt::Display for Detail {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = Self::NAMES.iter().find(|(detail, _)| detail == self);
        f.pad(name.map_or("", |(_, name)| name))
    }
}

impl FromStr for Detail {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let found = Self::NAMES.iter().find(|(_, name)| *name == text);
        found.map(|(detail, _)| *detail).ok_or_else(|| {
            Error::usage(
                "--detail",
                format_args!("{text:?} is none of auto, low, high"),
            )
        })
    }
}

// The order of fields matters: the image must come last, see `IMAGE_TAIL`.
#[derive(Serialize)]
struct Request<'a> {
    model: &'a str,
    #[serde(skip_serializing_if = "Option::is_none")]
    temperature: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    max_tokens: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    max_completion_tokens: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    reasoning_effort: Option<&'a str>,
    messages: [Message<'a>; 1],
}

#[derive(Serialize)]
struct Message<'a> {
    role: &'static str,
    content: Content<'a>,
}

// Words alone go as a plain string, which text-only servers without a notion of parts take too.
#[derive(Serialize)]
#[serde(untagged)]
enum Content<'a> {
    Words(&'a str),
    Parts([Part<'a>; 2]),
}

#[derive(Serialize)]
#[serde(tag = "type", rename_all = "snake_case")]
enum Part<'a> {
    Text { text: &'a str },
    ImageUrl { image_url: ImageUrl },
}

#[derive(Serialize)]
struct ImageUrl {
    #[serde(skip_serializing_if = "Option::is_none")]
    detail: Option<Detail>,
    url: &'static str,
}

/// The end of every request with an image, behind the data URL. The image is the last value of the last part of the last message
/// of the last field, so the place for it lies at a fixed distance from the end, whatever the question says: nothing
/// is searched for, and no question can contain the mark.
const IMAGE_TAIL: &[u8] = br#""}}]}]}"#;

/// The body of one request: the text first, the image (where there is one) second, its bytes shared and not copied.
pub(super) fn body(
    parameters: &Parameters,
    field: TokenField,
    prompt: &str,
    image: Option<&Payload>,
) -> Result<Parts, serde_json::Error> {
    let limit = |name| parameters.max_tokens.filter(|_| field == name);
    let content = match image {
        None => Content::Words(prompt),
        Some(_) => Content::Parts([
            Part::Text { text: prompt },
            Part::ImageUrl {
                image_url: ImageUrl {
                    detail: parameters.detail,
                    url: "",
                },
            },
        ]),
    };
    let mut json = serde_json::to_vec(&Request {
        model: &parameters.model,
        temperature: parameters.temperature,
        max_tokens: limit(TokenField::MaxTokens),
        max_completion_tokens: limit(TokenField::MaxCompletionTokens),
        reasoning_effort: parameters.reasoning_effort.as_deref(),
        messages: [Message {
            role: "user",
            content,
        }],
    })?;
    let Some(image) = image else {
        return Ok(Parts::new([json.into(), Bytes::new(), Bytes::new()]));
    };
    debug_assert!(json.ends_with(IMAGE_TAIL));
    json.truncate(json.len().saturating_sub(IMAGE_TAIL.len()));
    Ok(Parts::new([
        json.into(),
        image.data_url(),
        Bytes::from_static(IMAGE_TAIL),
    ]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_read_back() {
        for (field, name) in TokenField::NAMES {
            assert_eq!(name.parse::<TokenField>().unwrap(), field);
            assert_eq!(field.to_string(), name);
        }
        for (detail, name) in Detail::NAMES {
            assert_eq!(name.parse::<Detail>().unwrap(), detail);
        }
        assert!("max".parse::<TokenField>().is_err());
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
    fn the_digest_knows_what_decides_a_reply() {
        let base = Parameters::new("m".into());
        let mut others = vec![base.clone(); 5];
        others[0].model = "n".into();
        others[1].temperature = None;
        others[2].token_field = TokenField::Omit;
        others[3].reasoning_effort = Some(String::new());
        others[4].detail = Some(Detail::High);
        for other in &others {
            assert_ne!(other.digest(), base.digest(), "{other:?}");
        }
        let renamed = Parameters {
            token_field: TokenField::MaxTokens,
            ..base.clone()
        };
        assert_eq!(renamed.digest(), base.digest());
    }
}
