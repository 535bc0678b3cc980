//! Truncated replies, which a larger token limit asks again in the same folder.

use serde_json::{Value, json};

use crate::support::endpoint::{Answer, MockEndpoint};
use crate::support::run::{Bench, Called, model_args, records, words};
use crate::support::snapshot::redacted;

/// An endpoint whose model needs more than 64 tokens for the first four questions.
fn thinking() -> MockEndpoint {
    MockEndpoint::answering(|body| {
        let text = body["messages"][0]["content"].to_string();
        let is_long = (0..4).any(|i| text.contains(&format!("is it, {i}?")));
        if is_long && body["max_tokens"].as_u64().unwrap() <= 64 {
            Answer::message(&json!({"content": "Let me see"}), "length")
        } else {
            Answer::text("C")
        }
    })
}

fn call(bench: &Bench, mock: &MockEndpoint, more: &str) -> Called {
    let base = mock.base_url();
    let line = format!("--data set.jsonl --levels L0 --out run {more}");
    bench.call(&model_args(&base, &line))
}

fn summary(bench: &Bench) -> Value {
    let text = std::fs::read_to_string(bench.path("run/summary.json")).unwrap();
    serde_json::from_str(&text).unwrap()
}

#[test]
fn larger_limit_repeats_truncated_only() {
    let (bench, mock) = (Bench::with_questions(10), thinking());
    let first = call(&bench, &mock, "--max-tokens 64");
    assert_eq!((first.code, mock.requests().len()), (Some(0), 10));
    let again = call(&bench, &mock, "--max-tokens 64");
    assert_eq!((again.code, mock.requests().len()), (Some(0), 10));

    let grown = call(&bench, &mock, "--max-tokens 512");
    assert_eq!((grown.code, mock.requests().len()), (Some(0), 14), "{grown:?}");
    insta::assert_snapshot!(grown.messages(), @"
    exit code: 0
    4 truncated replies are asked again with the larger --max-tokens
    ");
    let limits = |limit: Option<u64>| {
        let records = records(&bench.path("run"));
        let of_limit = |record: &&Value| record["max_tokens"].as_u64() == limit;
        records.iter().filter(of_limit).count()
    };
    assert_eq!((limits(None), limits(Some(512))), (10, 4));
    insta::assert_snapshot!(grown.lines_with("100.0"), @"
    exit code: 0
    untouched 100.0   −27.8 0.0
    ");
    let alerts = summary(&bench)["alerts"].to_string();
    assert!(alerts.contains("6 replies with 64, 4 replies with 512"), "{alerts}");

    // Nothing is asked again with this limit, a larger one, or the first.
    for limit in ["512", "4096", "64"] {
        let on = call(&bench, &mock, &format!("--max-tokens {limit}"));
        assert_eq!((on.code, mock.requests().len()), (Some(0), 14), "{on:?}");
    }
}

#[test]
fn twice_truncated_reply_is_repeated() {
    let bench = Bench::with_questions(3);
    let mock = MockEndpoint::start([Answer::message(&json!({"content": "Let me"}), "length")]);
    for (limit, requests) in [(64, 3), (64, 3), (128, 6), (128, 6), (256, 9)] {
        call(&bench, &mock, &format!("--max-tokens {limit}"));
        assert_eq!(mock.requests().len(), requests, "{limit}");
    }
}

#[test]
fn failure_does_not_replace_truncated_reply() {
    let bench = Bench::with_questions(2);
    let cut = Answer::message(&json!({"content": "It is B. Let me"}), "length");
    let refused = Answer::error(400, "x", "no");
    let mock = MockEndpoint::start([cut.clone(), cut, refused.clone(), refused]);
    call(&bench, &mock, "--max-tokens 64 --concurrency 1");
    call(&bench, &mock, "--max-tokens 128 --concurrency 1");
    assert_eq!(mock.requests().len(), 4);
    let manifest = std::fs::read_to_string(bench.path("run/manifest.json")).unwrap();
    let manifest: Value = serde_json::from_str(&manifest).unwrap();
    assert_eq!(manifest["counts"]["answered"], 2, "{}", manifest["counts"]);
}

#[test]
fn another_smaller_limit_is_another_run() {
    let (bench, mock) = (Bench::with_questions(2), thinking());
    call(&bench, &mock, "--max-tokens 512");
    let smaller = call(&bench, &mock, "--max-tokens 64");
    insta::assert_snapshot!(smaller.messages(), @"
    exit code: 2
    error: run: the model m has another --max-tokens in this run: it was 512, now it is 64; use another --out, or
        the same --max-tokens
    ");
    let dry = model_words(&bench, &mock, "--max-tokens 1024 --dry-run");
    insta::assert_snapshot!(redacted(&dry), @"
    Nothing was sent. 0 of 2 trials are left to ask.
    power: 2 questions detects no difference between two conditions; 5 points need about 794 questions (one model;
        level 3.33 % after correction; assumed: 20 % of answers change without an effect, correlation 0.05 in a
        question)
    only 1 frame (8 are needed): intervals and tests would be rough
    ");
}

fn model_words(bench: &Bench, mock: &MockEndpoint, more: &str) -> String {
    let base = mock.base_url();
    let line = format!("--data set.jsonl --levels L0 --out run {more}");
    let args = [&words("--model m --base-url")[..], &[&*base], &words(&line)].concat();
    bench.complete(&args)
}
