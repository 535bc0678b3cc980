//! A chat completion that came as an event stream, although none was requested: [`assemble`].

use serde_json::{Map, Value, json};

/// Whether a body is an event stream, by its content type or its beginning.
pub(super) fn is_stream(text: &str, content_type: &str) -> bool {
    content_type.starts_with("text/event-stream") || text.trim_start().starts_with("data:")
}

/// The completion that the pieces of the choice with index 0 make, in the form of `chat_reply`. An event with an error is
/// returned unchanged. `None` if the stream is not a chat completion, or ended without `[DONE]` and a finish reason.
pub(super) fn assemble(stream: &str) -> Option<Value> {
    let mut completion = Map::new();
    let mut finish = Value::Null;
    let mut message = Map::new();
    let (mut started, mut done) = (false, false);
    // Lines may end in CR, LF or both; comments and event names are ignored.
    let lines = stream.split(['\n', '\r']);
    for data in lines.filter_map(|line| line.strip_prefix("data:")) {
        let data = data.trim();
        if data == "[DONE]" {
            done = true;
            break;
        }
        let event: Value = serde_json::from_str(data).ok()?;
        if event.get("error").is_some_and(|error| !error.is_null()) {
            return Some(event);
        }
        for field in ["model", "usage"] {
            if let Some(value) = event.get(field).filter(|value| !value.is_null()) {
                completion.insert(field.to_owned(), value.clone());
            }
        }
        let choices = event.get("choices").and_then(Value::as_array);
        let first = |choice: &&Value| choice.get("index").is_none_or(|index| *index == 0);
        let Some(choice) = choices.and_then(|choices| choices.iter().find(first)) else {
            continue;
        };
        started = true;
        if let Some(reason) = choice.get("finish_reason").filter(|r| !r.is_null()) {
            finish = reason.clone();
        }
        // Some servers send the whole message as the only piece.
        let delta = choice.get("delta").or_else(|| choice.get("message"));
        for field in ["content", "refusal"] {
            if let Some(text) = delta.and_then(|delta| delta.get(field)?.as_str()) {
                let joined = message.entry(field).or_insert_with(|| json!(""));
                *joined = json!(format!("{}{text}", joined.as_str().unwrap_or_default()));
            }
        }
    }
    if !started || (!done && finish.is_null()) {
        return None;
    }
    let choice = json!({"index": 0, "message": message, "finish_reason": finish});
    completion.insert("choices".to_owned(), json!([choice]));
    Some(Value::Object(completion))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pieces_become_a_completion() {
        let stream = ": ping\r\n\r\ndata: {\"model\":\"m\",\"choices\":[{\"index\":0,\"delta\":{\"role\":\"assistant\",\"content\":\"\"}}]}\r\n\r\n\
            data:{\"choices\":[{\"index\":1,\"delta\":{\"content\":\"A\"}},{\"index\":0,\"delta\":{\"content\":\"B\",\"reasoning_content\":\"A\"}}]}\n\n\
            event: x\ndata: {\"choices\":[{\"index\":0,\"delta\":{\"content\":\".\"},\"finish_reason\":\"stop\"}]}\n\n\
            data: {\"choices\":[],\"usage\":{\"prompt_tokens\":3}}\n\ndata: [DONE]\n\n";
        let expected = json!({
            "model": "m", "usage": {"prompt_tokens": 3},
            "choices": [{"index": 0, "message": {"content": "B."}, "finish_reason": "stop"}],
        });
        assert_eq!(assemble(stream), Some(expected));
    }

    #[test]
    fn an_incomplete_stream_is_refused() {
        let piece = "data: {\"choices\":[{\"index\":0,\"delta\":{\"content\":\"B\"}}]}\n\n";
        assert_eq!(assemble(piece), None);
        assert_eq!(assemble(&format!("{piece}data: {{\"choi")), None);
        assert!(assemble(&format!("{piece}data: [DONE]")).is_some());
        assert_eq!(assemble("data: [DONE]\n\n"), None);
        assert_eq!(assemble(": keep-alive\n\n"), None);
        let error = "data: {\"error\":{\"message\":\"overloaded\"}}\n\n";
        assert_eq!(
            assemble(&format!("{piece}{error}")).unwrap()["error"]["message"],
            "overloaded"
        );
    }
}
