//! Requests of OpenAI's chat completions: the JSON [`body`], and the [`fields`] that servers may refuse.

use std::sync::Arc;

use serde::Serialize;
use serde_json::{Value, json};

use crate::ask::body::Parts;
use crate::ask::call::Message;
use crate::ask::constraint;
use crate::ask::field::{AdaptableField, RequestField, RequestFields, SentFields};
use crate::ask::parameters::{Constrain, ImageDetail, Parameters, TokenField};
use crate::ask::payload::Payload;
use crate::types::question::letter;

/// The body of a request without its messages, which stand at its end.
#[derive(Serialize)]
struct ChatRequest<'a> {
    model: &'a str,
    #[serde(skip_serializing_if = "Option::is_none")]
    temperature: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    top_p: Option<f64>,
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
}

#[derive(Serialize)]
struct Turn<'a> {
    role: &'static str,
    content: Content<'a>,
}

// Text without images is sent as a plain string: text-only servers may not support parts.
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
    detail: Option<ImageDetail>,
    url: &'static str,
}

/// The place of an image: a field with an empty value. No question can contain it, because in a JSON text every quotation mark
/// has a backslash before it.
const PLACE: &str = r#""url":"""#;

/// The body of one request: text, images, and the text after them.
pub(super) fn body(
    parameters: &Parameters,
    fields: RequestFields,
    message: Message<'_>,
    choices: usize,
) -> Result<Parts, serde_json::Error> {
    let limit = |name| parameters.limit().filter(|_| fields.token_field == name);
    let letters: Vec<char> = (0..choices).map(letter).collect();
    let constrained =
        |kind, value: fn(&[char]) -> Value| (parameters.constrain == kind).then(|| value(&letters));
    let fields = serde_json::to_string(&ChatRequest {
        model: &parameters.model,
        temperature: fields.temperature,
        top_p: parameters.top_p,
        seed: parameters.seed,
        max_tokens: limit(TokenField::MaxTokens),
        max_completion_tokens: limit(TokenField::MaxCompletionTokens),
        reasoning_effort: parameters.reasoning_effort.as_deref(),
        response_format: constrained(Constrain::Json, format),
        structured_outputs: constrained(Constrain::Choice, |letters| json!({"choice": letters})),
    })?;
    let fields = parameters.extra.apply(fields)?;
    let system = parameters.extra.system.as_deref().map(|words| Turn {
        role: "system",
        content: Content::Words(words),
    });
    let question = Turn {
        role: "user",
        content: content(message, parameters.detail),
    };
    let messages: Vec<Turn<'_>> = system.into_iter().chain([question]).collect();
    let fields = fields.strip_suffix('}').unwrap_or(&fields);
    let head = format!("{fields},\"messages\":");
    let messages = serde_json::to_string(&messages)? + "}";
    Ok(with_images(head, &messages, message.images))
}

/// A body of these two texts with the images in their places in the second; their bytes are shared, not copied.
fn with_images(head: String, json: &str, images: &[Arc<Payload>]) -> Parts {
    if images.is_empty() {
        return Parts::new([(head + json).into()]);
    }
    debug_assert_eq!(json.matches(PLACE).count(), images.len());
    let (open, close) = PLACE.split_at(PLACE.len() - 1);
    let mut pieces = Vec::with_capacity(2 * images.len() + 1);
    let mut begin = &*head;
    let mut images = images.iter();
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
    Parts::new(pieces)
}

/// The content of a message, with a place for each image.
fn content(message: Message<'_>, detail: Option<ImageDetail>) -> Content<'_> {
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

/// OpenAI's `json_schema` format for an object with one of the letters.
fn format(letters: &[char]) -> Value {
    let schema = constraint::schema(letters);
    json!({"type": "json_schema", "json_schema": {"name": constraint::ANSWER, "strict": true, "schema": schema}})
}

/// The fields that a server may refuse.
pub(super) fn fields(sent: SentFields<'_>) -> Vec<RequestField<'_>> {
    let parameters = sent.parameters;
    let limit = |field| sent.fields.token_field == field;
    let own = parameters.extra.names().map(|name| RequestField {
        name,
        sent: true,
        adaptable: None,
        hint: "leave this field out of --extra-body, or give a value that the server takes",
    });
    let system = RequestField {
        name: "system",
        sent: parameters.extra.system.is_some(),
        adaptable: None,
        hint: "leave --system out: the model takes no system message",
    };
    let mut fields = Vec::from([
        RequestField {
            name: "temperature",
            sent: sent.fields.temperature.is_some(),
            adaptable: Some(AdaptableField::Temperature),
            hint: "leave the temperature to the server: --temperature default",
        },
        RequestField {
            name: "top_p",
            sent: parameters.top_p.is_some(),
            adaptable: None,
            hint: "leave --top-p out: the model takes no other than its own",
        },
        RequestField {
            name: "max_tokens",
            sent: limit(TokenField::MaxTokens),
            adaptable: Some(AdaptableField::TokenField),
            hint: "send the limit otherwise: --token-field max_completion_tokens (or none), or another --max-tokens",
        },
        RequestField {
            name: "max_completion_tokens",
            sent: limit(TokenField::MaxCompletionTokens),
            adaptable: Some(AdaptableField::TokenField),
            hint: "send the limit otherwise: --token-field max_tokens (or none), or another --max-tokens",
        },
        RequestField {
            name: "reasoning_effort",
            sent: parameters.reasoning_effort.is_some(),
            adaptable: None,
            hint: "leave --reasoning-effort out, or give a value the model takes",
        },
        RequestField {
            name: "detail",
            sent: sent.has_image && parameters.detail.is_some(),
            adaptable: None,
            hint: "leave --detail out, or give a value the server takes",
        },
        RequestField {
            name: "response_format",
            sent: parameters.constrain == Constrain::Json,
            adaptable: None,
            hint: "leave --constrain out: the server does not take it",
        },
        RequestField {
            name: "structured_outputs",
            sent: parameters.constrain == Constrain::Choice,
            adaptable: None,
            hint: "leave --constrain out, or try --constrain json",
        },
    ]);
    // A field that is left out is not the cause.
    fields.retain(|field| !parameters.extra.omit.iter().any(|name| name == field.name));
    fields.push(system);
    fields.extend(own);
    fields
}
