//! Replies without content whose text is in another field.

use serde_json::{Value, json};

use crate::support::endpoint::{Answer, MockEndpoint};
use crate::support::run::{Bench, Called, model_args, records, words};
use crate::support::snapshot::on_one_line;

/// A run of six questions against an endpoint that sends this message each time.
fn run(bench: &Bench, message: Value, more: &str) -> Called {
    let mock = MockEndpoint::answering(move |_| Answer::message(&message, "stop"));
    let base = mock.base_url();
    let own = words("--data set.jsonl --levels L0 --out run --full");
    bench.call(&[own, words(more), model_args(&base, "")].concat())
}

fn replies(bench: &Bench) -> Vec<Value> {
    let mut replies: Vec<Value> =
        records(&bench.path("run")).into_iter().map(|record| record["reply"].clone()).collect();
    replies.dedup();
    replies
}

#[test]
fn letters_among_the_thoughts_are_read() {
    let bench = Bench::with_questions(6);
    let message = json!({"content": null, "reasoning_content": "B", "tool_calls": []});
    let called = run(&bench, message, "--thinking off");
    assert_eq!(replies(&bench), [json!("B")]);
    insta::assert_snapshot!(called.lines_with("reasoning"), @r#"
    exit code: 0
    WARN m: answers come in the field "reasoning_content", with an empty content, and are read there; the server
        may take them for thoughts (start it without a reasoning parser) or for tool calls
    "#);
}

/// Thoughts are never read, whatever they name; the run and the report say where the text is.
#[test]
fn sentences_among_the_thoughts_are_named() {
    for (message, more) in [
        (json!({"content": "", "reasoning": "The answer is B."}), "--thinking off"),
        (json!({"content": "", "zork_text": "The answer is B."}), ""),
        (json!({"content": null, "reasoning": "B"}), "--thinking on"),
    ] {
        let bench = Bench::with_questions(6);
        let called = run(&bench, message, more);
        let report = bench.complete(&["report", "run"]);
        let texts = [called.stderr, report];
        let phrases = ["is not read as an answer", "are empty, although"];
        for (text, phrase) in texts.iter().zip(phrases) {
            assert!(on_one_line(text).contains(phrase), "{text}");
        }
        assert!(!replies(&bench).contains(&json!("B")));
    }
}

#[test]
fn answers_in_tool_calls_are_read() {
    let bench = Bench::with_questions(6);
    let function = json!({"name": "reply", "arguments": "{\"answer\": \"B\"}"});
    let message = json!({"content": null, "tool_calls": [{"id": "1", "type": "function", "function": function}]});
    let called = run(&bench, message, "");
    assert_eq!(replies(&bench), [json!("B")]);
    assert!(called.stderr.contains("tool_calls (answer, reply)"), "{called:?}");
}

#[test]
fn thoughts_beside_a_content_get_no_warning() {
    let bench = Bench::with_questions(6);
    let message = json!({"content": "B", "reasoning_content": "A?"});
    let called = run(&bench, message, "");
    assert_eq!(replies(&bench), [json!("B")]);
    assert!(!called.stderr.contains("field"), "{called:?}");
}
