//! Lenient parsing of replies of OpenAI's Responses API: [`read`].

use serde_json::Value;

use super::chat_reply::{is_end, words};
use super::finish_reason::{self, Ending};
use super::json_body;
use super::logprobs;
use super::stream;
use super::usage;
use crate::ask::failures::{ApiError, ReplyError, Unreadable};
use crate::types::{Finish, Reply, Thought, TokenChances, Usage};

/// Parses a response body; `latency_ms` and `attempts` remain zero.
///
/// The text is the text of all parts of type `output_text` in items of type `message`; reasoning items are ignored. A failed response has
/// an error; an incomplete response has a reason, which becomes the finish reason.
pub(super) fn read(body: &[u8], content_type: &str) -> Result<Reply, ReplyError> {
    let text = json_body::text(body);
    let response = if stream::is_stream(&text, content_type) {
        last_response(&text)
            .ok_or_else(|| Unreadable::new("an event stream without a complete response"))?
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
        return Err(Unreadable::new("a response without an output")
            .with_usage(usage)
            .into());
    }
    let (text, refusal) = text_and_refusal(items);
    let chances = chances(items, &response, &text);
    let has_thought = has_summary(items)
        || logprobs::thought(&response, response.get("usage"), &text) == Thought::Before;
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
        ..Reply::local(text)
    })
}

/// Response in the last event of an unrequested stream; `None` if the stream was truncated.
fn last_response(stream: &str) -> Option<Value> {
    stream::events(stream).find_map(|event| match event.get("type")?.as_str()? {
        "response.completed" | "response.incomplete" | "response.failed" => {
            event.get("response").cloned()
        }
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
        "" | "completed" => Ok(Ending {
            finish: if status.is_empty() {
                Finish::Unknown
            } else {
                Finish::Stop
            },
            may_heal: false,
        }),
        "incomplete" => {
            let details = response.get("incomplete_details");
            let reason = owned_text(details.and_then(|details| details.get("reason")));
            Ok(finish_reason::read(
                reason.as_deref().unwrap_or("incomplete"),
                usage,
            )?)
        }
        status => Err(
            Unreadable::new(format!("a response whose status is {status:?}"))
                .with_usage(usage)
                .into(),
        ),
    }
}

fn owned_text(value: Option<&Value>) -> Option<String> {
    value.and_then(Value::as_str).map(str::to_owned)
}

/// Token probabilities of the first text that has them, and whether the model thought before it; `None` without any.
fn chances(items: &[Value], response: &Value, text: &str) -> Option<TokenChances> {
    let positions = items
        .iter()
        .filter_map(|item| item.get("content")?.as_array())
        .flatten()
        .map(|part| part.get("logprobs"))
        .find_map(logprobs::positions)?;
    let thought = logprobs::thought(response, response.get("usage"), text);
    Some(TokenChances {
        positions,
        thought: if has_summary(items) {
            Thought::Before
        } else {
            thought
        },
    })
}

/// True if a response has a summary of the model's reasoning.
fn has_summary(items: &[Value]) -> bool {
    items
        .iter()
        .filter_map(|item| item.get("summary")?.as_array())
        .any(|summary| !summary.is_empty())
}

/// Text of the messages in a response, and the text of the refusals in them.
fn text_and_refusal(items: &[Value]) -> (String, String) {
    let (mut text, mut refusal) = (String::new(), String::new());
    let parts = items
        .iter()
        .filter(|item| item.get("type").is_none_or(|kind| kind == "message"))
        .filter_map(|item| item.get("content")?.as_array())
        .flatten();
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
        assert_eq!(
            (
                usage.prompt_tokens,
                usage.completion_tokens,
                usage.cached_tokens
            ),
            (Some(90), Some(7), Some(64))
        );
        let refused = json(
            r#"{"status":"completed","output":[{"type":"message","content":[{"type":"refusal","refusal":"I cannot"}]}]}"#,
        )
        .unwrap();
        assert_eq!(
            (refused.text.as_str(), refused.refusal.as_deref()),
            ("", Some("I cannot"))
        );
    }

    #[test]
    fn the_status_becomes_the_finish_reason() {
        for (status, finish) in [
            (r#""status":"completed","#, Finish::Stop),
            ("", Finish::Unknown),
            (
                r#""status":"incomplete","incomplete_details":{"reason":"max_output_tokens"},"#,
                Finish::Length,
            ),
            (
                r#""status":"incomplete","incomplete_details":{"reason":"content_filter"},"#,
                Finish::Filter,
            ),
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
            (
                r#"{"status":"completed","output":[],"usage":{"output_tokens":9}}"#,
                "without an output",
            ),
            (r#"{"choices":[]}"#, "without output"),
            ("", "empty"),
            (
                r#"data: {"type":"response.created","response":{}}"#,
                "without a complete response",
            ),
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
