//! Servers that answer by another API than chat completions in one piece.

use std::time::Duration;

use darkqa_base::types::{FailureKind, Finish, Reply};
use darkqa_eval::internals::ask::{Parameters, Reach, Sending, WireSetting};
use serde_json::{Value, json};

use super::{ask, ask_with, sending};
use crate::support::endpoint::Answer;
use crate::support::table::check_rows;

fn by(wire: WireSetting) -> Parameters {
    Parameters { wire, ..Parameters::new("m".into()) }
}

/// A reply without what differs from one request to the next.
fn comparable(reply: Reply) -> Reply {
    Reply { latency_ms: 0, ..reply }
}

fn delta(delta: &Value, finish: Option<&str>) -> String {
    json!({"model": "mock-1", "choices": [{"index": 0, "delta": delta, "finish_reason": finish}], "usage": null})
        .to_string()
}

const USAGE: &str =
    r#"{"model":"mock-1","choices":[],"usage":{"prompt_tokens":90,"completion_tokens":1,"total_tokens":91}}"#;

fn streamed(text: &[&str]) -> Answer {
    let mut events = vec![delta(&json!({"role": "assistant", "content": ""}), None)];
    events.extend(text.iter().map(|text| delta(&json!({"content": text}), None)));
    events.push(delta(&json!({}), Some("stop")));
    events.extend([USAGE.to_owned(), "[DONE]".to_owned()]);
    let events: Vec<&str> = events.iter().map(String::as_str).collect();
    Answer::stream(&events)
}

fn response(text: &str) -> Answer {
    Answer::json(
        200,
        &json!({
            "id": "resp_1", "object": "response", "status": "completed", "model": "mock-1", "error": null,
            "output": [
                {"type": "reasoning", "summary": []},
                {"type": "message", "role": "assistant", "content": [{"type": "output_text", "text": text, "annotations": []}]},
            ],
            "usage": {"input_tokens": 90, "output_tokens": 1, "total_tokens": 91},
        }),
    )
}

#[test]
fn reply_is_same_by_every_wire() {
    let whole = ask(vec![Answer::text("B.")]).result.unwrap();
    let pieces = ask_with(vec![streamed(&["B", "."])], sending(), by(WireSetting::ChatStream));
    let response = ask_with(vec![response("B.")], sending(), by(WireSetting::Responses));
    assert_eq!(pieces.requests[0]["stream"], true);
    assert_eq!(pieces.requests[0]["stream_options"], json!({"include_usage": true}));
    let whole = comparable(whole);
    assert_eq!(comparable(pieces.result.unwrap()), whole);
    assert_eq!(comparable(response.result.unwrap()), whole);
    assert_eq!(whole.usage.unwrap().total(), Some(91));
}

#[test]
fn responses_request_has_correct_form() {
    let parameters = Parameters { reasoning_effort: Some("low".into()), ..by(WireSetting::Responses) };
    let outcome = ask_with(vec![response("B")], sending(), parameters);
    outcome.result.unwrap();
    let mut body = outcome.requests[0].clone();
    let url = body["input"][0]["content"][1]["image_url"].take();
    assert!(url.as_str().unwrap().starts_with("data:image/png;base64,"));
    let expected = json!({
        "model": "m", "store": false, "temperature": 0.0, "max_output_tokens": 1024, "reasoning": {"effort": "low"},
        "input": [{"role": "user", "content": [
            {"type": "input_text", "text": "Red?"},
            {"type": "input_image", "image_url": null},
        ]}],
    });
    assert_eq!(body, expected);
}

/// Refusals, the answers after them, and the request field that identifies the wire.
#[test]
fn auto_learns_wire_from_refusal() {
    let cases = [
        (
            Answer::error(
                400,
                "invalid_parameter_error",
                "This model only support stream mode, please enable the stream parameter to access the model.",
            ),
            streamed(&["B"]),
            "stream",
            "chat-stream",
        ),
        (
            Answer::error(
                404,
                "model_not_found",
                "This model is only supported in v1/responses and not in v1/chat/completions.",
            ),
            response("B"),
            "input",
            "responses",
        ),
    ];
    check_rows(cases, |(refusal, answer, field, wire)| {
        let outcome = ask(vec![refusal.clone(), answer]);
        let reply = outcome.result.unwrap();
        assert_eq!((reply.text.as_str(), reply.attempts), ("B", 2));
        assert!(outcome.requests[0].get(field).is_none());
        assert!(outcome.requests[1].get(field).is_some());
        // What the user has said is never changed.
        let outcome = ask_with(vec![refusal], sending(), by(WireSetting::Chat));
        let error = outcome.result.unwrap_err();
        assert_eq!((error.reach, error.attempts), (Reach::Endpoint, 1));
        let message = error.failure.message;
        assert!(message.contains(&format!("--request wire={wire}")), "{message}");
    });
}

#[test]
fn stream_without_usage_is_repeated() {
    let refusal = Answer::error(400, "unknown_parameter", "Unknown parameter: 'stream_options'.");
    let outcome = ask_with(vec![refusal, streamed(&["B"])], sending(), by(WireSetting::ChatStream));
    assert_eq!(outcome.result.unwrap().attempts, 2);
    assert!(outcome.requests[1].get("stream_options").is_none());
    assert_eq!(outcome.requests[1]["stream"], true);
}

#[test]
fn broken_stream_is_asked_again() {
    let piece = delta(&json!({"content": "A"}), None);
    let error = r#"{"error":{"message":"overloaded","code":529}}"#;
    let broken = [
        Answer::stream(&[&piece]),
        Answer::stream(&[&piece, error]),
        Answer::stream(&[&piece, "{\"choi"]),
        streamed(&["A"]).cut(60),
    ];
    check_rows(broken, |broken| {
        let outcome = ask_with(vec![broken, streamed(&["B"])], sending(), by(WireSetting::ChatStream));
        let reply = outcome.result.unwrap();
        assert_eq!((reply.text.as_str(), reply.attempts), ("B", 2));
    });
}

/// The timeout of a stream is for its silence, that of a whole reply for all of it.
#[test]
fn stream_may_outlast_timeout_unless_silent() {
    let impatient = Sending { timeout: Duration::from_millis(300), retries: 0, ..sending() };
    let slow = ask_with(vec![streamed(&["B"]).drip(2)], impatient, by(WireSetting::ChatStream));
    assert!(slow.time > Duration::from_millis(600), "{:?}", slow.time);
    assert_eq!(slow.result.unwrap().text, "B");
    let whole = Answer::message(&json!({"content": "B".repeat(300)}), "stop").drip(2);
    let whole = ask_with(vec![whole], impatient, by(WireSetting::Chat));
    assert_eq!(whole.result.unwrap_err().failure.kind, FailureKind::Timeout);
    for silent in [Answer::silent(), Answer::stuck()] {
        let outcome = ask_with(vec![silent], impatient, by(WireSetting::ChatStream));
        let failure = outcome.result.unwrap_err().failure;
        assert_eq!(failure.kind, FailureKind::Timeout);
        assert!(failure.message.contains("--timeout"), "{}", failure.message);
    }
}

/// The key of these tests, as a server might repeat it in a field that is kept; shortening must not leave half of it.
#[test]
fn finish_reason_hides_keys() {
    let key = "sk-0123456789abcdef";
    for before in ["", "a reason that is just so long, ", "ab\u{7}"] {
        let reason = format!("{before}{key}");
        let outcome = ask(vec![Answer::message(&json!({"content": key}), &reason)]);
        let reply = outcome.result.unwrap();
        let Finish::Other(kept) = &reply.finish else {
            panic!("{reply:?}");
        };
        assert!(!kept.contains("sk-") && !kept.contains(char::is_control));
        assert!(!format!("{reply:?}").contains("sk-0"), "{reply:?}");
    }
}
