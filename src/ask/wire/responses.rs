//! OpenAI's Responses API: the JSON of a request ([`body`]), with the [`fields`] that servers may refuse, and the
//! lenient parsing of replies ([`read`]).
//!
//! The form follows OpenAI's reference, `POST /responses`; `store` is false, so that the vendor does not store images.

use serde::Serialize;
use serde_json::{Map, Value, json};

use super::chat::{self, OMIT_PROBABILITIES, is_end, with_images};
use super::finish_reason::{self, ReplyEnding};
use super::message_fields::{text_of, tool_call, words};
use super::{logprobs, stream, usage};
use crate::failures::{ApiError, ReplyError, Unreadable};
use crate::requests::{
    AdaptableField, Constrain, FieldState, ImageDetail, Message, MessagePart, Parameters, RequestBody, RequestField,
    RequestFields, SentFields, Temperature, TokenField, field, images,
};
use darkqa_base::types::questions::letter;
use darkqa_base::types::{Finish, OtherField, Reply, Thought, TokenChances, Usage};

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
    content: Vec<InputPart<'a>>,
}

#[derive(Serialize)]
#[serde(tag = "type", rename_all = "snake_case")]
enum InputPart<'a> {
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
fn content<'a>(parts: &[MessagePart<'a>], detail: Option<ImageDetail>) -> Vec<InputPart<'a>> {
    if parts.is_empty() {
        return vec![InputPart::InputText { text: "" }];
    }
    parts
        .iter()
        .map(|part| match part {
            MessagePart::Text(text) => InputPart::InputText { text },
            MessagePart::Image(_) => InputPart::InputImage { detail, image_url: "" },
        })
        .collect()
}

/// JSON schema format for an object with one of the letters.
fn text_format(letters: &[char]) -> Value {
    let schema = field::schema(letters);
    json!({"format": {"type": "json_schema", "name": field::ANSWER, "strict": true, "schema": schema}})
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

/// Parses a response body; `latency_ms` and `attempts` remain zero.
///
/// The text is the text of all parts of type `output_text` in items of type `message`; reasoning items are ignored, and
/// so are messages of another phase than the final answer. A failed response has an error; an incomplete response has a
/// reason, which becomes the finish reason.
pub(super) fn read(body: &[u8], content_type: &str) -> Result<Reply, ReplyError> {
    let text = chat::text(body);
    let response = if stream::is_stream(&text, content_type) {
        last_response(&text).ok_or_else(|| Unreadable::new("an event stream without a complete response"))?
    } else {
        chat::parse_body(&text, content_type)?
    };
    let api_error = match response.get("output") {
        Some(_) => ApiError::in_error(&response),
        None => ApiError::from_json(&response),
    };
    if let Some(api_error) = api_error {
        return Err(ReplyError::Api(Box::new(api_error)));
    }
    let usage = usage::in_body(&response);
    let ReplyEnding { finish, may_heal } = finish(&response, usage)?;
    let items = response
        .get("output")
        .and_then(Value::as_array)
        .ok_or_else(|| Unreadable::new("JSON without output").with_usage(usage))?;
    // Tokens without any item: the answer was lost in transit.
    let has_tokens = usage.is_some_and(|usage| usage.completion_tokens > Some(0));
    if items.is_empty() && finish == Finish::Stop && has_tokens {
        return Err(Unreadable::new("a response without an output").with_usage(usage).into());
    }
    let messages = answer_messages(items);
    let (text, refusal) = text_and_refusal(&messages);
    let chances = chances(&messages, items, &response, &text);
    let has_thought =
        has_summary(items) || logprobs::thought(&response, usage::raw(&response), &text) == Thought::Before;
    let (text, other_field) =
        if text.trim().is_empty() && refusal.is_empty() { other_field(text, items) } else { (text, None) };
    // The answer after the thoughts may have been lost, or the model gave none.
    let is_empty = text.trim().is_empty() && refusal.is_empty();
    let may_heal = may_heal || (is_empty && has_thought && is_end(&finish));
    Ok(Reply {
        refusal: Some(refusal).filter(|text| !text.is_empty()),
        finish,
        usage,
        served_model: chat::string_field(&response, "model"),
        provider: chat::string_field(&response, "provider"),
        attempts: 0,
        chances,
        may_heal,
        other_field,
        ..Reply::local(text)
    })
}

/// Response in the last event of an unrequested stream; `None` if the stream was truncated.
fn last_response(stream: &str) -> Option<Value> {
    stream::events(stream).find_map(|event| match event.get("type")?.as_str()? {
        "response.completed" | "response.incomplete" | "response.failed" => event.get("response").cloned(),
        "error" => Some(event),
        _ => None,
    })
}

/// Finish reason of a response.
///
/// # Errors
/// If the response has not ended.
fn finish(response: &Value, usage: Option<Usage>) -> Result<ReplyEnding, ReplyError> {
    let status = owned_text(response.get("status")).unwrap_or_default();
    match &*status {
        "" | "completed" => {
            Ok(ReplyEnding { finish: if status.is_empty() { Finish::Unknown } else { Finish::Stop }, may_heal: false })
        }
        "incomplete" => {
            let details = response.get("incomplete_details");
            let reason = owned_text(details.and_then(|details| details.get("reason")));
            finish_reason::read(reason.as_deref().unwrap_or("incomplete"), usage).map_err(ReplyError::Unreadable)
        }
        status => Err(Unreadable::new(format!("a response whose status is {status:?}")).with_usage(usage).into()),
    }
}

fn owned_text(value: Option<&Value>) -> Option<String> {
    value.and_then(Value::as_str).map(str::to_owned)
}

/// Token probabilities of the first text that has them, and whether the model thought before it; `None` without any.
fn chances(messages: &[&Value], items: &[Value], response: &Value, text: &str) -> Option<TokenChances> {
    let positions = messages
        .iter()
        .filter_map(|item| item.get("content")?.as_array())
        .flatten()
        .map(|part| part.get("logprobs"))
        .find_map(logprobs::positions)?;
    let thought = logprobs::thought(response, usage::raw(response), text);
    Some(TokenChances { positions, thought: if has_summary(items) { Thought::Before } else { thought } })
}

/// True if a response has a summary of the model's reasoning.
fn has_summary(items: &[Value]) -> bool {
    items.iter().filter_map(|item| item.get("summary")?.as_array()).any(|summary| !summary.is_empty())
}

/// The messages with the answer: those of the final phase, or those without a phase.
fn answer_messages(items: &[Value]) -> Vec<&Value> {
    let messages = || items.iter().filter(|item| is_message(item));
    let phase = |item: &Value| owned_text(item.get("phase"));
    let of_phase = |is_wanted: fn(Option<String>) -> bool| {
        messages().filter(move |item| is_wanted(phase(item))).collect::<Vec<&Value>>()
    };
    let finals = of_phase(|phase| phase.is_some_and(|phase| phase.contains("final") || phase.contains("answer")));
    if finals.is_empty() { of_phase(|phase| phase.is_none()) } else { finals }
}

fn is_message(item: &Value) -> bool {
    item.get("type").is_none_or(|kind| kind == "message")
}

/// The text of a response without an answer, and the item that holds it. The answer in the only function call becomes
/// the text; thoughts and messages of other phases do not.
fn other_field(text: String, items: &[Value]) -> (String, Option<OtherField>) {
    let calls: Vec<&Value> =
        items.iter().filter(|item| item.get("type").is_some_and(|kind| kind == "function_call")).collect();
    if let [call] = calls[..]
        && let Some((answer, field)) = tool_call(call)
    {
        return (answer.unwrap_or(text), Some(field));
    }
    let field = items.iter().find_map(|item| {
        let kind = item.get("type").and_then(Value::as_str).unwrap_or("message");
        let name = match owned_text(item.get("phase")) {
            Some(phase) => format!("{kind}, phase {phase}"),
            None => kind.to_owned(),
        };
        let text: String = ["content", "summary"].iter().filter_map(|field| item.get(*field)).map(text_of).collect();
        (!text.trim().is_empty()).then_some(OtherField { name, text })
    });
    (text, field)
}

/// Text of messages, and the text of the refusals in them.
fn text_and_refusal(messages: &[&Value]) -> (String, String) {
    let (mut text, mut refusal) = (String::new(), String::new());
    let parts = messages.iter().filter_map(|item| item.get("content")?.as_array()).flatten();
    for part in parts {
        match part.get("type").and_then(Value::as_str) {
            Some("output_text" | "text") => text += words(part, "text"),
            Some("refusal") => refusal += words(part, "refusal"),
            _ => {}
        }
    }
    (text, refusal)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn json(body: &str) -> Result<Reply, ReplyError> {
        read(body.as_bytes(), "application/json")
    }

    #[test]
    fn only_messages_become_the_text() {
        let reply = json(
            r#"{"status":"completed","model":"o-1","error":null,"output":[
                {"type":"reasoning","summary":[{"type":"summary_text","text":"A?"}],"content":[{"type":"reasoning_text","text":"A"}]},
                {"type":"message","role":"assistant","content":[{"type":"output_text","text":"B","annotations":[]},{"type":"output_text","text":"."}]},
                {"type":"tool","content":[{"type":"output_text","text":"C"}]}],
                "usage":{"input_tokens":90,"input_tokens_details":{"cached_tokens":64},"output_tokens":7,"output_tokens_details":{"reasoning_tokens":5}}}"#,
        )
        .unwrap();
        assert_eq!((reply.text.as_str(), &reply.finish), ("B.", &Finish::Stop));
        assert_eq!(reply.served_model.as_deref(), Some("o-1"));
        let usage = reply.usage.unwrap();
        assert_eq!((usage.prompt_tokens, usage.completion_tokens, usage.cached_tokens), (Some(90), Some(7), Some(64)));
        let refused = json(
            r#"{"status":"completed","output":[{"type":"message","content":[{"type":"refusal","refusal":"I cannot"}]}]}"#,
        )
        .unwrap();
        assert_eq!((refused.text.as_str(), refused.refusal.as_deref()), ("", Some("I cannot")));
    }

    fn output(items: &serde_json::Value) -> Reply {
        json(&serde_json::json!({"status": "completed", "output": items}).to_string()).unwrap()
    }

    #[test]
    fn only_the_final_phase_becomes_the_text() {
        use serde_json::json;
        let message = |text: &str, phase: Option<&str>| json!({"type": "message", "phase": phase, "content": [{"type": "output_text", "text": text}]});
        let commentary = message("It might be A.", Some("commentary"));
        for last in [message("B", Some("final_answer")), message("B", None)] {
            assert_eq!(output(&json!([commentary, last])).text, "B");
        }
        let all = json!([message("It is", None), message(" B", None)]);
        assert_eq!(output(&all).text, "It is B");
        let alone = output(&json!([commentary]));
        assert_eq!(alone.text, "");
        assert_eq!(alone.other_field.unwrap().name, "message, phase commentary");
    }

    #[test]
    fn answers_in_other_items_are_found() {
        use serde_json::json;
        let call = json!({"type": "function_call", "name": "reply", "arguments": "{\"answer\":\"B\"}"});
        assert_eq!(output(&json!([call])).text, "B");
        assert_eq!(output(&json!([call, call])).text, "", "two calls");
        let thoughts = json!({"type": "reasoning", "summary": [{"type": "summary_text", "text": "A"}]});
        let reply = output(&json!([thoughts]));
        assert_eq!((reply.text.as_str(), reply.other_field.unwrap().name), ("", "reasoning".to_owned()));
    }

    #[test]
    fn the_status_becomes_the_finish_reason() {
        for (status, finish) in [
            (r#""status":"completed","#, Finish::Stop),
            ("", Finish::Unknown),
            (r#""status":"incomplete","incomplete_details":{"reason":"max_output_tokens"},"#, Finish::Length),
            (r#""status":"incomplete","incomplete_details":{"reason":"content_filter"},"#, Finish::Filter),
        ] {
            let reply = json(&format!(r#"{{{status}"output":[]}}"#)).unwrap();
            assert_eq!(reply.finish, finish, "{status}");
        }
    }

    #[test]
    fn doubtful_ends_may_heal() {
        for body in [
            r#"{"status":"incomplete","output":[]}"#,
            r#"{"status":"incomplete","incomplete_details":{"reason":"zeitgeist"},"output":[]}"#,
            r#"{"status":"completed","output":[{"type":"reasoning","summary":[{"text":"A?"}]}]}"#,
            r#"{"status":"completed","output":[{"type":"message","content":[]}],"usage":{"output_tokens_details":{"reasoning_tokens":5}}}"#,
        ] {
            assert!(json(body).unwrap().may_heal, "{body}");
        }
    }

    #[test]
    fn incomplete_responses_are_described() {
        for (body, expected) in [
            (r#"{"status":"in_progress","output":[]}"#, "in_progress"),
            (r#"{"status":"completed","output":[],"usage":{"output_tokens":9}}"#, "without an output"),
            (r#"{"choices":[]}"#, "without output"),
            ("", "empty"),
            (r#"data: {"type":"response.created","response":{}}"#, "without a complete response"),
        ] {
            let Err(ReplyError::Unreadable(found)) = json(body) else {
                panic!("{body}");
            };
            assert!(found.description.contains(expected), "{found:?}");
        }
        for body in [
            r#"{"status":"failed","error":{"code":"server_error","message":"m"},"output":[]}"#,
            r#"{"error":{"message":"m"}}"#,
            r#"data: {"type":"error","message":"m"}"#,
        ] {
            let Err(ReplyError::Api(api_error)) = json(body) else {
                panic!("{body}");
            };
            assert_eq!(api_error.message, "m");
        }
    }

    #[test]
    fn the_last_event_of_a_stream_is_used() {
        let stream = "event: response.output_text.delta\ndata: {\"type\":\"response.output_text.delta\",\"delta\":\"A\"}\n\n\
            event: response.completed\ndata: {\"type\":\"response.completed\",\"response\":{\"status\":\"completed\",\"output\":[{\"type\":\"message\",\"content\":[{\"type\":\"output_text\",\"text\":\"B\"}]}]}}\n\n";
        assert_eq!(json(stream).unwrap().text, "B");
    }
}
