//! Lenient parsing of chat completions, because servers differ: [`read`].

use serde_json::Value;

use super::finish_reason::{self, Ending};
use super::json_body;
use super::logprobs;
use super::message_fields::{refusal_field, words};
use super::other_field;
use super::stream;
use super::usage;
use crate::ask::failures::{ApiError, ReplyError, Unreadable, Wording};
use crate::types::{Finish, Reply, Thought, TokenChances, Usage};

/// Parses a response body; `latency_ms` and `attempts` remain zero.
///
/// Errors may be at the top level or in the choice, because gateways send both with status 200. Optional fields may be
/// missing, null or of another type; hidden reasoning is ignored. Invalid UTF-8 and unpaired surrogates become
/// replacement characters, because a small model at temperature 0 would send them again in each retry. An event stream
/// is accepted even if it was not requested.
pub(super) fn read(body: &[u8], content_type: &str) -> Result<Reply, ReplyError> {
    let completion = parse(&json_body::text(body), content_type)?;
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
    let Ending { finish, may_heal } = finish_reason::read(reason.unwrap_or_default(), usage)
        .map_err(|incomplete| error_in_text(choice).unwrap_or(ReplyError::Unreadable(incomplete)))?;
    let message = choice
        .get("message")
        .filter(|message| message.is_object())
        .ok_or_else(|| unreadable("a choice without a message"))?;
    let (text, refusal_part) = content(message.get("content")).map_err(unreadable)?;
    let chances = logprobs::positions(choice.get("logprobs")).map(|positions| TokenChances {
        positions,
        thought: logprobs::thought(message, completion.get("usage"), &text),
    });
    let refusal = refusal_field(message).map(str::to_owned).or(refusal_part);
    let has_thought = text.trim().is_empty()
        && refusal.is_none()
        && logprobs::thought(message, completion.get("usage"), &text) == Thought::Before;
    let (text, other_field) = match refusal {
        None if text.trim().is_empty() => other_field::of_message(text, message),
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
        served_model: json_body::string_field(&completion, "model"),
        provider: json_body::string_field(&completion, "provider"),
        attempts: 0,
        chances,
        may_heal,
        other_field,
        ..Reply::local(text)
    })
}

/// Parses a completion from JSON or an event stream.
fn parse(text: &str, content_type: &str) -> Result<Value, ReplyError> {
    if stream::is_stream(text, content_type) {
        return stream::assemble(text).map_err(|broken| {
            let description = "an event stream without a complete chat completion";
            Unreadable { usage: usage::alone(broken.usage), broke_off: broken.has_text, ..Unreadable::new(description) }
                .into()
        });
    }
    json_body::parse_body(text, content_type)
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
fn content(content: Option<&Value>) -> Result<(String, Option<String>), &'static str> {
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
