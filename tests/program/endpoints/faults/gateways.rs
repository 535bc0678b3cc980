//! Gateways that give up on long requests, streams that break off, and servers that load a model: what is sent again,
//! and how often.

use darkqa_base::types::{FailureKind, Finish};
use darkqa_eval::internals::ask::{Parameters, Reach, Sending, WireSetting};
use serde_json::Value;

use super::{Outcome, PIECE, ask, ask_with, sending};
use crate::support::endpoint::Answer;
use crate::support::snapshot::redacted;
use crate::support::table::check_rows;

const DONE: &str = "[DONE]";
const STOP: &str = r#"{"choices":[{"index":0,"delta":{"content":"B"},"finish_reason":"stop"}]}"#;

/// Cloudflare's page, which comes after 100 s.
fn cut() -> Answer {
    let page = "<!DOCTYPE html><title>llm.example | 524: A timeout occurred</title>";
    Answer::new(524, page).header("content-type", "text/html")
}

fn ask_by(wire: WireSetting, answers: Vec<Answer>) -> Outcome {
    let parameters = Parameters { wire, ..Parameters::new("m".into()) };
    ask_with(answers, sending(), parameters)
}

fn is_stream(request: &Value) -> bool {
    request["stream"] == true
}

#[test]
fn cut_request_is_asked_as_stream() {
    let outcome = ask(vec![cut(), Answer::stream(&[STOP, DONE])]);
    let reply = outcome.result.unwrap();
    assert_eq!((reply.text.as_str(), reply.attempts), ("B", 2));
    assert!(!is_stream(&outcome.requests[0]) && is_stream(&outcome.requests[1]));
}

#[test]
fn cut_requests_are_sent_twice() {
    use WireSetting::{Auto, Chat, ChatStream, Responses};
    for (wire, remedy) in [
        (Auto, "--thinking off"),
        (Chat, "--request wire=chat-stream asks for a stream"),
        (ChatStream, "--thinking off"),
        (Responses, "if the model takes chat completions"),
    ] {
        let outcome = ask_by(wire, vec![cut()]);
        let error = outcome.result.unwrap_err();
        assert_eq!((error.attempts, outcome.requests.len()), (2, 2), "{wire:?}");
        assert_eq!(error.failure.kind, FailureKind::Timeout);
        assert_eq!((error.failure.status, error.reach), (Some(524), Reach::Trial));
        assert!(error.failure.message.contains(remedy), "{wire:?}: {error}");
    }
}

#[test]
fn paid_retries_decide_about_cut_requests() {
    for (paid_retries, sent) in [(0, 1), (1, 2), (3, 4)] {
        let sending = Sending { paid_retries, ..sending() };
        let outcome = ask_with(vec![cut()], sending, Parameters::new("m".into()));
        assert_eq!(outcome.requests.len(), sent);
    }
}

#[test]
fn refused_stream_is_not_repeated() {
    let refused = Answer::error(400, "x", "Streams are switched off here.");
    let outcome = ask(vec![cut(), refused, cut()]);
    let error = outcome.result.unwrap_err();
    assert_eq!(outcome.requests.len(), 3);
    assert!(is_stream(&outcome.requests[1]) && !is_stream(&outcome.requests[2]));
    insta::assert_snapshot!(redacted(&error.failure.message), @r#"
    http://127.0.0.1:[PORT]/v1 answered 524: an HTML page titled "llm.example | 524: A timeout occurred" (given
        up: a gateway ends the request before the reply is complete, and the server may charge it each time; a
        shorter reply helps (--thinking off, a lower --reasoning-effort or --max-tokens), or an address without
        the gateway)
    "#);
    assert_eq!(error.reach, Reach::Trial);
}

/// A server that is down for a moment.
#[test]
fn quick_timeouts_are_retried() {
    let down = || Answer::new(504, "<title>504 Gateway Time-out</title>");
    let outcome = ask(vec![down(), down(), down(), down(), Answer::text("B")]);
    assert_eq!(outcome.result.unwrap().attempts, 5);
    assert!(!outcome.requests.iter().any(is_stream));
    let outcome = ask(vec![down()]);
    let error = outcome.result.unwrap_err();
    assert_eq!((error.attempts, error.failure.kind), (6, FailureKind::Server));
}

#[test]
fn broken_streams_are_sent_twice() {
    let broken = [
        Answer::stream(&[PIECE]),
        Answer::stream(&[PIECE, "{\"choi"]),
        Answer::raw(format!(
            "HTTP/1.1 200 OK\r\ncontent-type: text/event-stream\r\ncontent-length: 999\r\n\r\ndata: {PIECE}\n\n"
        )),
    ];
    check_rows(broken, |answer| {
        let outcome = ask_by(WireSetting::ChatStream, vec![answer]);
        let error = outcome.result.unwrap_err();
        assert_eq!(outcome.requests.len(), 2, "{error}");
        assert!(error.failure.message.contains("--retries paid"), "{error}");
    });
    // Nothing was generated.
    let outcome = ask_by(WireSetting::ChatStream, vec![Answer::stream(&[DONE])]);
    assert_eq!(outcome.requests.len(), 6);
}

#[test]
fn stream_without_finish_reason_is_read_once() {
    let counts = r#"{"choices":[],"usage":{"prompt_tokens":9,"completion_tokens":1}}"#;
    check_rows([vec![PIECE, DONE], vec![PIECE, counts], vec![PIECE, counts, DONE]], |events| {
        let outcome = ask_by(WireSetting::ChatStream, vec![Answer::stream(&events)]);
        let reply = outcome.result.unwrap();
        assert_eq!((reply.text.as_str(), reply.attempts), ("B", 1));
        assert_eq!(reply.finish, Finish::Unknown);
    });
}

fn patient() -> Sending {
    Sending { retries: 1, ..sending() }
}

#[test]
fn loading_model_is_waited_for() {
    let loading = || Answer::error(503, "503", "Loading model");
    let mut answers: Vec<Answer> = (0..8).map(|_| loading()).collect();
    answers.push(Answer::text("B"));
    let outcome = ask_with(answers, patient(), Parameters::new("m".into()));
    assert_eq!(outcome.result.unwrap().attempts, 9);
    let impatient = Sending { patience: std::time::Duration::from_millis(200), ..patient() };
    let outcome = ask_with(vec![loading()], impatient, Parameters::new("m".into()));
    let error = outcome.result.unwrap_err();
    assert_eq!(error.reach, Reach::Endpoint);
    assert!(error.failure.message.contains("--retries patience"), "{error}");
}
