//! Requests of OpenAI's chat completions: the JSON [`body`].

use serde::Serialize;
use serde_json::{Map, Value, json};

use super::image_places::with_images;
use crate::ask::requests::{
    Constrain, ImageDetail, Message, MessagePart, Parameters, Parts, RequestFields, TokenField,
    constraint, images,
};
use crate::ask::wire_kind::Wire;
use crate::types::questions::letter;

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
    #[serde(skip_serializing_if = "Option::is_none")]
    logprobs: Option<bool>,
    #[serde(skip_serializing_if = "Option::is_none")]
    top_logprobs: Option<u8>,
    #[serde(skip_serializing_if = "Option::is_none")]
    stream: Option<bool>,
    #[serde(skip_serializing_if = "Option::is_none")]
    stream_options: Option<Value>,
    #[serde(flatten)]
    switch: Option<&'a Map<String, Value>>,
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

/// The place of an image.
const PLACE: &str = r#""url":"""#;

/// The body of one request: text, images, and the text after them.
pub(super) fn body(
    parameters: &Parameters,
    fields: RequestFields,
    message: Message<'_>,
    choices: usize,
) -> Result<Parts, serde_json::Error> {
    let limit = |name| parameters.limit().filter(|_| fields.token_field == name);
    let is_stream = fields.wire == Wire::ChatStream;
    let letters: Vec<char> = (0..choices).map(letter).collect();
    let constrained =
        |kind, value: fn(&[char]) -> Value| (parameters.constrain == kind).then(|| value(&letters));
    let head = serde_json::to_string(&ChatRequest {
        model: &parameters.model,
        temperature: fields.temperature,
        top_p: parameters.top_p,
        seed: parameters.seed,
        max_tokens: limit(TokenField::MaxTokens),
        max_completion_tokens: limit(TokenField::MaxCompletionTokens),
        reasoning_effort: fields.effort(parameters),
        response_format: constrained(Constrain::Json, format),
        structured_outputs: constrained(Constrain::Choice, |letters| json!({"choice": letters})),
        logprobs: fields.top_logprobs.map(|_| true),
        top_logprobs: fields.top_logprobs,
        stream: is_stream.then_some(true),
        stream_options: (is_stream && fields.stream_usage).then(|| json!({"include_usage": true})),
        switch: fields.switch(),
    })?;
    let head = parameters.extra.apply(head)?;
    let system = parameters.extra.system.as_deref().map(|words| Turn {
        role: "system",
        content: Content::Words(words),
    });
    let parts = message.parts();
    let question = Turn {
        role: "user",
        content: content(&parts, parameters.detail),
    };
    let messages: Vec<Turn<'_>> = system.into_iter().chain([question]).collect();
    let messages = serde_json::to_string(&messages)?;
    Ok(with_images(
        &head,
        "messages",
        &messages,
        PLACE,
        images(&parts),
    ))
}

/// The content of a message, with a place for each image.
fn content<'a>(parts: &[MessagePart<'a>], detail: Option<ImageDetail>) -> Content<'a> {
    match parts {
        [] => Content::Words(""),
        [MessagePart::Words(words)] => Content::Words(words),
        parts => {
            let parts = parts.iter().map(|part| match part {
                MessagePart::Words(text) => Part::Text { text },
                MessagePart::Image(_) => Part::ImageUrl {
                    image_url: ImageUrl { detail, url: "" },
                },
            });
            Content::Parts(parts.collect())
        }
    }
}

/// OpenAI's `json_schema` format for an object with one of the letters.
fn format(letters: &[char]) -> Value {
    let schema = constraint::schema(letters);
    json!({"type": "json_schema", "json_schema": {"name": constraint::ANSWER, "strict": true, "schema": schema}})
}
