//! Requests for chat completions: [`body`].

use serde::Serialize;
use serde_json::{Map, Value, json};

use super::image_places::with_images;
use crate::ask::requests::{
    Constrain, ImageDetail, Message, MessagePart, Parameters, RequestBody, RequestFields, TokenField, constraint,
    images,
};
use crate::ask::wire_kind::Wire;
use crate::types::questions::letter;

/// Body of a request without its messages, which are appended.
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
    thinking: Option<&'a Map<String, Value>>,
}

#[derive(Serialize)]
struct ChatMessage<'a> {
    role: &'static str,
    content: Content<'a>,
}

/// Content of a message. Text without images is sent as a string, because text-only servers may not support parts.
#[derive(Serialize)]
#[serde(untagged)]
enum Content<'a> {
    Text(&'a str),
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

/// Placeholder of an image URL in the JSON.
const IMAGE_PLACE: &str = r#""url":"""#;

/// Writes the body of one request.
pub(super) fn body(
    parameters: &Parameters,
    fields: RequestFields,
    message: Message<'_>,
    choices: usize,
) -> Result<RequestBody, serde_json::Error> {
    let limit_in = |field| parameters.limit().filter(|_| fields.token_field == field);
    let is_stream = fields.wire == Wire::ChatStream;
    let letters: Vec<char> = (0..choices).map(letter).collect();
    let constrain = parameters.constrain;
    let head = serde_json::to_string(&ChatRequest {
        model: &parameters.model,
        temperature: fields.temperature,
        top_p: parameters.top_p,
        seed: fields.seed,
        max_tokens: limit_in(TokenField::MaxTokens),
        max_completion_tokens: limit_in(TokenField::MaxCompletionTokens),
        reasoning_effort: fields.effort(parameters),
        response_format: (constrain == Constrain::Json).then(|| response_format(&letters)),
        structured_outputs: (constrain == Constrain::Choice).then(|| json!({"choice": letters})),
        logprobs: fields.top_logprobs.map(|_| true),
        top_logprobs: fields.top_logprobs,
        stream: is_stream.then_some(true),
        stream_options: (is_stream && fields.stream_usage).then(|| json!({"include_usage": true})),
        thinking: fields.thinking_body(),
    })?;
    let head = parameters.extra.apply(head)?;
    let system =
        parameters.extra.system.as_deref().map(|text| ChatMessage { role: "system", content: Content::Text(text) });
    let parts = message.parts();
    let question = ChatMessage { role: "user", content: content(&parts, parameters.detail) };
    let messages: Vec<ChatMessage<'_>> = system.into_iter().chain([question]).collect();
    let messages = serde_json::to_string(&messages)?;
    Ok(with_images(&head, "messages", &messages, IMAGE_PLACE, images(&parts)))
}

/// Content of a message, with a placeholder for each image.
fn content<'a>(parts: &[MessagePart<'a>], detail: Option<ImageDetail>) -> Content<'a> {
    match parts {
        [] => Content::Text(""),
        [MessagePart::Text(text)] => Content::Text(text),
        parts => Content::Parts(
            parts
                .iter()
                .map(|part| match part {
                    MessagePart::Text(text) => Part::Text { text },
                    MessagePart::Image(_) => Part::ImageUrl { image_url: ImageUrl { detail, url: "" } },
                })
                .collect(),
        ),
    }
}

/// OpenAI's `json_schema` format for an object with one of the letters.
fn response_format(letters: &[char]) -> Value {
    let schema = constraint::schema(letters);
    json!({"type": "json_schema", "json_schema": {"name": constraint::ANSWER, "strict": true, "schema": schema}})
}
