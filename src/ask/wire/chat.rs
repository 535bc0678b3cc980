//! Chat completions: the JSON of a request ([`body`]), with its images ([`with_images`]) and the [`fields`] that
//! servers may refuse; and the lenient parsing of replies ([`read`], [`parse_body`]), because servers differ.

use std::borrow::Cow;
use std::sync::Arc;

use serde::Serialize;
use serde_json::{Map, Value, json};

use super::finish_reason::{self, ReplyEnding};
use super::message_fields::{self, refusal_field, words};
use super::{logprobs, stream, usage};
use crate::bounded_json::parse;
use crate::failures::{ApiError, ReplyError, Unreadable, Wording, page_title};
use crate::requests::{
    AdaptableField, Constrain, FieldState, ImageDetail, Message, MessagePart, Parameters, RequestBody, RequestField,
    RequestFields, SentFields, Temperature, TokenField, field, images,
};
use crate::wire_kind::Wire;
use darkqa_base::types::questions::letter;
use darkqa_base::types::{Finish, Reply, Thought, TokenChances, Usage};
use darkqa_pictures::Payload;

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
    content: MessageContent<'a>,
}

/// Content of a message. Text without images is sent as a string, because text-only servers may not support parts.
#[derive(Serialize)]
#[serde(untagged)]
enum MessageContent<'a> {
    Text(&'a str),
    Parts(Vec<ContentPart<'a>>),
}

#[derive(Serialize)]
#[serde(tag = "type", rename_all = "snake_case")]
enum ContentPart<'a> {
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
    let system = parameters
        .extra
        .system
        .as_deref()
        .map(|text| ChatMessage { role: "system", content: MessageContent::Text(text) });
    let parts = message.parts();
    let question = ChatMessage { role: "user", content: content(&parts, parameters.detail) };
    let messages: Vec<ChatMessage<'_>> = system.into_iter().chain([question]).collect();
    let messages = serde_json::to_string(&messages)?;
    Ok(with_images(&head, "messages", &messages, IMAGE_PLACE, images(&parts)))
}

/// Content of a message, with a placeholder for each image.
fn content<'a>(parts: &[MessagePart<'a>], detail: Option<ImageDetail>) -> MessageContent<'a> {
    match parts {
        [] => MessageContent::Text(""),
        [MessagePart::Text(text)] => MessageContent::Text(text),
        parts => MessageContent::Parts(
            parts
                .iter()
                .map(|part| match part {
                    MessagePart::Text(text) => ContentPart::Text { text },
                    MessagePart::Image(_) => ContentPart::ImageUrl { image_url: ImageUrl { detail, url: "" } },
                })
                .collect(),
        ),
    }
}

/// OpenAI's `json_schema` format for an object with one of the letters.
fn response_format(letters: &[char]) -> Value {
    let schema = field::schema(letters);
    json!({"type": "json_schema", "json_schema": {"name": field::ANSWER, "strict": true, "schema": schema}})
}

/// Parses a response body; `latency_ms` and `attempts` remain zero.
///
/// Errors may be at the top level or in the choice, because gateways send both with status 200. Optional fields may be
/// missing, null or of another type; hidden reasoning is ignored. Invalid UTF-8 and unpaired surrogates become
/// replacement characters, because a small model at temperature 0 would send them again in each retry. An event stream
/// is accepted even if it was not requested.
pub(super) fn read(body: &[u8], content_type: &str) -> Result<Reply, ReplyError> {
    let completion = parse_reply(&text(body), content_type)?;
    // A completion may have a field "message", so only the field `error` counts there.
    let api_error = match completion.get("choices") {
        Some(Value::Array(choices)) if !choices.is_empty() => ApiError::in_error(&completion),
        Some(_) => ApiError::in_error(&completion).or_else(|| ApiError::in_structure(&completion)),
        None => ApiError::from_json(&completion),
    };
    if let Some(api_error) = api_error {
        return Err(ReplyError::Api(Box::new(api_error)));
    }
    let usage = usage::in_body(&completion);
    let unreadable = |description| Unreadable::new(description).with_usage(usage);
    let choice = first_choice(&completion).map_err(unreadable)?;
    if let Some(error) = choice.get("error").filter(|error| !error.is_null()) {
        return Err(ReplyError::Api(Box::new(ApiError::from_error(error))));
    }
    let reason = choice.get("finish_reason").and_then(Value::as_str);
    let ReplyEnding { finish, may_heal } = finish_reason::read(reason.unwrap_or_default(), usage)
        .map_err(|incomplete| error_in_text(choice).unwrap_or(ReplyError::Unreadable(incomplete)))?;
    let message = choice
        .get("message")
        .filter(|message| message.is_object())
        .ok_or_else(|| unreadable("a choice without a message"))?;
    let (text, refusal_part) = reply_content(message.get("content")).map_err(unreadable)?;
    let chances = logprobs::positions(choice.get("logprobs")).map(|positions| TokenChances {
        positions,
        thought: logprobs::thought(message, usage::raw(&completion), &text),
    });
    let refusal = refusal_field(message).map(str::to_owned).or(refusal_part);
    let has_thought = text.trim().is_empty()
        && refusal.is_none()
        && logprobs::thought(message, usage::raw(&completion), &text) == Thought::Before;
    let (text, other_field) = match refusal {
        None if text.trim().is_empty() => message_fields::of_message(text, message),
        _ => (text, None),
    };
    let is_empty = text.trim().is_empty() && refusal.is_none();
    if is_empty && !has_thought && other_field.is_none() && is_lost(&finish, usage) {
        return Err(unreadable(LOST).into());
    }
    // The answer after the thoughts may have been lost, or the model gave none.
    let may_heal = may_heal || (is_empty && has_thought && is_end(&finish));
    Ok(Reply {
        refusal,
        finish,
        usage,
        served_model: string_field(&completion, "model"),
        provider: string_field(&completion, "provider"),
        attempts: 0,
        chances,
        may_heal,
        other_field,
        ..Reply::local(text)
    })
}

/// Parses a completion from JSON or an event stream.
fn parse_reply(text: &str, content_type: &str) -> Result<Value, ReplyError> {
    if stream::is_stream(text, content_type) {
        return stream::assemble(text).map_err(|broken| {
            let description = "an event stream without a complete chat completion";
            Unreadable { usage: usage::alone(broken.usage), broke_off: broken.has_text, ..Unreadable::new(description) }
                .into()
        });
    }
    parse_body(text, content_type)
}

/// The choice with index 0, or the first one if none has that index.
fn first_choice(completion: &Value) -> Result<&Value, &'static str> {
    let choices = completion.get("choices").and_then(Value::as_array).ok_or("JSON without choices")?;
    choices
        .iter()
        .find(|choice| choice.get("index").and_then(Value::as_u64) == Some(0))
        .or(choices.first())
        .ok_or("a completion with no choices in it")
}

/// Error in the text of an incomplete reply, if its wording is known: LMDeploy sends errors in this way.
fn error_in_text(choice: &Value) -> Option<ReplyError> {
    let text = choice.pointer("/message/content")?.as_str()?;
    let api_error = ApiError::from_body(text);
    Wording::find(&api_error, true)?;
    Some(ReplyError::Api(Box::new(api_error)))
}

/// Text of a message, and the text of the refusals among its parts.
fn reply_content(content: Option<&Value>) -> Result<(String, Option<String>), &'static str> {
    let parts = match content {
        None | Some(Value::Null) => return Ok((String::new(), None)),
        Some(Value::String(text)) => return Ok((text.clone(), None)),
        Some(Value::Array(parts)) => parts,
        Some(_) => return Err("a message whose content is neither text nor parts"),
    };
    let (mut text, mut refusal) = (String::new(), String::new());
    for part in parts {
        match part.get("type").and_then(Value::as_str) {
            Some("text" | "output_text") => text += words(part, "text"),
            Some("refusal") => refusal += words(part, "refusal"),
            // A part without a type is a string, or has a field `text`.
            None => text += part.as_str().unwrap_or_else(|| words(part, "text")),
            Some(_) => {}
        }
    }
    Ok((text, (!refusal.is_empty()).then_some(refusal)))
}

/// Description of a lost reply.
const LOST: &str = "an empty reply for which it counts no token, so that it was lost";

/// True if a reply without content was lost in transit: the server calls it complete, but counts no tokens.
fn is_lost(finish: &Finish, usage: Option<Usage>) -> bool {
    let tokens = usage.map(|usage| usage.completion_tokens);
    is_end(finish) && matches!(tokens, Some(Some(0)))
}

/// True if the server calls a reply complete, or says nothing about its end.
pub(super) fn is_end(finish: &Finish) -> bool {
    matches!(finish, Finish::Stop | Finish::Unknown)
}

/// Remedy for a server without token probabilities.
pub(super) const OMIT_PROBABILITIES: &str = "leave --request probabilities out: the server states none";

/// Remedy for a server without a seed.
const OMIT_SEED: &str = "send no seed: --sampling-seed none, or leave seed out of the file of models";

/// Name of `top_logprobs` in the refusals of Text Generation Inference.
const TGI_TOP_LOGPROBS: &str = "top_n_tokens";

/// Fields that a server may refuse.
pub(super) fn fields(sent: SentFields<'_>) -> Vec<RequestField<'static>> {
    [sampling_fields(sent), format_fields(sent)].concat()
}

/// Fields that control sampling.
fn sampling_fields(sent: SentFields<'_>) -> Vec<RequestField<'static>> {
    let parameters = sent.parameters;
    let is_omitted = parameters.token_field == TokenField::Omit;
    let current = sent.fields.token_field;
    let limit_state = |field| FieldState::until_refused(current == field, is_omitted || current != TokenField::Omit);
    Vec::from([
        RequestField {
            name: "temperature",
            state: FieldState::until_refused(
                sent.fields.temperature.is_some(),
                parameters.temperature == Temperature::Server,
            ),
            adaptable: Some(AdaptableField::Temperature { least: None }),
            hint: "leave the temperature to the server: --temperature default",
        },
        RequestField {
            name: "top_p",
            state: FieldState::sent_if(parameters.top_p.is_some()),
            adaptable: None,
            hint: "leave --top-p out: the model takes no other than its own",
        },
        RequestField {
            name: "seed",
            state: FieldState::until_refused(sent.fields.seed.is_some(), parameters.seed.is_none()),
            adaptable: Some(AdaptableField::Seed),
            hint: OMIT_SEED,
        },
        RequestField {
            name: "max_tokens",
            state: limit_state(TokenField::MaxTokens),
            adaptable: Some(AdaptableField::TokenField),
            hint: "send the limit in another field: --request token-field=max_completion_tokens (or none), or another --max-tokens",
        },
        RequestField {
            name: "max_completion_tokens",
            state: limit_state(TokenField::MaxCompletionTokens),
            adaptable: Some(AdaptableField::TokenField),
            hint: "send the limit in another field: --request token-field=max_tokens (or none), or another --max-tokens",
        },
        RequestField {
            name: "reasoning_effort",
            state: FieldState::sent_if(sent.fields.effort(parameters).is_some()),
            adaptable: None,
            hint: "leave --reasoning-effort (or --thinking) out, or give a value the model takes",
        },
    ])
}

/// Fields that control the form of images and replies.
fn format_fields(sent: SentFields<'_>) -> Vec<RequestField<'static>> {
    let parameters = sent.parameters;
    Vec::from([
        RequestField {
            name: "detail",
            state: FieldState::sent_if(sent.has_image && parameters.detail.is_some()),
            adaptable: None,
            hint: "leave --image detail out, or give a value the server takes",
        },
        RequestField {
            name: "response_format",
            state: FieldState::sent_if(parameters.constrain == Constrain::Json),
            adaptable: None,
            hint: "leave --request constrain out: the server does not take it",
        },
        RequestField {
            name: "structured_outputs",
            state: FieldState::sent_if(parameters.constrain == Constrain::Choice),
            adaptable: None,
            hint: "leave --request constrain out, or try --request constrain=json",
        },
        RequestField {
            name: "logprobs",
            state: FieldState::until_refused(sent.fields.top_logprobs.is_some(), !parameters.probabilities),
            adaptable: Some(AdaptableField::Logprobs),
            hint: OMIT_PROBABILITIES,
        },
        RequestField {
            name: "top_logprobs",
            state: FieldState::sent_if(sent.fields.top_logprobs.is_some()),
            adaptable: Some(AdaptableField::TopLogprobs),
            hint: OMIT_PROBABILITIES,
        },
        RequestField {
            name: TGI_TOP_LOGPROBS,
            state: FieldState::sent_if(sent.fields.top_logprobs.is_some()),
            adaptable: Some(AdaptableField::TopLogprobs),
            hint: OMIT_PROBABILITIES,
        },
        RequestField {
            name: "stream_options",
            state: FieldState::until_refused(
                sent.fields.wire == Wire::ChatStream && sent.fields.stream_usage,
                sent.fields.stream_usage,
            ),
            adaptable: Some(AdaptableField::StreamUsage),
            hint: "ask without a stream: --request wire=chat",
        },
    ])
}

/// Builds a request body from the JSON object `fields` and one more field with the value `json`, in which each `place`
/// is replaced by the data URL of an image. The bytes of the images are shared, not copied.
///
/// A place is a field with an empty value, such as `"url":""`. The text of a question cannot contain one, because JSON
/// escapes every quotation mark. `fields` is not searched for places, because it may contain fields of the user.
pub(super) fn with_images<'a>(
    fields: &str,
    name: &str,
    json: &str,
    place: &str,
    mut images: impl Iterator<Item = &'a Arc<Payload>> + Clone,
) -> RequestBody {
    let fields = fields.strip_suffix('}').unwrap_or(fields);
    let head = format!("{fields},\"{name}\":");
    let json = format!("{json}}}");
    let count = images.clone().count();
    if count == 0 {
        return RequestBody::new([(head + &json).into()]);
    }
    debug_assert_eq!(json.matches(place).count(), count);
    let (open, close) = place.split_at(place.len() - 1);
    let mut chunks = Vec::with_capacity(2 * count + 1);
    let mut start = head.as_str();
    for text in json.split(place) {
        match images.next() {
            Some(image) => {
                chunks.push([start, text, open].concat().into());
                chunks.push(image.data_url());
            }
            None => chunks.push([start, text].concat().into()),
        }
        start = close;
    }
    RequestBody::new(chunks)
}

/// Decodes a body as UTF-8 without a byte order mark; invalid bytes become replacement characters.
pub(super) fn text(body: &[u8]) -> Cow<'_, str> {
    match String::from_utf8_lossy(body) {
        Cow::Borrowed(text) => text.trim_start_matches('\u{FEFF}').into(),
        Cow::Owned(text) => text.trim_start_matches('\u{FEFF}').to_owned().into(),
    }
}

/// Parses the JSON of a body.
pub(super) fn parse_body(text: &str, content_type: &str) -> Result<Value, ReplyError> {
    parse(text).map_err(|error| unreadable(text, content_type, &error).into())
}

/// String in a field of an object; `None` if the field is missing or of another type.
pub(super) fn string_field(object: &Value, field: &str) -> Option<String> {
    object.get(field)?.as_str().map(str::to_owned)
}

/// Describes a body that is not JSON.
fn unreadable(text: &str, content_type: &str, error: &serde_json::Error) -> Unreadable {
    if text.trim().is_empty() {
        return Unreadable::new("an empty body");
    }
    let description =
        page_title(text).unwrap_or_else(|| format!("{content_type:?} that is not complete JSON ({error}): {text}"));
    Unreadable::new(description)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn json(body: &str) -> Result<Reply, ReplyError> {
        read(body.as_bytes(), "application/json")
    }

    fn message(message: &str) -> Reply {
        json(&format!(r#"{{"choices":[{{"message":{message}}}]}}"#)).unwrap()
    }

    #[test]
    fn contents_of_every_shape_are_parsed() {
        for (content, text) in [
            (r#"{"content":"B"}"#, "B"),
            (r#"{"content":null}"#, ""),
            (r#"{"role":"assistant"}"#, ""),
            (r#"{"content":"","reasoning_content":"A","reasoning":"A"}"#, ""),
            (
                r#"{"content":[{"type":"thinking","thinking":[{"type":"text","text":"A"}]},{"type":"text","text":"B"},{"type":"text","text":"."},7,null,{"type":"text","text":null}]}"#,
                "B.",
            ),
            (r#"{"content":["B",{"text":"."}]}"#, "B."),
            (r#"{"content":[]}"#, ""),
        ] {
            assert_eq!(message(content).text, text, "{content}");
        }
        let refusal = message(r#"{"content":null,"refusal":"I cannot see"}"#);
        assert_eq!(refusal.refusal.as_deref(), Some("I cannot see"));
        let part = message(r#"{"content":[{"type":"refusal","refusal":"no"}],"refusal":""}"#);
        assert_eq!((part.text.as_str(), part.refusal.as_deref()), ("", Some("no")));
        assert!(json(r#"{"choices":[{"message":{"content":{"a":1}}}]}"#).is_err());
    }

    #[test]
    fn answers_in_other_fields_are_found() {
        let call = |arguments: &str| {
            let call = serde_json::json!({"id": "c", "type": "function", "function": {"name": "reply", "arguments": arguments}});
            message(&serde_json::json!({"content": null, "tool_calls": [call]}).to_string())
        };
        let reply = call(r#"{"answer": "B", "why": "a bed"}"#);
        assert_eq!(reply.text, "B");
        assert_eq!(reply.other_field.unwrap().name, "tool_calls (answer, reply)");
        assert_eq!(call(r#"{"mark": 4}"#).text, "4");
        for arguments in [r#"{"query": "kitchen"}"#, r#"{"answer": "A", "choice": "B"}"#, "not JSON"] {
            let reply = call(arguments);
            assert_eq!(reply.text, "", "{arguments}");
            assert_eq!(reply.other_field.unwrap().text, arguments);
        }
        for (field, value) in [
            ("reasoning_content", r#""A""#),
            ("reasoning", r#""A""#),
            ("thoughts_of_zork", r#""A""#),
            ("reasoning_details", r#"[{"type": "reasoning.text", "text": "A"}]"#),
        ] {
            let reply = message(&format!(r#"{{"content":null,"{field}":{value}}}"#));
            let found = reply.other_field.unwrap();
            assert_eq!((&*found.name, &*found.text), (field, "A"));
            assert_eq!(reply.text, "", "the thoughts are no text");
            let beside = message(&format!(r#"{{"content":"B","{field}":{value}}}"#));
            assert_eq!((beside.text.as_str(), beside.other_field), ("B", None));
        }
        assert_eq!(message(r#"{"role":"assistant","content":""}"#).other_field, None);
    }

    #[test]
    fn refusals_in_fields_of_the_provider_are_found() {
        for field in ["provider_specific_fields", "additional_kwargs"] {
            let body = format!(r#"{{"content":null,"refusal":null,"{field}":{{"refusal":"no"}}}}"#);
            assert_eq!(message(&body).refusal.as_deref(), Some("no"), "{field}");
            let delta = format!(
                "data: {{\"choices\":[{{\"delta\":{{\"{field}\":{{\"refusal\":\"no\"}}}},\"finish_reason\":\"stop\"}}]}}\n\n"
            );
            let streamed = read(delta.as_bytes(), "text/event-stream").unwrap();
            assert_eq!(streamed.refusal.as_deref(), Some("no"), "{field}");
        }
        for field in [r#"{"refusal":null}"#, r#"{"refusal":""}"#, r#"{"a":"no"}"#, "7"] {
            let body = format!(r#"{{"content":"B","provider_specific_fields":{field}}}"#);
            assert_eq!(message(&body).refusal, None, "{field}");
        }
    }

    #[test]
    fn the_choice_with_index_zero_is_used() {
        let two = r#"{"choices":[{"index":1,"message":{"content":"A"}},{"index":0,"message":{"content":"B"}}]}"#;
        assert_eq!(json(two).unwrap().text, "B");
        let odd = r#"{"choices":[{"index":1,"message":{"content":"A"}},{"index":2,"message":{"content":"B"}}]}"#;
        assert_eq!(json(odd).unwrap().text, "A");
    }

    #[test]
    fn optional_fields_are_parsed() {
        let whole = "\n\n \r\n{\"model\":\"m-1\",\"choices\":[{\"finish_reason\":\"length\",\"message\":{\"content\":\"\"}}],\"usage\":{\"prompt_tokens\":9,\"completion_tokens\":\"many\"},\"timings\":{}}";
        let reply = json(whole).unwrap();
        assert_eq!(reply.finish, Finish::Length);
        assert_eq!(reply.served_model.as_deref(), Some("m-1"));
        assert_eq!(reply.usage.unwrap().prompt_tokens, Some(9));
        assert_eq!(reply.usage.unwrap().cached_tokens, None);
        let cached =
            whole.replace("\"prompt_tokens\":9", "\"prompt_tokens\":9,\"prompt_tokens_details\":{\"cached_tokens\":5}");
        assert_eq!(json(&cached).unwrap().usage.unwrap().cached_tokens, Some(5));
        let anthropic = whole.replace("\"prompt_tokens\":9", "\"prompt_tokens\":9,\"cache_read_input_tokens\":6");
        let usage = json(&anthropic).unwrap().usage.unwrap();
        assert_eq!(usage.cached_tokens, Some(6));
        assert_eq!(reply.usage.unwrap().completion_tokens, None);
        let bare = r#"{"model":7,"choices":[{"finish_reason":null,"message":{"content":"B"}}],"usage":null}"#;
        let reply = json(bare).unwrap();
        assert_eq!((reply.finish, reply.usage, reply.served_model), (Finish::Unknown, None, None));
        for (reason, finish) in [
            ("STOP", Finish::Stop),
            ("MAX_TOKENS", Finish::Length),
            ("content_filter", Finish::Filter),
            ("refusal", Finish::Filter),
        ] {
            assert_eq!(finish_reason::read(reason, None).unwrap().finish, finish);
        }
    }

    #[test]
    fn errors_with_a_success_status_are_found() {
        for body in [
            r#"{"error":{"message":"m","code":502},"choices":[{"message":{"content":"B"}}]}"#,
            r#"{"error":"m"}"#,
            r#"{"choices":[{"error":{"message":"m"},"message":{"content":"B"}}]}"#,
        ] {
            let Err(ReplyError::Api(api_error)) = json(body) else {
                panic!("{body}");
            };
            assert_eq!(api_error.message, "m");
        }
    }

    fn incomplete_reply(text: &str) -> String {
        format!(r#"{{"choices":[{{"finish_reason":"error","message":{{"content":"{text}"}}}}]}}"#)
    }

    #[test]
    fn errors_in_the_text_of_incomplete_replies_are_found() {
        let text = "internal error happened, status code ResponseType.INPUT_LENGTH_ERROR";
        let Err(ReplyError::Api(api_error)) = json(&incomplete_reply(text)) else {
            panic!("no API error");
        };
        assert_eq!(api_error.message, text);
        let other = json(&incomplete_reply("The answer is"));
        assert!(matches!(other, Err(ReplyError::Unreadable(_))));
    }

    #[test]
    fn other_bodies_are_described() {
        let deep = "[".repeat(1000);
        for (body, content_type, expected) in [
            ("", "application/json", "empty"),
            ("{\"choices\":[", "application/json", "not complete JSON"),
            ("{\"choices\":null}", "application/json", "without choices"),
            ("{\"choices\":null,\"message\":\"x\"}", "application/json", "without choices"),
            ("{\"choices\":[]}", "application/json", "no choices"),
            ("{\"choices\":[null]}", "application/json", "without a message"),
            (
                "{\"choices\":[{\"finish_reason\":\"error\",\"message\":{\"content\":\"B\"}}]}",
                "application/json",
                "broke off",
            ),
            ("[]", "application/json", "without choices"),
            ("data: {}\n\n", "text/plain", "event stream"),
            (": ping", "text/event-stream; charset=utf-8", "event stream"),
            ("<html><title>Welcome</title>", "text/html", "Welcome"),
            (&deep, "application/json", "not complete JSON"),
        ] {
            let Err(ReplyError::Unreadable(found)) = read(body.as_bytes(), content_type) else {
                panic!("{body}");
            };
            assert!(found.description.contains(expected), "{found:?}");
        }
    }

    fn reply_body(content: &str, finish: &str, usage: &str) -> String {
        format!(
            r#"{{"choices":[{{"finish_reason":"{finish}","message":{{"content":{content},"refusal":null}}}}],"usage":{usage}}}"#
        )
    }

    #[test]
    fn empty_replies_without_tokens_are_lost() {
        let none = r#"{"prompt_tokens":0,"completion_tokens":0}"#;
        for usage in [none, r#"{"prompt_tokens":300,"completion_tokens":0}"#] {
            for content in ["null", "\"\"", "[]"] {
                let Err(ReplyError::Unreadable(lost)) = json(&reply_body(content, "stop", usage)) else {
                    panic!("{content} {usage}");
                };
                assert!(lost.description.contains("lost"));
            }
        }
        let ended = r#"{"prompt_tokens":300,"completion_tokens":1}"#;
        assert!(json(&reply_body("null", "stop", ended)).is_ok(), "the model returned no text");
        assert!(json(&reply_body("null", "length", none)).is_ok());
        assert!(json(&reply_body("\"B\"", "stop", none)).is_ok());
    }

    #[test]
    fn thoughts_without_an_answer_may_heal() {
        let thought = |content: &str, reasoning: &str, finish: &str, reasoning_tokens: u32| {
            json(&format!(
                r#"{{"choices":[{{"finish_reason":"{finish}","message":{{"content":"{content}","reasoning_content":"{reasoning}"}}}}],"usage":{{"completion_tokens":9,"completion_tokens_details":{{"reasoning_tokens":{reasoning_tokens}}}}}}}"#
            ))
            .unwrap()
        };
        assert!(thought("", "A? B?", "stop", 0).may_heal);
        assert!(thought(" ", "", "stop", 7).may_heal);
        assert!(!thought("B", "A? B?", "stop", 7).may_heal);
        assert!(!thought("", "A? B?", "length", 7).may_heal);
        assert!(!thought("", "", "stop", 0).may_heal);
        assert!(thought("", "", "zeitgeist", 0).may_heal);
    }

    #[test]
    fn bodies_without_a_reply_have_usage() {
        let usage = r#""usage":{"prompt_tokens":300,"completion_tokens":1024}"#;
        for body in [
            format!(r#"{{"choices":[],{usage}}}"#),
            format!(r#"{{"choices":[{{"finish_reason":"abort","message":{{"content":"A"}}}}],{usage}}}"#),
            format!("data: {{\"choices\":[],{usage}}}\n\ndata: [DONE]\n\n"),
        ] {
            let Err(ReplyError::Unreadable(found)) = json(&body) else {
                panic!("{body}");
            };
            assert_eq!(found.usage.and_then(|usage| usage.total()), Some(1324), "{body}");
        }
    }

    #[test]
    fn invalid_utf8_is_replaced() {
        let body = b"\xef\xbb\xbf{\"choices\":[{\"message\":{\"content\":\"B \xff\xfe\"}}]}";
        assert_eq!(read(body, "").unwrap().text, "B \u{FFFD}\u{FFFD}");
        assert_eq!(message(r#"{"content":"B \ud83d"}"#).text, "B \u{FFFD}");
        let stream = "data: {\"choices\":[{\"delta\":{\"content\":\"B\"},\"finish_reason\":\"stop\"}]}\n\n";
        let reply = read(stream.as_bytes(), "text/event-stream").unwrap();
        assert_eq!((reply.text.as_str(), reply.finish), ("B", Finish::Stop));
    }
}
