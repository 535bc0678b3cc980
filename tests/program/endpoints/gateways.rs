//! Gateways in whole runs: long requests that they cut, models that they replace, and keys that are renewed.

use std::sync::atomic::{AtomicUsize, Ordering};

use serde_json::{Value, json};

use crate::support::endpoint::{Answer, MockEndpoint};
use crate::support::run::{Bench, Called, model_args, records};
use crate::support::snapshot::redacted;

const RUN: &str = "--data set.jsonl --out run";

fn call(bench: &Bench, mock: &MockEndpoint, more: &str) -> Called {
    let base = mock.base_url();
    bench.call(&model_args(&base, &format!("{RUN} --levels L0 {more}")))
}

/// A gateway that cuts every reply in one piece to these questions.
fn cutting(is_cut: fn(&str) -> bool) -> MockEndpoint {
    MockEndpoint::answering(move |body| {
        let text = body["messages"][0]["content"].to_string();
        if body["stream"] == true {
            return Answer::streamed_text("C");
        }
        if is_cut(&text) { Answer::new(524, "<html><title>524: A timeout occurred</title>") } else { Answer::text("C") }
    })
}

fn long(text: &str) -> bool {
    text.contains("is it, 3?")
}

#[test]
fn streams_replace_cut_replies() {
    let (bench, mock) = (Bench::with_questions(8), cutting(long));
    let called = call(&bench, &mock, "--concurrency 1");
    assert_eq!((called.code, mock.requests().len()), (Some(0), 9));
    let streamed = mock.requests().iter().filter(|request| request.json()["stream"] == true).count();
    assert_eq!(streamed, 5, "the cut one, and the four after it");
    insta::assert_snapshot!(redacted(&called.stderr), @r#"
    WARN m: http://127.0.0.1:[PORT]/v1 answered 524: an HTML page titled "524: A timeout occurred"; asked again
       as a stream, as all would be with --request wire=chat-stream
    WARN m: its replies are streamed for the rest of the run, because a gateway does not wait for a long one in
       one piece
    "#);
    let manifest = std::fs::read_to_string(bench.path("run/manifest.json")).unwrap();
    let manifest: Value = serde_json::from_str(&manifest).unwrap();
    assert_eq!(
        manifest["settings"]["adapted for m"],
        json!([
            "its replies are streamed",
            "replies that a gateway cut were asked for as streams (--request wire=chat-stream)"
        ])
    );
}

#[test]
fn cut_trial_is_asked_once_in_next_call() {
    let (bench, mock) = (Bench::with_questions(8), cutting(long));
    let first = call(&bench, &mock, "--wire chat");
    assert_eq!((first.code, mock.requests().len()), (Some(1), 9));
    insta::assert_snapshot!(redacted(&first.stderr), @r#"
    WARN m: a trial about a.png failed: http://127.0.0.1:[PORT]/v1 answered 524: an HTML page titled "524: A
       timeout occurred" (given up: a gateway ends the request before the reply is complete, and the server may
       charge it each time; --request wire=chat-stream asks for a stream, which gateways let through)
    "#);
    let second = call(&bench, &mock, "--wire chat");
    assert_eq!((second.code, mock.requests().len()), (Some(1), 10));
    insta::assert_snapshot!(redacted(&second.stderr), @r#"
    WARN 1 trial was given up by a gateway in an earlier call, and may have been charged: it is asked once more,
       as a stream if --request wire permits, and given up at the next timeout
    WARN m: a trial about a.png failed: http://127.0.0.1:[PORT]/v1 answered 524: an HTML page titled "524: A
       timeout occurred" (given up: a gateway ends the request before the reply is complete, and the server may
       charge it each time; --request wire=chat-stream asks for a stream, which gateways let through)
    "#);
    let third = call(&bench, &mock, "--wire chat-stream");
    assert_eq!((third.code, mock.requests().len()), (Some(0), 11));
    let stored = records(&bench.path("run"));
    assert_eq!(stored.iter().filter(|record| record["failure"].is_null()).count(), 8);
}

/// An endpoint that names these models in turn.
fn serving(names: &'static [&'static str]) -> MockEndpoint {
    let asked = AtomicUsize::new(0);
    MockEndpoint::answering(move |_| {
        let name = names[asked.fetch_add(1, Ordering::SeqCst) % names.len()];
        let message = json!({"role": "assistant", "content": "C"});
        Answer::json(200, &json!({"model": name, "choices": [{"message": message, "finish_reason": "stop"}]}))
    })
}

/// Warnings and alerts about served models.
fn about_served(bench: &Bench, mock: &MockEndpoint, more: &str) -> String {
    let base = mock.base_url();
    let line = format!("{RUN} --concurrency 1 --model gpt-4o --base-url {base} --api-key-env none {more}");
    let called = bench.call(&crate::support::run::words(&line)).ended(0);
    let warnings = called.stderr.lines().filter(|line| line.contains("gpt-4o"));
    let summary = std::fs::read_to_string(bench.path("run/summary.json")).unwrap();
    let summary: Value = serde_json::from_str(&summary).unwrap();
    let alerts = summary["alerts"].as_array().unwrap().iter();
    let alerts = alerts.map(|alert| alert["text"].as_str().unwrap_or_default()).filter(|text| text.contains("gpt-4o"));
    let lines: Vec<&str> = warnings.chain(alerts).collect();
    redacted(&lines.join("\n"))
}

#[test]
fn changed_model_is_an_alert() {
    let bench = Bench::with_questions(4);
    let mock = serving(&["gpt-4o-2024-08-06", "gpt-4o-mini-2024-07-18"]);
    let text = about_served(&bench, &mock, "--levels L0,L3 --variant ev");
    assert!(text.contains("its replies name several models"), "{text}");
    assert!(text.contains("gpt-4o was served as"), "{text}");
    assert_eq!(text.matches("(2 at L0, 2 at L3").count(), 2, "{text}");
}

#[test]
fn other_model_is_an_alert() {
    let bench = Bench::with_questions(4);
    let mock = serving(&["qwen2-vl-2b-instruct"]);
    insta::assert_snapshot!(about_served(&bench, &mock, "--levels L0"), @"
     WARN gpt-4o: its replies name another model, qwen2-vl-2b-instruct: check which model the server has loaded,
        or serves under this name
    Replies of gpt-4o name another model: qwen2-vl-2b-instruct. Check which model the server has loaded, or serves
        under this name.
    ");
}

#[test]
fn one_snapshot_is_no_alert() {
    let bench = Bench::with_questions(4);
    let mock = serving(&["gpt-4o-2024-11-20"]);
    assert_eq!(about_served(&bench, &mock, "--levels L0"), "");
}

#[test]
fn fallbacks_in_headers_are_an_alert() {
    for (fallbacks, is_alert) in [("1", true), ("0", false)] {
        let bench = Bench::with_questions(4);
        let asked = AtomicUsize::new(0);
        let mock = MockEndpoint::answering(move |_| {
            let is_fallback = asked.fetch_add(1, Ordering::SeqCst) % 2 == 1;
            let answer = Answer::json(
                200,
                &json!({"model": "gpt-4o", "choices": [{"message": {"content": "C"}, "finish_reason": "stop"}]}),
            );
            let (count, group) = if is_fallback && fallbacks == "1" { ("1", "gpt-4o-mini") } else { ("0", "gpt-4o") };
            answer.header("x-litellm-attempted-fallbacks", count).header("x-litellm-model-group", group)
        });
        let text = about_served(&bench, &mock, "--levels L0");
        assert_eq!(text.contains("gpt-4o-mini (2 at L0)"), is_alert, "{text}");
        assert_eq!(text.is_empty(), !is_alert, "{text}");
    }
}

/// The key of the file is replaced while the run asks.
#[test]
fn renewed_key_of_file_is_used() {
    let bench = Bench::with_questions(6);
    let file = bench.file("key", "sk-first-0123456789\n");
    let sent = AtomicUsize::new(0);
    let mock = MockEndpoint::watching(move |request| {
        let is_expired = sent.fetch_add(1, Ordering::SeqCst) >= 2;
        if is_expired && request.header("authorization") == Some("Bearer sk-first-0123456789") {
            std::fs::write(&file, "sk-second-0123456789\n").unwrap();
            return Answer::error(401, "x", "expired: sk-first-0123456789");
        }
        // A server that repeats the key.
        Answer::text(&format!("C {}", request.header("authorization").unwrap()))
    });
    let called = call(&bench, &mock, "--concurrency 1 --api-key-file key");
    assert_eq!((called.code, mock.requests().len()), (Some(0), 7), "{called:?}");
    let stored = format!("{called:?} {:?}", records(&bench.path("run")));
    assert!(!stored.contains("sk-"), "{stored}");

    // The same key again is refused for good.
    let bench = Bench::with_questions(6);
    bench.file("key", "sk-first-0123456789\n");
    let mock = MockEndpoint::start([Answer::error(401, "x", "no")]);
    let called = call(&bench, &mock, "--api-key-file key");
    assert_eq!((called.code, mock.requests().len()), (Some(2), 1), "{called:?}");
}
