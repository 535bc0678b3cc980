//! Runs that are killed or interrupted: nothing is submitted twice, nothing is lost.

use std::fs;
use std::process::Stdio;
use std::time::Duration;

use serde_json::json;

use super::{BLIND, QUESTIONS, SCOUTED, assert_each_once, blind, call_with};
use crate::support::batches::{Course, Fault, MockBatches, Server};
use crate::support::endpoint::Answer;
use crate::support::process::{signal, wait_until};
use crate::support::run::{Bench, words};

#[test]
fn batch_before_broken_connection_is_found() {
    let bench = Bench::with_questions(QUESTIONS);
    let mock = MockBatches::start([Course::of("completed")]);
    // Strangers fill more than one page of the lists.
    mock.with(|server| server.add_strangers(5));
    mock.fault("POST files", Fault::CutAfter);
    mock.fault("POST batches", Fault::CutAfter);
    let called = call_with(BLIND, &bench, &mock, "");
    assert_eq!(called.code, Some(0), "{called:?}");
    assert_each_once(&bench, &mock, QUESTIONS);
    assert_eq!((mock.count("POST files"), mock.count("POST batches")), (1, 1));

    // What was not made is made, after it was looked for.
    let bench = Bench::with_questions(QUESTIONS);
    let mock = MockBatches::start([Course::of("completed")]);
    mock.fault("POST files", Fault::Instead(Answer::dropped()));
    mock.fault("POST batches", Fault::Instead(Answer::error(500, "oops", "oops")));
    let called = call_with(BLIND, &bench, &mock, "");
    assert_eq!(called.code, Some(0), "{called:?}");
    assert_each_once(&bench, &mock, QUESTIONS);
    assert_eq!((mock.count("POST files"), mock.count("POST batches")), (2, 2));
}

#[test]
fn each_search_has_its_whole_time() {
    // The file is found late, late, and then the batch: together later than one search lasts.
    let bench = Bench::with_questions(QUESTIONS);
    let mock = MockBatches::start([Course::of("completed")]);
    let none = json!({"object": "list", "data": [], "has_more": false});
    mock.fault("POST files", Fault::CutAfter);
    mock.fault("POST batches", Fault::CutAfter);
    for list in ["GET files", "GET batches"] {
        for _ in 0..2 {
            mock.fault(list, Fault::Instead(Answer::json(200, &none)));
        }
    }
    let run = BLIND.replace("--poll 0.02", "--poll 0.19");
    let called = call_with(&run, &bench, &mock, "");
    assert_eq!(called.code, Some(0), "{called:?}");
    assert_each_once(&bench, &mock, QUESTIONS);
    assert_eq!((mock.count("POST files"), mock.count("POST batches")), (1, 1));
}

#[test]
fn late_listed_batch_is_not_repeated() {
    // The list of batches is seconds behind.
    let bench = Bench::with_questions(QUESTIONS);
    let mock = MockBatches::start([Course::of("completed")]);
    mock.fault("POST batches", Fault::CutAfter);
    for _ in 0..6 {
        let none = json!({"object": "list", "data": [], "has_more": false});
        mock.fault("GET batches", Fault::Instead(Answer::json(200, &none)));
    }
    let run = BLIND.replace("--poll 0.02", "--poll 0.2");
    let called = call_with(&run, &bench, &mock, "");
    assert_eq!(called.code, Some(0), "{called:?}");
    assert_each_once(&bench, &mock, QUESTIONS);
    assert_eq!(mock.count("POST batches"), 1);
    let said =
        "part-1-m-001.jsonl: the server does not list its batch; looked for again for 60 s, as a list may be late";
    assert_eq!(called.stderr.matches(said).count(), 1, "{called:?}");

    // It was given up, and is listed before the next attempt.
    let bench = Bench::with_questions(QUESTIONS);
    let mock = MockBatches::start([Course::of("completed")]);
    let called = call_with(BLIND, &bench, &mock, "--detach");
    assert_eq!(called.code, Some(0), "{called:?}");
    let path = bench.path("run/batch/state.jsonl");
    let state = fs::read_to_string(&path).unwrap();
    let creating = state.find("\"creating\"").unwrap();
    let end = creating + state[creating..].find('\n').unwrap() + 1;
    let line = json!({
        "file": "part-1-m-001.jsonl", "event": "refused", "why": "the batch is not at the server", "at": "2026-01-01T00:00:00Z",
    });
    fs::write(&path, format!("{}{line}\n", &state[..end])).unwrap();
    let called = call_with(BLIND, &bench, &mock, "");
    assert_eq!(called.code, Some(0), "{called:?}");
    assert_each_once(&bench, &mock, QUESTIONS);
    assert_eq!(mock.count("POST batches"), 1);
}

#[test]
fn file_copies_are_deleted_together() {
    let bench = Bench::with_questions(QUESTIONS);
    let mock = MockBatches::start([Course::of("completed")]);
    // The answer to the first upload is lost, and the server does not list its files at first.
    mock.fault("POST files", Fault::CutAfter);
    let unknown = Answer::error(404, "not_found", "no such route");
    mock.fault("GET files", Fault::Instead(unknown));
    let called = call_with(BLIND, &bench, &mock, "");
    assert_eq!(called.code, Some(0), "{called:?}");
    assert_each_once(&bench, &mock, QUESTIONS);
    mock.with(|server| {
        let uploaded = server.files.iter().filter(|file| file.name.contains("part"));
        assert_eq!(uploaded.count(), 2);
        assert!(server.files.iter().all(|file| file.deleted));
    });
}

/// Starts the run, kills it at the request with this number, and lets the same command end. False if there is no such
/// request.
fn is_killed_at(number: usize, fault: Fault) -> bool {
    let bench = Bench::with_questions(QUESTIONS);
    let mock = MockBatches::start([Course::of("validating completed")]);
    mock.fault_at(number, fault);
    let base = mock.base_url();
    let args = [words(SCOUTED), vec!["--base-url", &base]].concat();
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
        let called = call_with(SCOUTED, &bench, &mock, "");
        assert_eq!(called.code, Some(0), "{number}: {called:?}");
    }
    assert_each_once(&bench, &mock, QUESTIONS);
    let batches = mock.count("POST batches");
    assert!(mock.asked().len() == 1, "{number}: {batches} calls to make one batch");
    is_held
}

#[test]
fn kill_at_any_request_loses_nothing() {
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
    let (state, log) = (fs::read_to_string(&path).unwrap(), bench.path("run/records.jsonl"));
    let records = fs::read_to_string(&log).unwrap();
    let lines: Vec<&str> = state.lines().collect();
    assert!(lines.len() > 7, "{state}");
    for (kept, half) in (1..lines.len()).flat_map(|kept| [(kept, 0), (kept, 9)]) {
        // What a kill leaves: some events, perhaps a part of the next one, and some of the records.
        let text = lines[..kept].join("\n") + "\n" + &lines[kept][..half];
        fs::write(&path, text).unwrap();
        let taken: Vec<&str> = records.lines().take(kept % (QUESTIONS + 1)).collect();
        let is_fetched = lines[kept - 1].contains("fetched");
        let taken = if is_fetched { taken.join("\n") + "\n" } else { String::new() };
        fs::write(&log, if lines[kept - 1].contains("taken_over") { &records } else { &taken }).unwrap();
        // An event stands before its call, so that without it the server has nothing.
        mock.with(|server| {
            if !lines[..kept].iter().any(|line| line.contains("\"creating\"")) {
                server.batches.clear();
            }
            if !lines[..kept].iter().any(|line| line.contains("\"uploading\"")) {
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
    let called = call_with("--data set.jsonl --blind-model m --out run", &bench, &mock, "");
    insta::assert_snapshot!(called.messages(), @"
    exit code: 1
     WARN 4 trials are waiting for a batch and not asked here; import the replies with batch run, batch fetch or
        batch import; batch cancel run ends what batch run has submitted, and frees it; or delete run/batch to ask
        here
    ");
    assert_eq!(mock.count("POST chat/completions"), 0);
    mock.with(Server::end_batches);
    let called = call_with(BLIND, &bench, &mock, "");
    assert_eq!(called.code, Some(0), "{called:?}");
    assert_each_once(&bench, &mock, QUESTIONS);
}

/// Keeps the first lines of a file.
fn keep_lines(bench: &Bench, file: &str, count: usize) {
    let path = bench.path(file);
    let text = fs::read_to_string(&path).unwrap();
    let kept: String = text.split_inclusive('\n').take(count).collect();
    fs::write(path, kept).unwrap();
}

#[test]
fn kill_while_writing_loses_nothing() {
    // The trials that the run had recorded when it was killed.
    for recorded in [0, 1, QUESTIONS] {
        let (bench, mock, called) = blind(&[Course::of("completed")], "--detach");
        assert_eq!(called.code, Some(0), "{called:?}");
        mock.with(|server| (server.batches.clear(), server.files.clear()));
        keep_lines(&bench, "run/batch/state.jsonl", 1);
        keep_lines(&bench, "run/batch/trials.jsonl", recorded);
        let file = bench.path("run/batch/part-1-m-001.jsonl");
        fs::rename(&file, file.with_extension("part")).unwrap();
        // One that was begun after it, and cut.
        bench.file("run/batch/part-1-m-002.part", "{\"custom_id\":\"00");
        let called = call_with(BLIND, &bench, &mock, "");
        assert_eq!(called.code, Some(0), "{recorded}: {called:?}");
        assert_each_once(&bench, &mock, QUESTIONS);
        let sizes: Vec<usize> = mock.asked().iter().map(Vec::len).collect();
        let expected = [recorded, QUESTIONS - recorded];
        let expected: Vec<usize> = expected.into_iter().filter(|size| *size > 0).collect();
        assert_eq!(sizes, expected);
        let left = fs::read_dir(bench.path("run/batch")).unwrap();
        let unfinished: Vec<String> = left
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .filter(|name| name.ends_with("part"))
            .collect();
        assert!(unfinished.is_empty(), "{unfinished:?}");
    }
}

#[test]
fn kill_while_splitting_keeps_one_version() {
    let words = "Enqueued token limit reached. Limit: 120 enqueued tokens.";
    let small = || Course::refused(Answer::error(429, "token_limit_exceeded", words));
    // Killed before the event that names the pieces, and before the pieces have their names.
    for is_named in [false, true] {
        let (bench, mock, called) = blind(&[small(), Course::of("completed")], "--detach");
        assert_eq!(called.code, Some(0), "{called:?}");
        mock.with(|server| server.batches.truncate(1));
        let state = fs::read_to_string(bench.path("run/batch/state.jsonl")).unwrap();
        let split = state.lines().position(|line| line.contains("\"split\""));
        let split = split.unwrap();
        keep_lines(&bench, "run/batch/state.jsonl", split + usize::from(is_named));
        let mut whole = String::new();
        for number in 2..=5 {
            let path = bench.path(&format!("run/batch/part-1-m-{number:03}.jsonl"));
            whole += &fs::read_to_string(&path).unwrap();
            fs::rename(&path, path.with_extension("split")).unwrap();
        }
        bench.file("run/batch/part-1-m-001.jsonl", whole);
        let called = call_with(BLIND, &bench, &mock, "");
        assert_eq!(called.code, Some(0), "{is_named}: {called:?}");
        assert_each_once(&bench, &mock, QUESTIONS);
        assert_eq!(mock.asked().len(), QUESTIONS);
    }
}

/// Kills at any time, also between two requests: `cargo test --test program random_kills -- --ignored`.
#[test]
#[ignore = "takes a minute, and tries what the other tests of this file hold one by one"]
fn random_kills_lose_and_repeat_nothing() {
    let mut random = 1_u64;
    for round in 0..25 {
        let bench = Bench::with_questions(6);
        let mock = MockBatches::start([Course::of("validating in_progress completed")]);
        let base = mock.base_url();
        let more = ["--file-requests", "2", "--base-url", &base];
        let args = [words(BLIND), more.to_vec()].concat();
        for _ in 0..8 {
            let mut process = bench.spawn(&args, Stdio::null());
            // A linear congruential generator (Knuth, MMIX).
            random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            std::thread::sleep(Duration::from_millis(20 + (random >> 33) % 400));
            if process.try_wait().unwrap().is_none() {
                signal(&process, "-9");
            }
            process.wait().unwrap();
        }
        let called = call_with(BLIND, &bench, &mock, "--file-requests 2");
        assert_eq!(called.code, Some(0), "{round}: {called:?}");
        assert_each_once(&bench, &mock, 6);
    }
}
