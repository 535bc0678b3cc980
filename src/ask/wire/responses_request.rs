//! Requests to OpenAI's Responses API: the JSON [`body`], and the [`fields`] that servers may refuse.
//!
//! The form follows OpenAI's reference, `POST /responses`; `store` is false, so that the vendor does not store images.

use serde::Serialize;
use serde_json::{Map, Value, json};

use super::chat_fields::OMIT_PROBABILITIES;
use super::image_places::with_images;
use crate::ask::requests::{
    AdaptableField, Constrain, FieldState, ImageDetail, Message, MessagePart, Parameters, RequestBody, RequestField,
    RequestFields, SentFields, Temperature, TokenField, constraint, images,
};
use crate::types::questions::letter;

/// Body of a request without its input, which is appended.
#[derive(Serialize)]
struct ResponsesRequest<'a> {
    model: &'a str,
    store: bool,
    #[serde(skip_serializing_if = "Option::is_none")]
    temperature: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    top_p: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    seed: Option<u64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    max_output_tokens: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    reasoning: Option<Value>,
    #[serde(skip_serializing_if = "Option::is_none")]
    text: Option<Value>,
    #[serde(skip_serializing_if = "Option::is_none")]
    structured_outputs: Option<Value>,
    #[serde(skip_serializing_if = "Option::is_none")]
    include: Option<[&'static str; 1]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    top_logprobs: Option<u8>,
    #[serde(skip_serializing_if = "Option::is_none")]
    instructions: Option<&'a str>,
    #[serde(flatten)]
    thinking: Option<&'a Map<String, Value>>,
}

#[derive(Serialize)]
struct InputMessage<'a> {
    role: &'static str,
    content: Vec<Part<'a>>,
}

#[derive(Serialize)]
#[serde(tag = "type", rename_all = "snake_case")]
enum Part<'a> {
    InputText {
        text: &'a str,
    },
    InputImage {
        #[serde(skip_serializing_if = "Option::is_none")]
        detail: Option<ImageDetail>,
        image_url: &'static str,
    },
}

/// Placeholder of an image URL in the JSON.
const IMAGE_PLACE: &str = r#""image_url":"""#;

/// Writes the body of one request.
pub(super) fn body(
    parameters: &Parameters,
    fields: RequestFields,
    message: Message<'_>,
    choices: usize,
) -> Result<RequestBody, serde_json::Error> {
    let letters: Vec<char> = (0..choices).map(letter).collect();
    let constrain = parameters.constrain;
    let effort = fields.effort(parameters);
    let head = serde_json::to_string(&ResponsesRequest {
        model: &parameters.model,
        store: false,
        temperature: fields.temperature,
        top_p: parameters.top_p,
        seed: fields.seed,
        max_output_tokens: limit(parameters, fields),
        reasoning: effort.map(|effort| json!({"effort": effort})),
        text: (constrain == Constrain::Json).then(|| text_format(&letters)),
        structured_outputs: (constrain == Constrain::Choice).then(|| json!({"choice": letters})),
        include: fields.top_logprobs.map(|_| ["message.output_text.logprobs"]),
        top_logprobs: fields.top_logprobs,
        instructions: parameters.extra.system.as_deref(),
        thinking: fields.thinking_body(),
    })?;
    let head = parameters.extra.apply(head)?;
    let parts = message.parts();
    let input = serde_json::to_string(&[InputMessage { role: "user", content: content(&parts, parameters.detail) }])?;
    Ok(with_images(&head, "input", &input, IMAGE_PLACE, images(&parts)))
}

/// Token limit in a request; this API has only one name for it.
fn limit(parameters: &Parameters, fields: RequestFields) -> Option<u32> {
    parameters.limit().filter(|_| fields.token_field != TokenField::Omit)
}

/// Content of a message, with a placeholder for each image.
fn content<'a>(parts: &[MessagePart<'a>], detail: Option<ImageDetail>) -> Vec<Part<'a>> {
    if parts.is_empty() {
        return vec![Part::InputText { text: "" }];
    }
    parts
        .iter()
        .map(|part| match part {
            MessagePart::Text(text) => Part::InputText { text },
            MessagePart::Image(_) => Part::InputImage { detail, image_url: "" },
        })
        .collect()
}

/// JSON schema format for an object with one of the letters.
fn text_format(letters: &[char]) -> Value {
    let schema = constraint::schema(letters);
    json!({"format": {"type": "json_schema", "name": constraint::ANSWER, "strict": true, "schema": schema}})
}

/// Fields that a server may refuse.
pub(super) fn fields(sent: SentFields<'_>) -> Vec<RequestField<'static>> {
    let parameters = sent.parameters;
    let probabilities = FieldState::until_refused(sent.fields.top_logprobs.is_some(), !parameters.probabilities);
    Vec::from([
        field(
            "temperature",
            FieldState::until_refused(sent.fields.temperature.is_some(), parameters.temperature == Temperature::Server),
            Some(AdaptableField::Temperature { least: None }),
            "leave the temperature to the server: --temperature default",
        ),
        field(
            "top_p",
            FieldState::sent_if(parameters.top_p.is_some()),
            None,
            "leave --top-p out: the model takes no other than its own",
        ),
        field(
            "seed",
            FieldState::until_refused(sent.fields.seed.is_some(), parameters.seed.is_none()),
            Some(AdaptableField::Seed),
            "send no seed, which the Responses API lacks: --sampling-seed none, or leave seed out of the file of models",
        ),
        field(
            "max_output_tokens",
            FieldState::until_refused(
                limit(parameters, sent.fields).is_some(),
                parameters.token_field == TokenField::Omit,
            ),
            Some(AdaptableField::TokenField),
            "send no limit: --request token-field=none, or another --max-tokens",
        ),
        field("effort", FieldState::sent_if(sent.fields.effort(parameters).is_some()), None, OMIT_EFFORT),
        field("reasoning", FieldState::sent_if(sent.fields.effort(parameters).is_some()), None, OMIT_EFFORT),
        field(
            "detail",
            FieldState::sent_if(sent.has_image && parameters.detail.is_some()),
            None,
            "leave --image detail out, or give a value the server takes",
        ),
        field(
            "format",
            FieldState::sent_if(parameters.constrain == Constrain::Json),
            None,
            "leave --request constrain out: the server does not take it",
        ),
        field(
            "top_logprobs",
            FieldState::sent_if(sent.fields.top_logprobs.is_some()),
            Some(AdaptableField::TopLogprobs),
            OMIT_PROBABILITIES,
        ),
        field("logprobs", probabilities, Some(AdaptableField::Logprobs), OMIT_PROBABILITIES),
        field("include", probabilities, Some(AdaptableField::Logprobs), OMIT_PROBABILITIES),
        field(
            "structured_outputs",
            FieldState::sent_if(parameters.constrain == Constrain::Choice),
            None,
            "leave --request constrain out, or try --request constrain=json",
        ),
    ])
}

fn field(
    name: &'static str,
    state: FieldState,
    adaptable: Option<AdaptableField>,
    hint: &'static str,
) -> RequestField<'static> {
    RequestField { name, state, hint, adaptable }
}

/// Remedy for a reasoning effort that the model does not accept.
const OMIT_EFFORT: &str = "leave --reasoning-effort (or --thinking) out, or give a value the model takes";
