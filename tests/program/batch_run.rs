//! `batch run`: batches that the program submits and waits for, at a mock server whose batches take every course.

use std::collections::BTreeSet;

use serde_json::json;

use crate::support::batches::{Course, Fault, Line, MockBatches, Order};
use crate::support::endpoint::Answer;
use crate::support::run::{Bench, Called, records, words};

const QUESTIONS: usize = 4;

/// The run, without its endpoint: L0, L3 in both variants, and blind, so 4 conditions of 4 questions.
const RUN: &str =
    "batch run --data set.jsonl --model m --blind-model m --levels L0,L3 --out run --poll 0.02";

/// The number of its trials, of those with images, and of those without.
const TRIALS: usize = 16;

fn call(bench: &Bench, mock: &MockBatches, more: &str) -> Called {
    let base = mock.base_url();
    let args = [words(RUN), vec!["--base-url", &base], words(more)].concat();
    bench.call(&args)
}

/// Asserts that the run is complete, each trial has one reply, and each was asked once.
fn assert_complete(bench: &Bench, mock: &MockBatches) {
    let records = records(&bench.path("run"));
    let answered = records
        .iter()
        .filter(|record| record["outcome"] != "failed");
    let keys: Vec<&str> = answered
        .map(|record| record["key"].as_str().unwrap())
        .collect();
    let distinct: BTreeSet<&str> = keys.iter().copied().collect();
    assert_eq!((keys.len(), distinct.len()), (TRIALS, TRIALS));
    let asked = mock.asked().concat();
    let distinct: BTreeSet<&String> = asked.iter().collect();
    assert_eq!(asked.len(), distinct.len(), "a request is in two batches");
}

#[test]
fn batches_are_submitted_and_their_replies_taken_over() {
    let bench = Bench::with_questions(QUESTIONS);
    let mock = MockBatches::start([Course::of("validating in_progress finalizing completed")]);
    let called = call(&bench, &mock, "");
    assert_eq!(called.code, Some(0), "{called:?}");
    assert_complete(&bench, &mock);
    // Two directly, one of each view, before the batches.
    assert_eq!(mock.count("POST chat/completions"), 2);
    assert_eq!(
        (mock.count("POST files"), mock.count("POST batches")),
        (2, 2)
    );
    let records = records(&bench.path("run"));
    let batched = records.iter().filter(|record| record["via"] == "batch");
    assert_eq!(batched.count(), TRIALS - 2);
    // Nothing stays at the server.
    mock.with(|server| assert!(server.files.iter().all(|file| file.deleted)));
    // Nothing is asked twice.
    let again = call(&bench, &mock, "");
    assert_eq!((again.code, mock.count("POST batches")), (Some(0), 2));
}
