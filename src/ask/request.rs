//! What is said to an endpoint: the JSON of one request, [`body`].

use serde::Serialize;
use serde_json::{Value, json};

use super::Message;
use super::body::Parts;
use super::parameters::{Constrain, Detail, Parameters, Temperature, TokenField};
use crate::types::question::letter;

/// Which of the fields that servers quarrel about a request has; found out once for a whole run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Fields {
    /// The name of the token limit, never `Auto`.
    pub(super) token_field: TokenField,
    /// The temperature, where one is sent.
    pub(super) temperature: Option<f64>,
}

impl Fields {
    /// What is tried first at a host.
    pub(super) fn first(parameters: &Parameters, host: &str) -> Self {
        Self {
            token_field: parameters.token_field.at(host),
            temperature: match parameters.temperature {
                Temperature::Auto => Some(0.0),
                Temperature::Server => None,
                Temperature::Of(value) => Some(value),
            },
        }
    }
}

/// What one request asks.
#[derive(Debug, Clone, Copy)]
pub(super) struct Asked<'a> {
    /// The words and images.
    pub(super) message: Message<'a>,
    /// How many choices they offer; 0 where the answer is open.
    pub(super) choices: usize,
}

#[derive(Serialize)]
struct Request<'a> {
    model: &'a str,
    #[serde(skip_serializing_if = "Option::is_none")]
    temperature: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    seed: Option<u64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    max_tokens: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    max_completion_tokens: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    reasoning_effort: Option<&'a str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    response_format: Option<Value>,
    #[serde(skip_serializing_if = "Option::is_none")]
    structured_outputs: Option<Value>,
    messages: [Turn<'a>; 1],
}

#[derive(Serialize)]
struct Turn<'a> {
    role: &'static str,
    content: Content<'a>,
}

// Words alone go as a plain string, which text-only servers without a notion of parts take too.
#[derive(Serialize)]
#[serde(untagged)]
enum Content<'a> {
    Words(&'a str),
    Parts(Vec<Part<'a>>),
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

/// Where an image goes: a field without a value. No question can contain it, whatever it says: within a text every quotation
/// mark has a backslash before it.
const PLACE: &str = r#""url":"""#;

/// The field of the object that `--constrain json` asks for.
const ANSWER: &str = "answer";

/// The body of one request: words, images, and the words behind them, the images' bytes shared and not copied.
pub(super) fn body(
    parameters: &Parameters,
    fields: Fields,
    asked: Asked<'_>,
) -> Result<Parts, serde_json::Error> {
    let Asked { message, choices } = asked;
    let limit = |name| parameters.max_tokens.filter(|_| fields.token_field == name);
    let letters: Vec<char> = (0..choices).map(letter).collect();
    let constrained =
        |kind, value: fn(&[char]) -> Value| (parameters.constrain == kind).then(|| value(&letters));
    let json = serde_json::to_string(&Request {
        model: &parameters.model,
        temperature: fields.temperature,
        seed: parameters.seed,
        max_tokens: limit(TokenField::MaxTokens),
        max_completion_tokens: limit(TokenField::MaxCompletionTokens),
        reasoning_effort: parameters.reasoning_effort.as_deref(),
        response_format: constrained(Constrain::Json, schema),
        structured_outputs: constrained(Constrain::Choice, |letters| json!({"choice": letters})),
        messages: [Turn {
            role: "user",
            content: content(message, parameters.detail),
        }],
    })?;
    if message.images.is_empty() {
        return Ok(Parts::new([json.into()]));
    }
    debug_assert_eq!(json.matches(PLACE).count(), message.images.len());
    let (open, close) = PLACE.split_at(PLACE.len() - 1);
    let mut pieces = Vec::with_capacity(2 * message.images.len() + 1);
    let mut begin = "";
    let mut images = message.images.iter();
    for words in json.split(PLACE) {
        match images.next() {
            Some(image) => {
                pieces.push([begin, words, open].concat().into());
                pieces.push(image.data_url());
            }
            None => pieces.push([begin, words].concat().into()),
        }
        begin = close;
    }
    Ok(Parts::new(pieces))
}

/// What a message holds, with a place for each image.
fn content(message: Message<'_>, detail: Option<Detail>) -> Content<'_> {
    let Message {
        before,
        images,
        behind,
    } = message;
    if images.is_empty() && behind.is_empty() {
        return Content::Words(before);
    }
    let words = |text| Part::Text { text };
    let image = || Part::ImageUrl {
        image_url: ImageUrl { detail, url: "" },
    };
    let parts = std::iter::once(words(before))
        .chain(images.iter().map(|_| image()))
        .chain((!behind.is_empty()).then(|| words(behind)));
    Content::Parts(parts.collect())
}

/// An object with one of the letters, as OpenAI's `json_schema` format.
fn schema(letters: &[char]) -> Value {
    json!({"type": "json_schema", "json_schema": {"name": ANSWER, "strict": true, "schema": {
        "type": "object", "additionalProperties": false, "required": [ANSWER],
        "properties": {ANSWER: {"type": "string", "enum": letters}},
    }}})
}

/// The letter in a reply that is what a constraint asked for; `None` where the server has not kept to it.
pub(super) fn constrained_letter(
    constrain: Constrain,
    choices: usize,
    reply: &str,
) -> Option<String> {
    let object: Option<Value> = match constrain {
        Constrain::Json => serde_json::from_str(reply).ok(),
        Constrain::None | Constrain::Choice => None,
    };
    let said = match &object {
        Some(object) if object.as_object()?.len() == 1 => object.get(ANSWER)?.as_str()?,
        Some(_) => return None,
        None => reply,
    };
    let mut letters = (0..choices).map(|index| letter(index).to_string());
    letters.find(|letter| letter == said.trim())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_constrained_reply_is_the_letter_in_it() {
        use Constrain::{Choice, Json};
        for (constrain, reply, letter) in [
            (Json, "{\"answer\": \"B\"}", Some("B")),
            (Json, " {\n\"answer\" : \"A\" }\n", Some("A")),
            (Json, "{\"answer\":\"C\"}", None),
            (Json, "{\"answer\":\"B", None),
            (Json, "{\"answer\":\"B\",\"why\":\"x\"}", None),
            (Json, "The answer is B", None),
            (Choice, "B", Some("B")),
            (Choice, " A\n", Some("A")),
            (Choice, "a", None),
            (Choice, "B. yes", None),
        ] {
            assert_eq!(
                constrained_letter(constrain, 2, reply).as_deref(),
                letter,
                "{reply}"
            );
        }
    }
}
