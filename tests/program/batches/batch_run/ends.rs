//! The ways in which batches end, and what can go wrong on the way.

use serde_json::json;

use super::{BLIND, QUESTIONS, answered, assert_each_once, blind, call_with};
use crate::support::batches::{Course, Fault, Line, MockBatches, Order};
use crate::support::endpoint::Answer;
use crate::support::run::{Bench, called, records, words};
use crate::support::table::check_rows;

#[test]
fn output_comes_in_any_shape() {
    for order in [Order::Reversed, Order::Twice] {
        let (bench, mock, called) = blind(&[Course::of("COMPLETED").order(order)], "");
        assert_eq!(called.code, Some(0), "{order:?}: {called:?}");
        let answered = answered(&bench);
        assert_eq!(answered.len(), QUESTIONS, "{order:?}");
        assert!(answered.iter().all(|record| record["outcome"] == "right"));
        assert_eq!(mock.count("POST batches"), 1, "{order:?}");
    }
}

/// A key that a server repeats in its files is in no file of the run.
#[test]
fn batch_output_key_is_never_stored() {
    const KEY: &str = "sk-0123456789abcdef";
    let course = Course::of("completed")
        .text("C, and the key is sk-0123456789abcdef")
        .lines(|i| [Line::Right, Line::Status(413, "no sk-0123456789abcdef")][i % 2]);
    let bench = Bench::with_questions(QUESTIONS);
    let mock = MockBatches::start([course]);
    let base = mock.base_url();
    let args = [words(BLIND), vec!["--base-url", &base]].concat();
    let called = called(bench.command(&args).env("OPENAI_API_KEY", KEY));
    assert_eq!(called.code, Some(1), "{called:?}");
    assert!(!called.stderr.contains(KEY), "{called:?}");
    let records = records(&bench.path("run"));
    let hidden = records.iter().map(ToString::to_string).filter(|record| record.contains("[secret]"));
    assert_eq!(hidden.count(), QUESTIONS);
    let mut texts = 0;
    for folder in ["run", "run/batch"] {
        for entry in std::fs::read_dir(bench.path(folder)).unwrap() {
            let path = entry.unwrap().path();
            if path.is_file() {
                let text = std::fs::read(&path).unwrap();
                let text = String::from_utf8_lossy(&text);
                assert!(!text.contains(KEY), "{}", path.display());
                texts += usize::from(text.contains("[secret]"));
            }
        }
    }
    assert!(texts >= 2, "the records and the output of the batch");
}

#[test]
fn server_faults_are_asked_again() {
    let lines: [fn(usize) -> Line; 5] = [
        |i| [Line::Right, Line::Status(429, "slow down")][i % 2],
        |i| [Line::Status(500, "oops"), Line::Right][i % 2],
        |i| [Line::Right, Line::Status(0, "")][i % 2],
        |i| [Line::Right, Line::Absent][i % 2],
        // No output file at all.
        |_| Line::Status(503, "down"),
    ];
    for (case, line) in lines.into_iter().enumerate() {
        let (bench, mock, called) = blind(&[Course::of("completed").lines(line), Course::of("completed")], "");
        assert_eq!(called.code, Some(0), "{case}: {called:?}");
        assert_eq!(answered(&bench).len(), QUESTIONS, "{case}");
        let again = if case == 4 { QUESTIONS } else { QUESTIONS / 2 };
        assert_eq!(mock.asked()[1].len(), again, "{case}");
    }
}

#[test]
fn refused_requests_are_not_repeated() {
    let course = Course::of("completed").lines(|i| [Line::Right, Line::Status(413, "bad image")][i % 2]);
    let (bench, mock, called) = blind(&[course, Course::of("completed")], "");
    assert_eq!(called.code, Some(1), "{called:?}");
    assert_eq!((mock.asked().len(), answered(&bench).len()), (1, QUESTIONS / 2));
    // The next command asks it, as every evaluation does.
    let called = call_with(BLIND, &bench, &mock, "");
    assert_eq!(called.code, Some(0), "{called:?}");
    assert_eq!(mock.asked()[1].len(), QUESTIONS / 2);
}

#[test]
fn expired_requests_retry_three_times() {
    let (bench, mock, called) = blind(&[Course::of("in_progress expired").lines(|_| Line::Expired)], "");
    assert_eq!(called.code, Some(1), "{called:?}");
    assert_eq!((mock.asked().len(), answered(&bench).len()), (4, 0));
    // One that expires in the middle.
    let middle = Course::of("in_progress expired").lines(|i| if i == 0 { Line::Right } else { Line::Expired });
    let (bench, mock, called) = blind(&[middle, Course::of("completed")], "");
    assert_eq!(called.code, Some(0), "{called:?}");
    let sizes: Vec<usize> = mock.asked().iter().map(Vec::len).collect();
    assert_eq!((sizes, answered(&bench).len()), (vec![4, 3], QUESTIONS));
}

#[test]
fn batch_cancelled_elsewhere_is_repeated() {
    let states = ["cancelling"; 10].join(" ") + " cancelled";
    let course = Course::of(&states).lines(|i| if i < 2 { Line::Right } else { Line::Absent });
    let (bench, mock, called) = blind(&[course, Course::of("completed")], "");
    assert_eq!(called.code, Some(0), "{called:?}");
    let sizes: Vec<usize> = mock.asked().iter().map(Vec::len).collect();
    assert_eq!((sizes, answered(&bench).len()), (vec![4, 2], QUESTIONS));
}

#[test]
fn rejected_batch_stops_the_run() {
    let failing = Course::failing("invalid_json_line", "this line is no JSON", &json!(3));
    let (bench, mock, called) = blind(&[failing, Course::of("completed")], "");
    insta::assert_snapshot!(called.messages(), @"
    exit code: 2
    error: http://127.0.0.1:[PORT]/v1: part-1-m-001.jsonl: the batch batch_1 failed: line 3: this line is no JSON
        (invalid_json_line); none of its requests has a reply
    ");
    // Its requests are free: the same command asks them.
    let called = call_with(BLIND, &bench, &mock, "");
    assert_eq!(called.code, Some(0), "{called:?}");
    assert_each_once(&bench, &mock, QUESTIONS);
}

#[test]
fn polling_failures_do_not_fail_batch() {
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
    assert_eq!(called.stderr.matches("\"dreaming\"").count(), 1, "{called:?}");
    mock.with(|server| assert!(server.files.iter().all(|file| file.deleted)));
}

#[test]
fn refusal_stops_run_until_resumed() {
    let rows = [
        ("POST files", Answer::error(413, "too_large", "the file is too large")),
        ("POST files", Answer::error(401, "invalid_api_key", "Incorrect API key")),
        ("POST batches", Answer::error(400, "invalid_request", "unknown window")),
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

/// A gateway without storage for files answers each upload so.
#[test]
fn persistent_upload_failures_end_run() {
    for kind in ["POST files", "POST batches"] {
        let bench = Bench::with_questions(QUESTIONS);
        let mock = MockBatches::start([Course::of("completed")]);
        for _ in 0..5 {
            mock.fault(kind, Fault::Instead(Answer::error(500, "oops", "no files")));
        }
        let called = call_with(BLIND, &bench, &mock, "");
        assert_eq!(called.code, Some(2), "{called:?}");
        assert_eq!(mock.count(kind), 5, "{called:?}");
        assert!(called.stderr.contains("the same command continues"), "{called:?}");
        let called = call_with(BLIND, &bench, &mock, "");
        assert_eq!(called.code, Some(0), "{called:?}");
        assert_each_once(&bench, &mock, QUESTIONS);
    }
}

#[test]
fn endless_batch_is_cancelled_on_request() {
    let course = Course::of(&"in_progress ".repeat(1000)).lines(|_| Line::Absent);
    let (bench, mock, called) = blind(&[course, Course::of("completed")], "--give-up 0.0003");
    assert_eq!(called.code, Some(0), "{called:?}");
    assert_eq!((mock.count("POST batches/id/cancel"), mock.asked().len()), (1, 2));
    assert_eq!(answered(&bench).len(), QUESTIONS);
}

#[test]
fn edited_file_is_not_uploaded() {
    let (bench, mock, called) = blind(&[Course::of("completed")], "--max-cost 0.0000001 --prices prices.toml");
    assert_eq!(called.code, Some(2), "no prices yet: {called:?}");
    bench.file("prices.toml", "as-of = \"2026-01-01\"\nbatch = 0.5\n[models]\nm = { input = 10, output = 10 }\n");
    let limited = call_with(BLIND, &bench, &mock, "--max-cost 0.0000001 --prices prices.toml");
    assert_eq!(limited.code, Some(3), "{limited:?}");
    let path = bench.path("run/batch/part-1-m-001.jsonl");
    let text = std::fs::read_to_string(&path).unwrap();
    std::fs::write(&path, text.replace("color", "hue")).unwrap();
    let called = call_with(BLIND, &bench, &mock, "");
    insta::assert_snapshot!(called.messages(), @"
    exit code: 2
    error: run/batch/part-1-m-001.jsonl: the file was changed after it was written: 1660 bytes expected; batch
        cancel run frees its requests
    ");
    assert_eq!(mock.count("POST files"), 0);
}

/// The form of a vendor's Batch API is known before anything is sent.
#[test]
fn unknown_batch_api_is_refused_early() {
    let rows = [
        ("https://api.mistral.ai/v1", "MISTRAL_API_KEY", "Mistral has another form"),
        ("https://api.deepseek.com", "DEEPSEEK_API_KEY", "DeepSeek has no Batch API"),
    ];
    check_rows(rows, |(base, key, expected)| {
        let bench = Bench::with_questions(1);
        let args = [words(BLIND), vec!["--base-url", base]].concat();
        let called = called(bench.command(&args).env(key, "none"));
        assert_eq!(called.code, Some(2), "{called:?}");
        assert!(called.stderr.contains(expected), "{called:?}");
    });
}

/// What the user says of files goes before what is known of the server: this one takes the purpose "batch" alone.
#[test]
fn file_purpose_follows_server_or_flag() {
    let (_, mock, called) = blind(&[Course::of("completed")], "--purpose batch-api");
    assert_ne!(called.code, Some(0), "{called:?}");
    insta::assert_snapshot!(called.messages(), @"
    exit code: 2
    error: http://127.0.0.1:[PORT]/v1: part-1-m-001.jsonl: http://127.0.0.1:[PORT]/v1 answered 400: the purpose
        must be batch; the batches of this run stay as they are, and the same command continues
    ");
    assert_eq!(mock.count("POST batches"), 0);
    let (_, mock, called) = blind(&[Course::of("completed")], "");
    assert_eq!((called.code, mock.count("POST batches")), (Some(0), 1));
}
