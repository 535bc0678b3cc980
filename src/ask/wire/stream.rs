//! Event streams of replies: [`events`] parses a stream, [`assemble`] joins the chunks of a chat completion.

use super::chat_reply::refusal_field;
use serde_json::{Map, Value, json};

use crate::ask::replies::bounded_json::{MAX_ITEMS, parse};

/// True if a body is an event stream, by its content type or its first characters.
pub(super) fn is_stream(text: &str, content_type: &str) -> bool {
    let text = text.trim_start();
    content_type.starts_with("text/event-stream")
        || text.starts_with("data:")
        || text.starts_with("event:")
}

/// Events of a stream up to `[DONE]`, as JSON. A truncated event, which is not JSON, becomes null.
///
/// Lines may end in CR, LF or both. Event names are skipped, and so are comments and empty events, which keep a
/// connection open.
pub(super) fn events(stream: &str) -> impl Iterator<Item = Value> {
    stream
        .split(['\n', '\r'])
        .filter_map(|line| line.strip_prefix("data:").map(str::trim))
        .filter(|data| !data.is_empty())
        .take_while(|data| *data != "[DONE]")
        .map(|data| parse(data).unwrap_or_default())
}

/// Joins the chunks of the choice with index 0 to a completion in the form of an unstreamed one. An error event is returned in its place.
///
/// # Errors
/// If the stream is not a chat completion, or is truncated: it has no finish reason. The error is the usage, if the stream has one.
pub(super) fn assemble(stream: &str) -> Result<Value, Option<Value>> {
    let mut completion = Map::new();
    let mut joined = JoinedChoice::default();
    for event in events(stream) {
        if event.is_null() {
            return Err(completion.remove("usage"));
        }
        if let Some(error) = error_event(&event) {
            return Ok(error);
        }
        for field in ["model", "provider", "usage"] {
            if let Some(value) = event.get(field).filter(|value| !value.is_null()) {
                completion.insert(field.to_owned(), value.clone());
            }
        }
        let choice = event
            .get("choices")
            .and_then(Value::as_array)
            .into_iter()
            .flatten()
            .find(|choice| choice.get("index").is_none_or(|index| *index == 0));
        if let Some(choice) = choice {
            // Some gateways put an error into the choice.
            if choice.get("error").is_some_and(|error| !error.is_null()) {
                return Ok(event);
            }
            joined.add(choice);
        }
    }
    match joined.finish() {
        Some(choice) => {
            completion.insert("choices".to_owned(), json!([choice]));
            Ok(Value::Object(completion))
        }
        None => Err(completion.remove("usage")),
    }
}

/// The error in an event, in the form of an error body; `None` without one.
fn error_event(event: &Value) -> Option<Value> {
    if event.get("error").is_some_and(|error| !error.is_null()) {
        return Some(event.clone());
    }
    ["type", "object"]
        .iter()
        .any(|field| event.get(field).is_some_and(|kind| kind == "error"))
        .then(|| json!({"error": event}))
}

/// A choice joined from its chunks.
#[derive(Default)]
struct JoinedChoice {
    finish_reason: Value,
    content: Vec<Value>,
    /// The fields of [`TEXT_FIELDS`].
    texts: Map<String, Value>,
    logprobs: Map<String, Value>,
}

/// Appends items to a list, up to [`MAX_ITEMS`] items.
fn extend_bounded(joined: &mut Vec<Value>, more: &[Value]) {
    let room = MAX_ITEMS.saturating_sub(joined.len());
    joined.extend(more.iter().take(room).cloned());
}

/// Text fields of a chunk besides its content and refusal.
const TEXT_FIELDS: [&str; 2] = ["reasoning_content", "reasoning"];

impl JoinedChoice {
    /// Adds the next chunk of the choice.
    fn add(&mut self, choice: &Value) {
        if let Some(reason) = choice.get("finish_reason").filter(|r| !r.is_null()) {
            self.finish_reason = reason.clone();
        }
        // Some servers send the whole message in a single chunk.
        let delta = choice.get("delta").or_else(|| choice.get("message"));
        match delta.and_then(|delta| delta.get("content")) {
            Some(Value::String(text)) => self.add_content(text),
            Some(Value::Array(parts)) => extend_bounded(&mut self.content, parts),
            _ => {}
        }
        let texts =
            TEXT_FIELDS.map(|field| (field, delta.and_then(|delta| delta.get(field)?.as_str())));
        let refusal = ("refusal", delta.and_then(refusal_field));
        for (field, text) in texts.into_iter().chain([refusal]) {
            if let Some(text) = text {
                let joined = self.texts.entry(field).or_insert_with(|| json!(""));
                append(joined, text);
            }
        }
        // Each chunk has the tokens of its own text: join the lists.
        let logprobs = choice.get("logprobs").and_then(Value::as_object);
        for (field, value) in logprobs.into_iter().flatten() {
            if let Value::Array(more) = value {
                let joined = self.logprobs.entry(field).or_insert_with(|| json!([]));
                if let Value::Array(joined) = joined {
                    extend_bounded(joined, more);
                }
            }
        }
    }

    fn add_content(&mut self, text: &str) {
        match self.content.last_mut() {
            Some(joined @ Value::String(_)) => append(joined, text),
            _ => self.content.push(text.into()),
        }
    }

    /// The complete choice; `None` if the last chunk, with the finish reason, is missing.
    fn finish(self) -> Option<Value> {
        if self.finish_reason.is_null() {
            return None;
        }
        let mut message = self.texts;
        match <[Value; 1]>::try_from(self.content) {
            Ok([text @ Value::String(_)]) => message.insert("content".to_owned(), text),
            Ok([part]) => message.insert("content".to_owned(), json!([part])),
            Err(parts) if parts.is_empty() => None,
            Err(parts) => message.insert("content".to_owned(), json!(parts)),
        };
        let mut choice =
            json!({"index": 0, "message": message, "finish_reason": self.finish_reason});
        if !self.logprobs.is_empty() {
            choice["logprobs"] = self.logprobs.into();
        }
        Some(choice)
    }
}

/// Appends to a JSON string.
fn append(joined: &mut Value, text: &str) {
    if let Value::String(joined) = joined {
        joined.push_str(text);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chunks_are_joined() {
        let stream = ": ping\r\n\r\ndata: {\"model\":\"m\",\"choices\":[{\"index\":0,\"delta\":{\"role\":\"assistant\",\"content\":\"\"}}]}\r\n\r\n\
            data:{\"choices\":[{\"index\":1,\"delta\":{\"content\":\"A\"}},{\"index\":0,\"delta\":{\"content\":\"B\",\"reasoning_content\":\"A\"}}]}\n\n\
            event: x\ndata: {\"choices\":[{\"index\":0,\"delta\":{\"content\":\".\"},\"finish_reason\":\"stop\"}]}\n\n\
            data: {\"choices\":[],\"usage\":{\"prompt_tokens\":3}}\n\ndata: [DONE]\n\n";
        let expected = json!({
            "model": "m", "usage": {"prompt_tokens": 3},
            "choices": [{"index": 0, "message": {"content": "B.", "reasoning_content": "A"}, "finish_reason": "stop"}],
        });
        assert_eq!(assemble(stream), Ok(expected));
    }

    #[test]
    fn empty_events_are_skipped() {
        let piece = "data: {\"choices\":[{\"index\":0,\"delta\":{\"content\":\"B\"},\"finish_reason\":\"stop\"}]}\n\n";
        let joined = assemble(&format!("data:\n\n{piece}data: \n\ndata: [DONE]\n\n")).unwrap();
        assert_eq!(joined["choices"][0]["message"]["content"], "B");
    }

    #[test]
    fn incomplete_streams_are_errors() {
        let piece = "data: {\"choices\":[{\"index\":0,\"delta\":{\"content\":\"B\"}}]}\n\n";
        assert_eq!(assemble(piece), Err(None));
        let usage = "data: {\"choices\":[],\"usage\":{\"prompt_tokens\":3}}\n\n";
        let cut = assemble(&format!("{piece}{usage}data: [DONE]"));
        assert_eq!(cut, Err(Some(json!({"prompt_tokens": 3}))));
        assert_eq!(assemble(&format!("{piece}data: {{\"choi")), Err(None));
        assert_eq!(assemble(&format!("{piece}data: [DONE]")), Err(None));
        assert_eq!(assemble("data: [DONE]\n\n"), Err(None));
        assert_eq!(assemble(": keep-alive\n\n"), Err(None));
        let error = "data: {\"error\":{\"message\":\"overloaded\"}}\n\n";
        assert_eq!(
            assemble(&format!("{piece}{error}")).unwrap()["error"]["message"],
            "overloaded"
        );
        let error = "event: error\ndata: {\"type\":\"error\",\"message\":\"overloaded\"}\n\n";
        assert_eq!(
            assemble(&format!("{piece}{error}")).unwrap()["error"]["message"],
            "overloaded"
        );
    }

    fn piece(content: &str, token: &str, finish: &str) -> String {
        format!(
            "data: {{\"choices\":[{{\"delta\":{{\"content\":{content}}},\"logprobs\":{{\"content\":[{{\"token\":\"{token}\"}}],\"refusal\":null}},\"finish_reason\":{finish}}}]}}\n\n"
        )
    }

    #[test]
    fn logprobs_and_content_parts_are_joined() {
        let whole = [piece("\"B\"", "B", "null"), piece("\".\"", ".", "\"stop\"")].concat();
        let choice = &assemble(&whole).unwrap()["choices"][0];
        assert_eq!(choice["message"]["content"], "B.");
        assert_eq!(
            choice["logprobs"],
            json!({"content": [{"token": "B"}, {"token": "."}]})
        );
        let thought = r#"[{"type":"thinking","thinking":[]}]"#;
        let parts = [piece(thought, "A", "null"), whole].concat();
        let choice = &assemble(&parts).unwrap()["choices"][0];
        assert_eq!(
            choice["message"]["content"],
            json!([{"type": "thinking", "thinking": []}, "B."])
        );
    }
}
