//! Event streams of replies: [`events`] parses a stream, [`assemble`] joins the chunks of a chat completion.

use serde_json::{Map, Value, json};

use super::message_fields::refusal_field;
use super::usage;
use crate::bounded_json::{MAX_ITEMS, parse};
use crate::failures::find_error;

/// True if a body is an event stream, by its content type or its first characters.
pub(super) fn is_stream(text: &str, content_type: &str) -> bool {
    let text = text.trim_start();
    content_type.starts_with("text/event-stream") || text.starts_with("data:") || text.starts_with("event:")
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

/// True if a stream has the event `[DONE]`, which servers send last.
fn is_done(stream: &str) -> bool {
    stream.split(['\n', '\r']).filter_map(|line| line.strip_prefix("data:")).any(|data| data.trim() == "[DONE]")
}

/// An event stream without a complete chat completion.
#[derive(Debug, Default, PartialEq, Eq)]
pub(super) struct BrokenStream {
    /// Token usage, if the stream has it.
    pub(super) usage: Option<Value>,
    /// True if the stream has a part of the reply, so that the server has worked on it.
    pub(super) has_text: bool,
}

/// Joins the chunks of the choice with index 0 to a completion in the form of an unstreamed one. An error event is
/// returned in its place.
///
/// A stream is complete if it has a finish reason. Some gateways send none: then it is complete if it has a part of the
/// reply and ends with `[DONE]`, or with the final token counts, which follow the last token.
///
/// # Errors
/// If the stream is not a chat completion, or is truncated.
pub(super) fn assemble(stream: &str) -> Result<Value, BrokenStream> {
    let mut completion = Map::new();
    let mut joined = JoinedChoice::default();
    let mut ends_with_counts = false;
    for event in events(stream) {
        if event.is_null() {
            return Err(BrokenStream { usage: completion.remove("usage"), has_text: joined.has_text() });
        }
        if let Some(error) = error_event(&event) {
            return Ok(error);
        }
        if let Some(usage) = usage::raw(&event) {
            completion.insert("usage".to_owned(), usage.clone());
        }
        for field in ["model", "provider", "service_tier"] {
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
        ends_with_counts = choice.is_none() && usage::states_reply_tokens(&event);
        if let Some(choice) = choice {
            // Some gateways put an error into the choice.
            if choice.get("error").is_some_and(|error| !error.is_null()) {
                return Ok(event);
            }
            joined.add(choice);
        }
    }
    let has_text = joined.has_text();
    let is_complete = joined.is_finished() || (has_text && (ends_with_counts || is_done(stream)));
    if !is_complete {
        return Err(BrokenStream { usage: completion.remove("usage"), has_text });
    }
    completion.insert("choices".to_owned(), json!([joined.into_choice()]));
    Ok(Value::Object(completion))
}

/// The error in an event, in the form of an error body; `None` without one.
fn error_event(event: &Value) -> Option<Value> {
    if event.get("error").is_some_and(|error| !error.is_null()) {
        return Some(event.clone());
    }
    let is_named = ["type", "object"].iter().any(|field| event.get(field).is_some_and(|kind| kind == "error"));
    if is_named {
        return Some(json!({"error": event}));
    }
    let has_choices = event.get("choices").and_then(Value::as_array).is_some_and(|choices| !choices.is_empty());
    let error = find_error(event).filter(|_| !has_choices)?;
    Some(json!({"error": error}))
}

/// A choice joined from its chunks.
#[derive(Default)]
struct JoinedChoice {
    finish_reason: Value,
    content: Vec<Value>,
    /// The other text fields, such as `refusal` and `reasoning_content`.
    texts: Map<String, Value>,
    /// The functions of the tool calls.
    calls: Vec<Value>,
    logprobs: Map<String, Value>,
}

/// Appends items to a list, up to [`MAX_ITEMS`] items.
fn extend_bounded(joined: &mut Vec<Value>, more: &[Value]) {
    let room = MAX_ITEMS.saturating_sub(joined.len());
    joined.extend(more.iter().take(room).cloned());
}

/// Text fields of a chunk that are repeated whole, not continued.
const WHOLE_FIELDS: [&str; 6] = ["role", "content", "id", "name", "type", "object"];

/// Maximum number of text fields, and of tool calls, of a message; chosen.
const MAX_FIELDS: usize = 64;

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
        for (field, value) in delta.and_then(Value::as_object).into_iter().flatten() {
            self.add_field(field, value);
        }
        let own_refusal = delta.and_then(|delta| delta.get("refusal")?.as_str());
        if own_refusal.is_none_or(str::is_empty)
            && let Some(refusal) = delta.and_then(refusal_field)
        {
            self.add_field("refusal", &json!(refusal));
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

    /// Adds a field of a chunk besides its content: a text, or the tool calls.
    fn add_field(&mut self, field: &str, value: &Value) {
        let has_room = self.texts.len() < MAX_FIELDS || self.texts.contains_key(field);
        match value {
            Value::String(text) if has_room && !WHOLE_FIELDS.contains(&field) => {
                append(self.texts.entry(field).or_insert_with(|| json!("")), text);
            }
            Value::Array(calls) if field == "tool_calls" => {
                for call in calls {
                    self.add_call(call);
                }
            }
            _ => {}
        }
    }

    /// Adds a piece of a tool call, whose arguments come in several.
    fn add_call(&mut self, piece: &Value) {
        let last = self.calls.len().saturating_sub(1);
        let index = piece.get("index").and_then(Value::as_u64);
        let index = index.map_or(last, |index| usize::try_from(index).unwrap_or(MAX_FIELDS));
        if index >= MAX_FIELDS {
            return;
        }
        if self.calls.len() <= index {
            let empty = json!({"function": {"name": "", "arguments": ""}});
            self.calls.resize(index + 1, empty);
        }
        for field in ["name", "arguments"] {
            if let Some(text) = piece.pointer(&format!("/function/{field}")).and_then(Value::as_str) {
                append(&mut self.calls[index]["function"][field], text);
            }
        }
    }

    fn add_content(&mut self, text: &str) {
        match self.content.last_mut() {
            Some(joined @ Value::String(_)) => append(joined, text),
            _ => self.content.push(text.into()),
        }
    }

    /// True if a chunk had a finish reason; some gateways send an empty one with each chunk.
    fn is_finished(&self) -> bool {
        match &self.finish_reason {
            Value::String(reason) => !reason.trim().is_empty(),
            reason => !reason.is_null(),
        }
    }

    /// True if a chunk had a part of the reply or of the reasoning before it.
    fn has_text(&self) -> bool {
        self.content.iter().chain(self.texts.values()).any(|part| part != "")
    }

    /// The choice; its finish reason is null if no chunk had one.
    fn into_choice(self) -> Value {
        let mut message = self.texts;
        if !self.calls.is_empty() {
            message.insert("tool_calls".to_owned(), self.calls.into());
        }
        match <[Value; 1]>::try_from(self.content) {
            Ok([text @ Value::String(_)]) => message.insert("content".to_owned(), text),
            Ok([part]) => message.insert("content".to_owned(), json!([part])),
            Err(parts) if parts.is_empty() => None,
            Err(parts) => message.insert("content".to_owned(), json!(parts)),
        };
        let mut choice = json!({"index": 0, "message": message, "finish_reason": self.finish_reason});
        if !self.logprobs.is_empty() {
            choice["logprobs"] = self.logprobs.into();
        }
        choice
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
    fn tool_calls_and_other_texts_are_joined() {
        let piece = |delta: Value| {
            let choice = json!({"index": 0, "delta": delta, "finish_reason": null});
            format!("data: {}\n\n", json!({"choices": [choice]}))
        };
        let call = |arguments: &str| json!({"tool_calls": [{"index": 0, "function": {"arguments": arguments}}]});
        let named = json!({"role": "assistant", "tool_calls": [{"index": 0, "id": "c", "function": {"name": "reply", "arguments": ""}}]});
        let pieces = [
            piece(named),
            piece(json!({"role": "assistant", "zork_text": "It is "})),
            piece(json!({"zork_text": "dark"})),
            piece(call("{\"answer\": ")),
            piece(call("\"B\"}")),
            "data: {\"choices\":[{\"index\":0,\"delta\":{},\"finish_reason\":\"tool_calls\"}]}\n\n".to_owned(),
        ];
        let function = json!({"name": "reply", "arguments": "{\"answer\": \"B\"}"});
        assert_eq!(
            assemble(&pieces.concat()).unwrap()["choices"][0]["message"],
            json!({"zork_text": "It is dark", "tool_calls": [{"function": function}]})
        );
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
        let broken = |usage, has_text| Err(BrokenStream { usage, has_text });
        assert_eq!(assemble(piece), broken(None, true));
        let prompt = "data: {\"choices\":[],\"usage\":{\"prompt_tokens\":3}}\n\n";
        let cut = assemble(&format!("{prompt}{piece}"));
        assert_eq!(cut, broken(Some(json!({"prompt_tokens": 3})), true));
        let counts = "data: {\"choices\":[],\"usage\":{\"completion_tokens\":3}}\n\n";
        assert!(assemble(&format!("{counts}{piece}")).is_err(), "counts so far");
        let total = "data: {\"choices\":[],\"usage\":{\"prompt_tokens\":3,\"total_tokens\":5}}\n\n";
        assert!(assemble(&format!("{piece}{total}")).is_err(), "a total may be one so far");
        assert_eq!(assemble(&format!("{piece}data: {{\"choi")), broken(None, true));
        let role = "data: {\"choices\":[{\"index\":0,\"delta\":{\"content\":\"\"}}]}\n\n";
        for empty in ["", ": keep-alive\n\n", "data: [DONE]\n\n", role] {
            assert_eq!(assemble(empty), broken(None, false), "{empty}");
        }
        assert_eq!(assemble(&format!("{role}data: [DONE]\n\n")), broken(None, false));
        let error = "data: {\"error\":{\"message\":\"overloaded\"}}\n\n";
        assert_eq!(assemble(&format!("{piece}{error}")).unwrap()["error"]["message"], "overloaded");
        let error = "event: error\ndata: {\"type\":\"error\",\"message\":\"overloaded\"}\n\n";
        assert_eq!(assemble(&format!("{piece}{error}")).unwrap()["error"]["message"], "overloaded");
    }

    #[test]
    fn streams_without_a_finish_reason_are_complete_at_their_end() {
        let chunk = |finish: &str| {
            format!("data: {{\"choices\":[{{\"index\":0,\"delta\":{{\"content\":\"B\"}}{finish}}}]}}\n\n")
        };
        let done = "data: [DONE]\n\n";
        let counts = "data: {\"choices\":[],\"usage\":{\"completion_tokens\":1}}\n\n";
        for finish in ["", ",\"finish_reason\":null", ",\"finish_reason\":\"\""] {
            for end in [done.to_owned(), counts.to_owned(), [counts, done].concat()] {
                let joined = assemble(&format!("{}{end}", chunk(finish))).unwrap();
                let choice = &joined["choices"][0];
                assert_eq!(choice["message"]["content"], "B", "{finish} {end}");
            }
            assert!(assemble(&chunk(finish)).is_err(), "{finish}");
        }
        let thought = "data: {\"choices\":[{\"delta\":{\"reasoning\":\"A\"}}]}\n\n";
        assert!(assemble(&format!("{thought}{done}")).is_ok());
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
        assert_eq!(choice["logprobs"], json!({"content": [{"token": "B"}, {"token": "."}]}));
        let thought = r#"[{"type":"thinking","thinking":[]}]"#;
        let parts = [piece(thought, "A", "null"), whole].concat();
        let choice = &assemble(&parts).unwrap()["choices"][0];
        assert_eq!(choice["message"]["content"], json!([{"type": "thinking", "thinking": []}, "B."]));
    }
}
