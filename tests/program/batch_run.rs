//! `batch run`: batches that the program submits and waits for, at a mock server whose batches take every course.

use std::collections::BTreeSet;
use std::fs;
use std::process::Stdio;
use std::time::Duration;

use serde_json::{Value, json};

use crate::support::batches::{Course, Fault, Line, MockBatches, Order};
use crate::support::endpoint::Answer;
use crate::support::house::House;
use crate::support::process::{signal, wait_until};
use crate::support::run::{Bench, Called, model_args, records, words};

const QUESTIONS: usize = 4;

/// The run, without its endpoint: L0, L3 in both variants, and blind, so 4 conditions of 4 questions.
const RUN: &str =
    "batch run --data set.jsonl --model m --blind-model m --levels L0,L3 --out run --poll 0.02";

/// The number of its trials.
const TRIALS: usize = 16;

/// A run of one batch: the blind trials alone, none asked directly.
const BLIND: &str = "batch run --data set.jsonl --blind-model m --out run --poll 0.02 --no-scout";

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
    let replies: BTreeSet<String> = records
        .iter()
        .filter(|record| record["outcome"] != "failed")
        .map(|record| record["key"].to_string())
        .collect();
    records.retain(|record| record["outcome"] != "failed");
    assert_eq!(replies.len(), records.len(), "a trial has two replies");
    records
}

/// Asserts that so many trials have one right reply each, and that none was in two batches that were begun.
fn assert_each_once(bench: &Bench, mock: &MockBatches, trials: usize) {
    let answered = answered(bench);
    assert_eq!(answered.len(), trials);
    assert!(answered.iter().all(|record| record["outcome"] == "right"));
    let asked = mock.asked().concat();
    let distinct: BTreeSet<&String> = asked.iter().collect();
    assert_eq!(asked.len(), distinct.len(), "a request is in two batches");
}

#[test]
fn batches_are_submitted_and_their_replies_taken_over() {
    let bench = Bench::with_questions(QUESTIONS);
    let mock = MockBatches::start([Course::of("validating in_progress finalizing completed")]);
    let called = call_with(RUN, &bench, &mock, "");
    assert_eq!(called.code, Some(0), "{called:?}");
    assert_each_once(&bench, &mock, TRIALS);
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
    let again = call_with(RUN, &bench, &mock, "");
    assert_eq!((again.code, mock.count("POST batches")), (Some(0), 2));
}

#[test]
fn output_comes_in_any_shape() {
    for (order, batches) in [(Order::Reversed, 1), (Order::Twice, 1), (Order::Cut, 2)] {
        let courses = [
            Course::of("COMPLETED").order(order),
            Course::of("completed"),
        ];
        let (bench, mock, called) = blind(&courses, "");
        assert_eq!(called.code, Some(0), "{order:?}: {called:?}");
        let answered = answered(&bench);
        assert_eq!(answered.len(), QUESTIONS, "{order:?}");
        assert!(answered.iter().all(|record| record["outcome"] == "right"));
        // A cut line costs that line alone.
        let sizes: Vec<usize> = mock.asked().iter().map(Vec::len).collect();
        assert_eq!(sizes, [QUESTIONS, 1][..batches], "{order:?}");
    }
}

#[test]
fn what_failed_for_reasons_of_the_server_is_asked_again() {
    let lines: [fn(usize) -> Line; 5] = [
        |i| [Line::Right, Line::Status(429, "slow down")][i % 2],
        |i| [Line::Status(500, "oops"), Line::Right][i % 2],
        |i| [Line::Right, Line::Status(0, "")][i % 2],
        |i| [Line::Right, Line::Absent][i % 2],
        // No output file at all.
        |_| Line::Status(503, "down"),
    ];
    for (case, line) in lines.into_iter().enumerate() {
        let (bench, mock, called) = blind(
            &[Course::of("completed").lines(line), Course::of("completed")],
            "",
        );
        assert_eq!(called.code, Some(0), "{case}: {called:?}");
        assert_eq!(answered(&bench).len(), QUESTIONS, "{case}");
        let again = if case == 4 { QUESTIONS } else { QUESTIONS / 2 };
        assert_eq!(mock.asked()[1].len(), again, "{case}");
    }
}

#[test]
fn what_was_refused_is_not_asked_again_by_the_same_command() {
    let course =
        Course::of("completed").lines(|i| [Line::Right, Line::Status(400, "bad image")][i % 2]);
    let (bench, mock, called) = blind(&[course, Course::of("completed")], "");
    assert_eq!(called.code, Some(1), "{called:?}");
    assert_eq!(
        (mock.asked().len(), answered(&bench).len()),
        (1, QUESTIONS / 2)
    );
    // The next command asks it, as every evaluation does.
    let called = call_with(BLIND, &bench, &mock, "");
    assert_eq!(called.code, Some(0), "{called:?}");
    assert_eq!(mock.asked()[1].len(), QUESTIONS / 2);
}

#[test]
fn what_expires_is_asked_again_three_times_at_most() {
    let (bench, mock, called) = blind(
        &[Course::of("in_progress expired").lines(|_| Line::Expired)],
        "",
    );
    assert_eq!(called.code, Some(1), "{called:?}");
    assert_eq!((mock.asked().len(), answered(&bench).len()), (4, 0));
    // One that expires in the middle.
    let middle = Course::of("in_progress expired")
        .lines(|i| if i == 0 { Line::Right } else { Line::Expired });
    let (bench, mock, called) = blind(&[middle, Course::of("completed")], "");
    assert_eq!(called.code, Some(0), "{called:?}");
    let sizes: Vec<usize> = mock.asked().iter().map(Vec::len).collect();
    assert_eq!((sizes, answered(&bench).len()), (vec![4, 3], QUESTIONS));
}

#[test]
fn a_batch_that_is_cancelled_elsewhere_is_asked_again() {
    let states = ["cancelling"; 10].join(" ") + " cancelled";
    let course = Course::of(&states).lines(|i| if i < 2 { Line::Right } else { Line::Absent });
    let (bench, mock, called) = blind(&[course, Course::of("completed")], "");
    assert_eq!(called.code, Some(0), "{called:?}");
    let sizes: Vec<usize> = mock.asked().iter().map(Vec::len).collect();
    assert_eq!((sizes, answered(&bench).len()), (vec![4, 2], QUESTIONS));
}

#[test]
fn a_batch_that_the_server_cannot_begin_stops_the_run() {
    let failing = Course::failing("invalid_json_line", "this line is no JSON", json!(3));
    let (bench, mock, called) = blind(&[failing, Course::of("completed")], "");
    assert_eq!(called.code, Some(2), "{called:?}");
    assert!(
        called.stderr.contains("line 3: this line is no JSON"),
        "{called:?}"
    );
    // Its requests are free: the same command asks them.
    let called = call_with(BLIND, &bench, &mock, "");
    assert_eq!(called.code, Some(0), "{called:?}");
    assert_each_once(&bench, &mock, QUESTIONS);
}

const QUOTA: &str = "Enqueued token limit reached for m in organization o. Limit: 1,000,000 enqueued tokens. Please try again once some \
    in_progress batches have been completed.";

#[test]
fn a_full_quota_is_a_wait() {
    let refused = Course::refused(Answer::error(429, "token_limit_exceeded", QUOTA));
    let failed = Course::failing("token_limit_exceeded", QUOTA, Value::Null);
    for first in [refused, failed] {
        let (bench, mock, called) = blind(&[first, Course::of("completed")], "");
        assert_eq!(called.code, Some(0), "{called:?}");
        assert!(
            called.stderr.contains("at most 1000000 tokens"),
            "{called:?}"
        );
        assert_each_once(&bench, &mock, QUESTIONS);
        // The file is not uploaded again.
        assert_eq!(
            (mock.count("POST files"), mock.count("POST batches")),
            (1, 2)
        );
    }
}

#[test]
fn only_as_many_tokens_wait_as_the_server_allows() {
    let bench = Bench::with_questions(QUESTIONS);
    let mock = MockBatches::start([Course::of("in_progress in_progress completed")]);
    // About 60 tokens a question: one a part.
    let called = call_with(BLIND, &bench, &mock, "--enqueued-tokens 120");
    assert_eq!(called.code, Some(0), "{called:?}");
    assert_each_once(&bench, &mock, QUESTIONS);
    let sizes: Vec<usize> = mock.asked().iter().map(Vec::len).collect();
    assert_eq!(sizes, [1, 1, 1, 1]);
    // With room for one alone, each is looked at before the next is made.
    let bench = Bench::with_questions(QUESTIONS);
    let mock = MockBatches::start([Course::of("in_progress in_progress completed")]);
    let called = call_with(BLIND, &bench, &mock, "--enqueued-tokens 60");
    assert_eq!(called.code, Some(0), "{called:?}");
    let log = mock.with(|server| server.log.clone());
    let calls: Vec<&str> = log
        .iter()
        .map(String::as_str)
        .filter(|one| one.contains("batches"))
        .collect();
    let one = [
        "POST batches",
        "GET batches/id",
        "GET batches/id",
        "GET batches/id",
    ];
    assert_eq!(calls, one.repeat(QUESTIONS));
}

#[test]
fn failures_to_look_or_to_fetch_are_no_failures_of_the_batch() {
    let bench = Bench::with_questions(QUESTIONS);
    let mock = MockBatches::start([Course::of("dreaming in_progress completed")]);
    let bad = |status| Fault::Instead(Answer::error(status, "oops", "oops"));
    mock.pending(2);
    mock.fault("GET batches/id", bad(500));
    mock.fault("GET batches/id", Fault::Instead(Answer::dropped()));
    for _ in 0..4 {
        mock.fault("GET files/id/content", bad(502));
    }
    mock.fault("DELETE files/id", bad(500));
    let called = call_with(BLIND, &bench, &mock, "");
    assert_eq!(called.code, Some(0), "{called:?}");
    assert_each_once(&bench, &mock, QUESTIONS);
    assert_eq!(
        called.stderr.matches("\"dreaming\"").count(),
        1,
        "{called:?}"
    );
    mock.with(|server| assert!(server.files.iter().all(|file| file.deleted)));
}

#[test]
fn what_was_made_before_the_connection_broke_is_found() {
    let bench = Bench::with_questions(QUESTIONS);
    let mock = MockBatches::start([Course::of("completed")]);
    // Strangers fill more than one page of the lists.
    mock.with(|server| server.add_strangers(5));
    mock.fault("POST files", Fault::CutAfter);
    mock.fault("POST batches", Fault::CutAfter);
    let called = call_with(BLIND, &bench, &mock, "");
    assert_eq!(called.code, Some(0), "{called:?}");
    assert_each_once(&bench, &mock, QUESTIONS);
    assert_eq!(
        (mock.count("POST files"), mock.count("POST batches")),
        (1, 1)
    );

    // What was not made is made, after it was looked for.
    let bench = Bench::with_questions(QUESTIONS);
    let mock = MockBatches::start([Course::of("completed")]);
    mock.fault("POST files", Fault::Instead(Answer::dropped()));
    mock.fault(
        "POST batches",
        Fault::Instead(Answer::error(500, "oops", "oops")),
    );
    let called = call_with(BLIND, &bench, &mock, "");
    assert_eq!(called.code, Some(0), "{called:?}");
    assert_each_once(&bench, &mock, QUESTIONS);
    assert_eq!(
        (mock.count("POST files"), mock.count("POST batches")),
        (2, 2)
    );
}

#[test]
fn a_refusal_stops_the_run_and_the_same_command_goes_on() {
    let rows = [
        (
            "POST files",
            Answer::error(413, "too_large", "the file is too large"),
        ),
        (
            "POST files",
            Answer::error(401, "invalid_api_key", "Incorrect API key"),
        ),
        (
            "POST batches",
            Answer::error(400, "invalid_request", "unknown window"),
        ),
    ];
    for (kind, answer) in rows {
        let bench = Bench::with_questions(QUESTIONS);
        let mock = MockBatches::start([Course::of("completed")]);
        mock.fault(kind, Fault::Instead(answer.clone()));
        let called = call_with(BLIND, &bench, &mock, "");
        assert_eq!(called.code, Some(2), "{called:?}");
        assert!(called.stderr.contains("part-1-m-001.jsonl: "), "{called:?}");
        let called = call_with(BLIND, &bench, &mock, "");
        assert_eq!(called.code, Some(0), "{called:?}");
        assert_each_once(&bench, &mock, QUESTIONS);
    }
}

/// The run whose kills are tried: it looks twice, and has a direct request before.
const KILLED: &str = "batch run --data set.jsonl --blind-model m --out run --poll 0.02";

/// Starts the run, kills it at the request with this number, and lets the same command end. False if there is no such request.
fn is_killed_at(number: usize, fault: Fault) -> bool {
    let bench = Bench::with_questions(QUESTIONS);
    let mock = MockBatches::start([Course::of("validating completed")]);
    mock.fault_at(number, fault);
    let base = mock.base_url();
    let args = [words(KILLED), vec!["--base-url", &base]].concat();
    let mut process = bench.spawn(&args, Stdio::null());
    let is_held = loop {
        if mock.wait_until_held(Duration::from_millis(20)) {
            break true;
        }
        if process.try_wait().unwrap().is_some() {
            break false;
        }
    };
    if is_held {
        signal(&process, "-9");
        process.wait().unwrap();
        mock.release();
        let called = call_with(KILLED, &bench, &mock, "");
        assert_eq!(called.code, Some(0), "{number}: {called:?}");
    }
    assert_each_once(&bench, &mock, QUESTIONS);
    let batches = mock.count("POST batches");
    assert!(
        mock.asked().len() == 1,
        "{number}: {batches} calls to make one batch"
    );
    is_held
}

#[test]
fn a_kill_at_any_request_submits_nothing_twice_and_loses_nothing() {
    for fault in [Fault::HoldBefore, Fault::HoldAfter] {
        let killed = (0..).take_while(|number| is_killed_at(*number, fault.clone()));
        // A direct request, an upload, a creation, two looks, two files, two deletions.
        assert_eq!(killed.count(), 8);
    }
}

#[test]
fn the_state_file_may_end_anywhere() {
    let bench = Bench::with_questions(QUESTIONS);
    let mock = MockBatches::start([Course::of("validating completed")]);
    let called = call_with(BLIND, &bench, &mock, "--keep-files");
    assert_eq!(called.code, Some(0), "{called:?}");
    let path = bench.path("run/batch/state.jsonl");
    let (state, log) = (
        fs::read_to_string(&path).unwrap(),
        bench.path("run/records.jsonl"),
    );
    let records = fs::read_to_string(&log).unwrap();
    let lines: Vec<&str> = state.lines().collect();
    assert!(lines.len() > 7, "{state}");
    for (kept, half) in (1..lines.len()).flat_map(|kept| [(kept, 0), (kept, 9)]) {
        // What a kill leaves: some events, perhaps a part of the next one, and some of the records.
        let text = lines[..kept].join("\n") + "\n" + &lines[kept][..half];
        fs::write(&path, text).unwrap();
        let taken: Vec<&str> = records.lines().take(kept % (QUESTIONS + 1)).collect();
        let is_fetched = lines[kept - 1].contains("fetched");
        let taken = if is_fetched {
            taken.join("\n") + "\n"
        } else {
            String::new()
        };
        fs::write(
            &log,
            if lines[kept - 1].contains("taken_over") {
                &records
            } else {
                &taken
            },
        )
        .unwrap();
        // An event stands before its call, so that without it the server has nothing.
        mock.with(|server| {
            if !lines[..kept]
                .iter()
                .any(|line| line.contains("\"creating\""))
            {
                server.batches.clear();
            }
            if !lines[..kept]
                .iter()
                .any(|line| line.contains("\"uploading\""))
            {
                server.files.clear();
            }
        });
        let called = call_with(BLIND, &bench, &mock, "--keep-files");
        assert_eq!(called.code, Some(0), "{kept} {half}: {called:?}");
        assert_each_once(&bench, &mock, QUESTIONS);
        assert_eq!(mock.asked().len(), 1, "{kept} {half}");
    }
}

#[test]
fn a_part_that_is_too_large_for_the_quota_is_divided() {
    let words = "Enqueued token limit reached for m in organization o. Limit: 120 enqueued tokens.";
    let small = Course::refused(Answer::error(429, "token_limit_exceeded", words));
    let (bench, mock, called) = blind(&[small, Course::of("completed")], "");
    assert_eq!(called.code, Some(0), "{called:?}");
    assert_each_once(&bench, &mock, QUESTIONS);
    assert_eq!(mock.asked().len(), QUESTIONS);
    // One that is refused again and again although nothing else waits.
    let full = Course::failing("token_limit_exceeded", QUOTA, Value::Null);
    let courses = [full.clone(), full.clone(), full, Course::of("completed")];
    let (bench, mock, called) = blind(&courses, "");
    assert_eq!(called.code, Some(0), "{called:?}");
    assert_each_once(&bench, &mock, QUESTIONS);
    let sizes: Vec<usize> = mock.asked().iter().map(Vec::len).collect();
    assert_eq!(sizes, [2, 2]);
    // A single request that is too large stops the run.
    let bench = Bench::with_questions(1);
    let tiny = Course::refused(Answer::error(429, "x", "enqueued tokens: Limit: 7 tokens"));
    let mock = MockBatches::start([tiny]);
    let called = call_with(BLIND, &bench, &mock, "");
    assert_eq!(called.code, Some(2), "{called:?}");
    assert!(called.stderr.contains("--max-side"), "{called:?}");
}

#[test]
fn an_interrupt_leaves_the_batches_working() {
    let bench = Bench::with_questions(QUESTIONS);
    let mock = MockBatches::start([Course::of(&("in_progress ".repeat(1000) + "completed"))]);
    let base = mock.base_url();
    let args = [words(BLIND), vec!["--base-url", &base]].concat();
    let mut process = bench.spawn(&args, Stdio::null());
    wait_until(|| mock.count("GET batches/id") > 2);
    signal(&process, "-INT");
    assert_eq!(process.wait().unwrap().code(), Some(130));
    assert_eq!(mock.count("POST batches/id/cancel"), 0);
    // What is out is asked nowhere else.
    let base = mock.base_url();
    let plain = [
        "--data",
        "set.jsonl",
        "--blind-model",
        "m",
        "--out",
        "run",
        "--base-url",
        &base,
    ];
    let called = bench.call(&plain);
    assert!(
        called.stderr.contains("4 trials are waiting for a batch"),
        "{called:?}"
    );
    assert_eq!(mock.count("POST chat/completions"), 0);
    mock.with(|server| server.end_batches());
    let called = call_with(BLIND, &bench, &mock, "");
    assert_eq!(called.code, Some(0), "{called:?}");
    assert_each_once(&bench, &mock, QUESTIONS);
}

#[test]
fn a_detached_run_is_looked_at_fetched_and_cancelled_by_its_folder() {
    let (bench, mock, called) = blind(
        &[Course::of("in_progress in_progress in_progress completed")],
        "--detach",
    );
    assert_eq!(called.code, Some(0), "{called:?}");
    assert!(
        called
            .stdout
            .contains("part-1-m-001.jsonl: 4 requests to m, batch_1, submitted"),
        "{called:?}"
    );
    let status = bench.complete(&words("batch status run"));
    assert!(status.contains("in_progress, 0 of 4"), "{status}");
    // The second look, then the fourth.
    let early = bench.call(&words("batch fetch run"));
    assert_eq!(
        (early.code, answered(&bench).len()),
        (Some(1), 0),
        "{early:?}"
    );
    bench.call(&words("batch fetch run"));
    let fetched = bench.call(&words("batch fetch run"));
    assert_eq!(fetched.code, Some(0), "{fetched:?}");
    assert!(
        fetched.stdout.contains("completed: 4 answered, 0 not"),
        "{fetched:?}"
    );
    assert_each_once(&bench, &mock, QUESTIONS);
    mock.with(|server| assert!(server.files.iter().all(|file| file.deleted)));

    let course = Course::of(&"in_progress ".repeat(1000))
        .lines(|i| if i < 1 { Line::Right } else { Line::Absent });
    let (bench, mock, _) = blind(&[course, Course::of("completed")], "--detach");
    let cancelled = bench.call(&words("batch cancel run --poll 0.02"));
    assert_eq!(cancelled.code, Some(1), "{cancelled:?}");
    assert!(
        cancelled.stdout.contains("cancelled: 1 answered, 3 not"),
        "{cancelled:?}"
    );
    assert_eq!(
        (mock.count("POST batches/id/cancel"), answered(&bench).len()),
        (1, 1)
    );
    // The rest may be asked directly.
    let base = mock.base_url();
    let plain = [
        "--data",
        "set.jsonl",
        "--blind-model",
        "m",
        "--resume",
        "run",
        "--base-url",
        &base,
    ];
    let called = bench.call(&plain);
    assert_eq!(
        (called.code, mock.count("POST chat/completions")),
        (Some(0), 3),
        "{called:?}"
    );
}

#[test]
fn a_batch_that_never_ends_is_cancelled_if_asked_for() {
    let course = Course::of(&"in_progress ".repeat(1000)).lines(|_| Line::Absent);
    let (bench, mock, called) = blind(&[course, Course::of("completed")], "--give-up 0.0003");
    assert_eq!(called.code, Some(0), "{called:?}");
    assert_eq!(
        (mock.count("POST batches/id/cancel"), mock.asked().len()),
        (1, 2)
    );
    assert_eq!(answered(&bench).len(), QUESTIONS);
}

#[test]
fn a_limit_of_cost_is_kept_at_the_price_of_batches() {
    let prices = "as-of = \"2026-01-01\"\nbatch = 0.5\n[models]\nm = { input = 10, output = 10 }\n";
    let bench = Bench::with_questions(QUESTIONS);
    bench.file("prices.toml", prices);
    let mock = MockBatches::start([Course::of("completed")]);
    // A reply is charged 91 tokens at half of 10 dollars a million: $0.000455. A question a part.
    let limited = |limit: &str| {
        let more = format!(
            "--prices prices.toml --file-requests 1 --enqueued-tokens 60 --max-cost {limit}"
        );
        call_with(BLIND, &bench, &mock, &more)
    };
    let called = limited("0.001");
    assert_eq!(called.code, Some(3), "{called:?}");
    assert!(called.stderr.contains("--max-cost"), "{called:?}");
    assert_eq!(answered(&bench).len(), 2, "{called:?}");
    let called = limited("0.01");
    assert_eq!(called.code, Some(0), "{called:?}");
    assert_each_once(&bench, &mock, QUESTIONS);
}

#[test]
fn a_refused_field_costs_one_request_or_one_batch() {
    // Directly before the batches.
    let bench = Bench::with_questions(QUESTIONS);
    let mock = MockBatches::start([Course::of("completed")]);
    let words = "'temperature' is not supported with this model: only the default (1) is supported";
    mock.fault(
        "POST chat/completions",
        Fault::Instead(Answer::error(400, "unsupported_value", words)),
    );
    let called = call_with(KILLED, &bench, &mock, "");
    assert_eq!(called.code, Some(0), "{called:?}");
    assert_eq!(
        (mock.count("POST chat/completions"), mock.asked().len()),
        (2, 1)
    );
    mock.with(|server| {
        let requests = &server.batches[0].requests;
        assert!(
            requests
                .iter()
                .all(|one| one["body"].get("temperature").is_none())
        );
    });
    // By the batch itself, where nothing was asked directly.
    let refused = |_| {
        Line::Status(
            400,
            "'temperature' is not supported with this model: only the default (1) is supported",
        )
    };
    let (bench, mock, called) = blind(
        &[
            Course::of("completed").lines(refused),
            Course::of("completed"),
        ],
        "",
    );
    assert_eq!(called.code, Some(0), "{called:?}");
    assert_eq!((mock.asked().len(), answered(&bench).len()), (2, QUESTIONS));
    mock.with(|server| {
        let has = |batch: usize| {
            server.batches[batch].requests[0]["body"]
                .get("temperature")
                .is_some()
        };
        assert_eq!((has(0), has(1)), (true, false));
    });
}

#[test]
fn built_in_models_and_other_folders_are_refused() {
    let bench = Bench::with_questions(QUESTIONS);
    for (args, message) in [
        (
            "batch run --data set.jsonl --model random --out x",
            "built in",
        ),
        ("batch status nowhere", "no run in this folder"),
        ("batch cancel x", "has submitted no batch of this run"),
    ] {
        let called = bench.call(&words(args));
        assert_eq!(called.code, Some(2), "{called:?}");
        assert!(called.stderr.contains(message), "{called:?}");
    }
}

#[test]
fn open_answers_and_their_marks_go_through_batches_one_after_the_other() {
    let house = House::new();
    let mock = MockBatches::start([
        Course::of("in_progress completed").text("brown"),
        Course::of("in_progress completed").text("Your mark: 4"),
    ]);
    let base = mock.base_url();
    let more = "--judge j --levels L0,L4 --out run --batch-run --no-scout --poll 0.02";
    let called = house.call(&model_args(&base, more));
    assert_eq!(called.code, Some(0), "{called:?}");
    assert!(called.stdout.contains("75.0"), "{called:?}");
    mock.with(|server| {
        let models = server.batches.iter();
        let models: Vec<&Value> = models
            .map(|one| &one.requests[0]["body"]["model"])
            .collect();
        assert_eq!(models, ["m", "j"]);
    });
    assert_eq!(mock.count("POST chat/completions"), 0);
}
