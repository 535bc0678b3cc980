//! Lenient parsing of replies of OpenAI's Responses API: [`read`].

use serde_json::Value;

use super::chat_reply::is_end;
use super::finish_reason::{self, Ending};
use super::json_body;
use super::logprobs;
use super::message_fields::words;
use super::other_field::{text_of, tool_call};
use super::stream;
use super::usage;
use crate::ask::failures::{ApiError, ReplyError, Unreadable};
use crate::types::{Finish, OtherField, Reply, Thought, TokenChances, Usage};

/// Parses a response body; `latency_ms` and `attempts` remain zero.
///
/// The text is the text of all parts of type `output_text` in items of type `message`; reasoning items are ignored, and
/// so are messages of another phase than the final answer. A failed response has an error; an incomplete response has a
/// reason, which becomes the finish reason.
pub(super) fn read(body: &[u8], content_type: &str) -> Result<Reply, ReplyError> {
    let text = json_body::text(body);
    let response = if stream::is_stream(&text, content_type) {
        last_response(&text).ok_or_else(|| Unreadable::new("an event stream without a complete response"))?
    } else {
        json_body::parse_body(&text, content_type)?
    };
    let api_error = match response.get("output") {
        Some(_) => ApiError::in_error(&response),
        None => ApiError::from_json(&response),
    };
    if let Some(api_error) = api_error {
        return Err(ReplyError::Api(Box::new(api_error)));
    }
    let usage = usage::in_body(&response);
    let Ending { finish, may_heal } = finish(&response, usage)?;
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
        has_summary(items) || logprobs::thought(&response, response.get("usage"), &text) == Thought::Before;
    let (text, other_field) =
        if text.trim().is_empty() && refusal.is_empty() { other_field(text, items) } else { (text, None) };
    // The answer after the thoughts may have been lost, or the model gave none.
    let is_empty = text.trim().is_empty() && refusal.is_empty();
    let may_heal = may_heal || (is_empty && has_thought && is_end(&finish));
    Ok(Reply {
        refusal: Some(refusal).filter(|text| !text.is_empty()),
        finish,
        usage,
        served_model: json_body::string_field(&response, "model"),
        provider: json_body::string_field(&response, "provider"),
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
fn finish(response: &Value, usage: Option<Usage>) -> Result<Ending, ReplyError> {
    let status = owned_text(response.get("status")).unwrap_or_default();
    match &*status {
        "" | "completed" => {
            Ok(Ending { finish: if status.is_empty() { Finish::Unknown } else { Finish::Stop }, may_heal: false })
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
    let thought = logprobs::thought(response, response.get("usage"), text);
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
