//! `batch run`: batches that the program submits and waits for, at a mock server whose batches take every course.

mod ends;
mod folder;
mod incomplete;
mod killed;
mod limits;
mod of_file;

use std::collections::BTreeSet;

use serde_json::Value;

use crate::support::batches::{Course, Fault, Line, MockBatches};
use crate::support::endpoint::Answer;
use crate::support::house::House;
use crate::support::run::{Bench, Called, model_args, records, words};

const QUESTIONS: usize = 4;

/// The run, without its endpoint: L0, L3 in both variants, and blind, so 4 conditions of 4 questions.
const RUN: &str = "batch run --data set.jsonl --model m --blind-model m --levels L0,L3 --out run --poll 0.02";

/// The number of its trials.
const TRIALS: usize = 16;

/// A run of one batch: the blind trials alone, none asked directly.
const BLIND: &str = "batch run --data set.jsonl --blind-model m --out run --poll 0.02 --no-scout";

/// The same, with one trial asked directly before.
const SCOUTED: &str = "batch run --data set.jsonl --blind-model m --out run --poll 0.02";

fn call_with(run: &str, bench: &Bench, mock: &MockBatches, more: &str) -> Called {
    let base = mock.base_url();
    let args = [words(run), vec!["--base-url", &base], words(more)].concat();
    bench.call(&args)
}

/// A call of the blind run in a new folder, at a server of these courses.
fn blind(courses: &[Course], more: &str) -> (Bench, MockBatches, Called) {
    let bench = Bench::with_questions(QUESTIONS);
    let mock = MockBatches::start(courses.to_vec());
    let called = call_with(BLIND, &bench, &mock, more);
    (bench, mock, called)
}

/// The records of a run with a reply.
fn answered(bench: &Bench) -> Vec<Value> {
    let mut records = records(&bench.path("run"));
    let replies: BTreeSet<String> =
        records.iter().filter(|record| record["outcome"] != "failed").map(|record| record["key"].to_string()).collect();
    records.retain(|record| record["outcome"] != "failed");
    assert_eq!(replies.len(), records.len(), "a trial has two replies");
    records
}

/// Asserts that `trials` trials have one right reply each, and that no trial was in two started batches.
fn assert_each_once(bench: &Bench, mock: &MockBatches, trials: usize) {
    let answered = answered(bench);
    assert_eq!(answered.len(), trials);
    assert!(answered.iter().all(|record| record["outcome"] == "right"));
    let asked = mock.asked().concat();
    let distinct: BTreeSet<&String> = asked.iter().collect();
    assert_eq!(asked.len(), distinct.len(), "a request is in two batches");
}

#[test]
fn batches_are_submitted_and_imported() {
    let bench = Bench::with_questions(QUESTIONS);
    let mock = MockBatches::start([Course::of("validating in_progress finalizing completed")]);
    let called = call_with(RUN, &bench, &mock, "");
    assert_eq!(called.code, Some(0), "{called:?}");
    assert_each_once(&bench, &mock, TRIALS);
    // Two directly, one of each view, before the batches.
    assert_eq!(mock.count("POST chat/completions"), 2);
    assert_eq!((mock.count("POST files"), mock.count("POST batches")), (2, 2));
    let records = records(&bench.path("run"));
    let batched = records.iter().filter(|record| record["via"] == "batch");
    assert_eq!(batched.count(), TRIALS - 2);
    // Nothing stays at the server.
    mock.with(|server| assert!(server.files.iter().all(|file| file.deleted)));
    // Nothing is asked twice.
    let again = call_with(RUN, &bench, &mock, "");
    assert_eq!((again.code, mock.count("POST batches")), (Some(0), 2));
}

#[test]
fn refused_field_costs_one_batch() {
    // Directly before the batches.
    let bench = Bench::with_questions(QUESTIONS);
    let mock = MockBatches::start([Course::of("completed")]);
    let words = "'temperature' is not supported with this model: only the default (1) is supported";
    mock.fault("POST chat/completions", Fault::Instead(Answer::error(400, "unsupported_value", words)));
    let called = call_with(SCOUTED, &bench, &mock, "");
    assert_eq!(called.code, Some(0), "{called:?}");
    assert_eq!((mock.count("POST chat/completions"), mock.asked().len()), (2, 1));
    mock.with(|server| {
        let requests = &server.batches[0].requests;
        assert!(requests.iter().all(|one| one["body"].get("temperature").is_none()));
    });
    // By the batch itself, where nothing was asked directly.
    let refused =
        |_| Line::Status(400, "'temperature' is not supported with this model: only the default (1) is supported");
    let (bench, mock, called) = blind(&[Course::of("completed").lines(refused), Course::of("completed")], "");
    assert_eq!(called.code, Some(0), "{called:?}");
    assert_eq!((mock.asked().len(), answered(&bench).len()), (2, QUESTIONS));
    mock.with(|server| {
        let has = |batch: usize| server.batches[batch].requests[0]["body"].get("temperature").is_some();
        assert_eq!((has(0), has(1)), (true, false));
    });
}

/// The same early end under a known word, an unknown one and two statuses: unread, and in two batches at most.
#[test]
fn early_ends_are_unread_in_batches() {
    fn known(i: usize) -> Line {
        [Line::Right, Line::Ended("content_filter")][i % 2]
    }
    fn unknown(i: usize) -> Line {
        [Line::Right, Line::Ended("NO_IMAGE")][i % 2]
    }
    fn moderated(i: usize) -> Line {
        [Line::Right, Line::Status(403, "Content violates usage guidelines.")][i % 2]
    }
    fn refused(i: usize) -> Line {
        [Line::Right, Line::Status(400, "an odd refusal")][i % 2]
    }
    type Lines = fn(usize) -> Line;
    let rows: [(Lines, Lines, usize); 4] = [
        (known, known, 1),
        (unknown, |_| Line::Ended("NO_IMAGE"), 2),
        (moderated, moderated, 1),
        (refused, |_| Line::Status(400, "an odd refusal"), 2),
    ];
    for (first, second, batches) in rows {
        let courses = [first, second].map(|lines| Course::of("completed").lines(lines));
        let (bench, mock, called) = blind(&courses, "");
        assert_eq!(called.code, Some(0), "{called:?}");
        let answered = answered(&bench);
        let right = answered.iter().filter(|one| one["outcome"] == "right");
        assert_eq!((answered.len(), right.count()), (QUESTIONS, QUESTIONS / 2));
        assert_eq!(mock.asked().len(), batches, "{called:?}");
    }
}

/// What the second batch answers was broken off.
#[test]
fn broken_generation_is_answered_by_the_next_batch() {
    let courses =
        [Course::of("completed").lines(|i| [Line::Right, Line::Ended("zeitgeist")][i % 2]), Course::of("completed")];
    let (bench, mock, called) = blind(&courses, "");
    assert_eq!(called.code, Some(0), "{called:?}");
    let answered = answered(&bench);
    assert!(answered.iter().all(|record| record["outcome"] == "right"));
    assert_eq!((answered.len(), mock.asked().len()), (QUESTIONS, 2));
}

#[test]
fn answers_and_marks_use_batches() {
    let house = House::new();
    let mock = MockBatches::start([
        Course::of("in_progress completed").text("brown"),
        Course::of("in_progress completed").text("Your mark: 4"),
    ]);
    let base = mock.base_url();
    let more = "--judge j --levels L0,L4 --out run --batch-run --no-scout --poll 0.02";
    let called = house.call(&model_args(&base, more));
    insta::assert_snapshot!(called.lines_with("75.0"), @"
    exit code: 0
     m       with noise   75.0   75.0 (0.0)   6 of 6   −72.1 +24.7
     m       with noise   hm3d-v0                 75.0   75.0 (0.0)   −57.6 +22.7
                          scannet-v0              75.0   75.0 (0.0)   −63.2 +23.5
                          attribute recognition   75.0   75.0 (0.0)   −63.2 +23.5
                          object localization     75.0   75.0 (0.0)   −63.2 +23.5
                          world knowledge         75.0   75.0 (0.0)   −63.2 +23.5
    ");
    mock.with(|server| {
        let models: Vec<&Value> = server.batches.iter().map(|one| &one.requests[0]["body"]["model"]).collect();
        assert_eq!(models, ["m", "j"]);
    });
    assert_eq!(mock.count("POST chat/completions"), 0);
}
