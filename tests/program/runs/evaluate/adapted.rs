//! Requests that a server refuses for one of their fields, in whole runs.

use std::sync::atomic::{AtomicUsize, Ordering};

use crate::support::endpoint::{Answer, MockEndpoint};
use crate::support::run::{Bench, model_args, records, words};
use crate::support::snapshot::lines_with;
use crate::support::table::check_rows;
use serde_json::{Value, json};

use super::text;

fn refusal(param: &str, message: &str) -> Answer {
    let error = json!({"message": message, "param": param, "code": "unsupported_value"});
    Answer::json(400, &json!({ "error": error }))
}

fn manifest(bench: &Bench) -> Value {
    serde_json::from_slice(&std::fs::read(bench.path("run/manifest.json")).unwrap()).unwrap()
}

/// Questions that all share one image, so that a refusal of each would be the same.
#[test]
fn refused_field_is_reported() {
    let bench = Bench::with_questions(30);
    let mock = MockEndpoint::answering(|body| match body.get("temperature") {
        Some(_) => refusal("temperature", "`temperature` is deprecated for this model."),
        None => Answer::text("C"),
    });
    let base = mock.base_url();
    let args = "--data set.jsonl --levels L0 --out run";
    let printed = bench.complete(&model_args(&base, args));
    assert_eq!(mock.requests().len(), 31);
    let noted = json!(["no temperature is sent: the server's own is used"]);
    assert_eq!(manifest(&bench)["settings"]["adapted for m"], noted);
    insta::assert_snapshot!(
        lines_with(&printed, "Requests"),
        @"! Requests to m were changed, because what was sent first was refused or not"
    );
    // A run in which nothing was refused says nothing of it.
    let other = Bench::with_questions(3);
    let mock = MockEndpoint::start([Answer::text("C")]);
    let printed = other.complete(&model_args(&mock.base_url(), args));
    assert!(!printed.contains("were changed"), "{printed}");
}

/// Flags, what the server says to them, and what stands in the message: its words and the flag.
#[test]
fn what_user_asked_for_stops_run() {
    let rows = [
        (
            "--temperature 0.5",
            refusal("temperature", "Unsupported value: only 1 is supported."),
            ["only 1 is supported", "--temperature"],
        ),
        (
            "--reasoning-effort minimal",
            refusal(
                "reasoning_effort",
                "Unsupported value: 'minimal'. Supported values are: 'none', 'low' and 'high'.",
            ),
            ["'none', 'low' and 'high'", "--reasoning-effort"],
        ),
        (
            "--request token-field=max_tokens",
            Answer::json(
                422,
                &json!({"detail": [{"loc": ["body", "max_tokens"], "msg": "Extra inputs are not permitted"}]}),
            ),
            ["Extra inputs are not permitted", "--request token-field"],
        ),
        (
            "--request wire=chat",
            Answer::error(400, "x", "This model only support stream mode"),
            ["only support stream mode", "--request wire=chat-stream"],
        ),
    ];
    check_rows(rows, |(flags, answer, expected)| {
        let bench = Bench::with_questions(30);
        let mock = MockEndpoint::start([answer]);
        let base = mock.base_url();
        let args = model_args(&base, "--data set.jsonl --levels L0 --out run");
        let called = bench.call(&[args, words(flags)].concat());
        assert_eq!(called.code, Some(2), "{called:?}");
        for words in expected {
            assert!(called.stderr.contains(words), "{}", called.stderr);
        }
        assert_eq!(mock.requests().len(), 1, "{flags}");
    });
}

/// The same trials by each wire, but for the Responses API where it is asked for.
#[test]
fn discovered_wire_keeps_trial_key() {
    let bench = Bench::with_questions(3);
    let stream_only = MockEndpoint::answering(|body| {
        if body.get("stream").is_none() {
            return Answer::error(400, "x", "please enable the stream parameter");
        }
        Answer::streamed_text("C")
    });
    let base = stream_only.base_url();
    let run = |flags: &str| {
        let args = model_args(&base, "--data set.jsonl --levels L0");
        bench.complete(&[args, words(flags)].concat());
    };
    run("--out run");
    assert_eq!(stream_only.requests().len(), 4);
    let noted = json!(["its replies are streamed"]);
    assert_eq!(manifest(&bench)["settings"]["adapted for m"], noted);
    // The same trials: nothing is asked.
    run("--out run --wire chat-stream");
    assert_eq!(stream_only.requests().len(), 4);
    let replies = records(&bench.path("run"));
    assert!(replies.iter().all(|record| text(record, "reply") == "C"));
}

/// A router may pass a later request on to a provider that takes less: no trial and no retry is lost by it.
#[test]
fn late_refused_field_costs_no_trial() {
    let bench = Bench::with_questions(40);
    let asked = AtomicUsize::new(0);
    let mock = MockEndpoint::answering(move |body| {
        let before = asked.fetch_add(1, Ordering::SeqCst);
        if before >= 10 && body.get("temperature").is_some() {
            return refusal("temperature", "'temperature' is deprecated for this model.");
        }
        Answer::text("C")
    });
    let line = "--data set.jsonl --levels L0 --out run --retries 0 --concurrency 8";
    bench.complete(&model_args(&mock.base_url(), line));
    let records = records(&bench.path("run"));
    assert_eq!(records.len(), 40);
    assert!(records.iter().all(|record| record["outcome"] == "right"));
    // Each of those in flight was refused once at most.
    let refused = mock.requests().len() - 40;
    assert!((1..=8).contains(&refused), "{refused}");
    assert_eq!(
        manifest(&bench)["settings"]["adapted for m"],
        json!(["no temperature is sent: the server's own is used"])
    );
}
