//! Batches by the folder of their run.

use super::{QUESTIONS, answered, assert_each_once, blind, call_with};
use crate::support::batches::{Course, Line, MockBatches};
use crate::support::endpoint::Answer;
use crate::support::run::{Bench, called, words};
use crate::support::snapshot::redacted;

#[test]
fn folder_controls_detached_run() {
    let (bench, mock, called) = blind(&[Course::of("in_progress in_progress in_progress completed")], "--detach");
    insta::assert_snapshot!(called, @"
    exit code: 0
    stdout:
    part-1-m-001.jsonl: 4 requests to m, batch_1, submitted
    the same command, or batch fetch run, imports the replies; the same command also submits what waits
    ");
    let status = bench.complete(&words("batch status run"));
    insta::assert_snapshot!(redacted(&status), @"part-1-m-001.jsonl: 4 requests to m, batch_1, in_progress, 0 of 4");
    // The second look, then the fourth.
    let early = bench.call(&words("batch fetch run"));
    assert_eq!((early.code, answered(&bench).len()), (Some(1), 0), "{early:?}");
    bench.call(&words("batch fetch run"));
    let fetched = bench.call(&words("batch fetch run"));
    insta::assert_snapshot!(fetched, @"
    exit code: 0
    stdout:
    part-1-m-001.jsonl: 4 requests to m, batch_1, completed: 4 answered, 0 not
    m · 4 questions · 1 frame · 4 replies, 0 failed · intervals by question
    ! Only 4 questions (8 are needed): wide intervals, few possible verdicts.

     accuracy in %
     without images: m 100.0 [51.0, 100.0] · chance 33.3
    run: run
    report: run/report.html
    ");
    assert_each_once(&bench, &mock, QUESTIONS);
    mock.with(|server| assert!(server.files.iter().all(|file| file.deleted)));

    let course = Course::of(&"in_progress ".repeat(1000)).lines(|i| if i < 1 { Line::Right } else { Line::Absent });
    let (bench, mock, _) = blind(&[course, Course::of("completed")], "--detach");
    let cancelled = bench.call(&words("batch cancel run --poll 0.02"));
    insta::assert_snapshot!(cancelled, @"
    exit code: 1
    stdout:
    part-1-m-001.jsonl: 4 requests to m, batch_1, cancelled: 1 answered, 3 not
    m · 4 questions · 1 frame · 1 reply, 3 failed · intervals by question
    ! run: incomplete: 1 of 4 trials answered, 3 failed. The same command asks the
      rest.
    ! 3 trials of m failed and are not scored: no whole reply in time.
    ! Only 4 questions (8 are needed): wide intervals, few possible verdicts.

     accuracy in %
     without images: m 100.0 [4.6, 100.0] · chance 33.3
    run: run
    report: run/report.html
    ");
    assert_eq!((mock.count("POST batches/id/cancel"), answered(&bench).len()), (1, 1));
    // The rest may be asked directly.
    let called = call_with("--data set.jsonl --blind-model m --resume run", &bench, &mock, "");
    assert_eq!((called.code, mock.count("POST chat/completions")), (Some(0), 3), "{called:?}");
}

#[test]
fn built_in_models_cannot_be_batched() {
    let bench = Bench::with_questions(QUESTIONS);
    for (args, message) in [
        ("batch run --data set.jsonl --model random --out x", "built in"),
        ("batch status nowhere", "no run in this folder"),
        ("batch cancel x", "has submitted no batch of this run"),
    ] {
        let called = bench.call(&words(args));
        assert_eq!(called.code, Some(2), "{called:?}");
        assert!(called.stderr.contains(message), "{called:?}");
    }
}

#[test]
fn cancel_frees_parts_awaiting_quota() {
    let full = Answer::error(429, "token_limit_exceeded", "too many enqueued tokens");
    let (bench, mock, called) = blind(&[Course::refused(full)], "--detach");
    insta::assert_snapshot!(called, @"
    exit code: 0
    stdout:
    part-1-m-001.jsonl: 4 requests to m, no batch, not submitted yet
    the same command, or batch fetch run, imports the replies; the same command also submits what waits
    stderr:
     WARN m: too many tokens wait for batches (too many enqueued tokens); further ones are submitted later
    ");
    // A look submits nothing.
    let looked = bench.call(&words("batch fetch run"));
    assert_eq!((looked.code, mock.count("POST batches")), (Some(1), 1));
    let cancelled = bench.call(&words("batch cancel run --poll 0.02"));
    assert_eq!(cancelled.code, Some(1), "{cancelled:?}");
    mock.with(|server| assert!(server.files.iter().all(|file| file.deleted)));
    let called = call_with("--data set.jsonl --blind-model m --resume run", &bench, &mock, "");
    assert_eq!(called.code, Some(0), "{called:?}");
    assert_eq!(mock.count("POST chat/completions"), QUESTIONS);
}

#[test]
fn batches_of_other_address_stay() {
    let (bench, mock, _) = blind(&[Course::of("completed")], "--detach");
    let elsewhere = "batch cancel run --base-url http://127.0.0.1:9/v1 --poll 0.02";
    let called = bench.call(&words(elsewhere));
    insta::assert_snapshot!(called.messages(), @"
    exit code: 1
     WARN batches at http://127.0.0.1:[PORT]/v1 are left alone; name that address, with its key
    ");
    assert_eq!(mock.count("POST batches/id/cancel"), 0);
    let fetched = bench.call(&words("batch fetch run"));
    assert_eq!((fetched.code, answered(&bench).len()), (Some(0), QUESTIONS));
}

/// A stranger's folder may name any address, and may name parts by paths.
#[test]
fn no_key_for_address_in_folder() {
    let (bench, _, _) = blind(&[Course::of(&"in_progress ".repeat(100))], "--detach");
    let stranger = MockBatches::start([Course::of("in_progress")]);
    let state = bench.path("run/batch/state.jsonl");
    let text = std::fs::read_to_string(&state).unwrap();
    let own = text.lines().map(|line| serde_json::from_str::<serde_json::Value>(line).unwrap()).next().unwrap()["base"]
        .as_str()
        .unwrap()
        .to_owned();
    std::fs::write(&state, text.replace(&own, &stranger.base_url())).unwrap();
    for task in ["status", "fetch", "cancel"] {
        let line = format!("batch {task} run");
        let refused = called(bench.command(&words(&line)).env("OPENAI_API_KEY", "sk-campus-key-4711"));
        assert_eq!(refused.code, Some(2), "{refused:?}");
        assert!(refused.stderr.contains("--base-url"), "{refused:?}");
    }
    assert!(stranger.requests().is_empty());
    // An address of the user's own gets it.
    let base = stranger.base_url();
    let line = format!("batch status run --base-url {base}");
    let shown = called(bench.command(&words(&line)).env("OPENAI_API_KEY", "sk-campus-key-4711"));
    assert_eq!((shown.code, stranger.requests().len()), (Some(0), 1), "{shown:?}");
    // Another machine is refused without a key, too; no other header goes anywhere.
    std::fs::write(&state, text.replace(&own, "https://gateway.example/v1")).unwrap();
    let other = bench.call(&words("batch fetch run"));
    insta::assert_snapshot!(other.messages(), @"
    exit code: 2
    error: --base-url: only the run folder names the address https://gateway.example/v1, and it may be a
        stranger's: to send your key there, name it with --base-url https://gateway.example/v1
    ");
}

#[test]
fn part_is_name_not_path() {
    let (bench, _, _) = blind(&[Course::of("completed")], "--detach");
    let state = bench.path("run/batch/state.jsonl");
    let text = std::fs::read_to_string(&state).unwrap();
    for name in ["../../part-1.jsonl", "/tmp/part-1.jsonl", "part-a/b.jsonl", "notes.jsonl", ""] {
        std::fs::write(&state, text.replace("part-1-m-001.jsonl", name)).unwrap();
        for task in ["status", "fetch", "cancel"] {
            let refused = bench.call(&words(&format!("batch {task} run")));
            assert_eq!(refused.code, Some(2), "{name}: {refused:?}");
            assert!(refused.stderr.contains("no name of a part"), "{refused:?}");
        }
    }
}
