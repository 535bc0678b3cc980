//! Batches that have ended, and whose files are late, cut, empty or gone: nothing is asked and paid again, and nothing
//! is deleted.

use super::{BLIND, QUESTIONS, answered, assert_each_once, blind, call_with};
use crate::support::batches::{Course, Fault, Line, MockBatches, Order};
use crate::support::endpoint::Answer;
use crate::support::run::{Bench, Called, words};

/// Asserts that a call stopped with a message about the only batch, and that everything is still at the server.
fn assert_stopped(mock: &MockBatches, called: &Called, case: &str) {
    assert_eq!(called.code, Some(2), "{case}: {called:?}");
    for words in ["batch batch_1: ", "nothing is asked again", "batch cancel"] {
        assert!(called.stderr.contains(words), "{case}: {called:?}");
    }
    assert_eq!(mock.count("POST batches"), 1, "{case}");
    assert_eq!(mock.count("DELETE files/id"), 0, "{case}");
}

#[test]
fn late_output_is_awaited() {
    let course = Course::of("in_progress completed").late(4);
    let (bench, mock, called) = blind(&[course], "");
    assert_eq!(called.code, Some(0), "{called:?}");
    assert_each_once(&bench, &mock, QUESTIONS);
    assert_eq!(mock.count("POST batches"), 1);
}

#[test]
fn short_output_stops_the_run() {
    for (order, replies) in [(Order::Cut, QUESTIONS - 1), (Order::Empty, 0)] {
        let courses = [Course::of("completed").order(order), Course::of("completed")];
        let (bench, mock, called) = blind(&courses, "");
        assert_stopped(&mock, &called, &format!("{order:?}"));
        // What is there is not lost.
        assert_eq!(answered(&bench).len(), replies, "{order:?}");
        let again = call_with(BLIND, &bench, &mock, "");
        assert_stopped(&mock, &again, &format!("again {order:?}"));
        // Only the user's word frees the rest.
        let cancelled = bench.call(&words("batch cancel run --poll 0.02"));
        assert_eq!(cancelled.code, Some(1), "{cancelled:?}");
        let rest = call_with(BLIND, &bench, &mock, "");
        assert_eq!(rest.code, Some(0), "{rest:?}");
        assert_each_once_but_lost(&bench, &mock, QUESTIONS - replies);
    }
}

/// Asserts that every trial has a reply, and that the second batch has `again` requests.
fn assert_each_once_but_lost(bench: &Bench, mock: &MockBatches, again: usize) {
    assert_eq!(answered(bench).len(), QUESTIONS);
    assert_eq!(mock.asked()[1].len(), again);
}

#[test]
fn file_of_servers_page_ends_wait() {
    let (bench, mock, called) = blind(&[Course::of("completed").order(Order::Cut)], "");
    assert_stopped(&mock, &called, "cut");
    let id = mock.asked()[0][QUESTIONS - 1].clone();
    let body = r#"{"model":"m-1","choices":[{"message":{"content":"C"},"finish_reason":"stop"}]}"#;
    let line = format!(r#"{{"custom_id":"{id}","response":{{"status_code":200,"body":{body}}}}}"#);
    bench.file("page.jsonl", line + "\n");
    let imported = bench.call(&words("batch import run page.jsonl"));
    insta::assert_snapshot!(imported, @"
    exit code: 0
    stdout:
    replies: 1 imported, 0 failed
    m · 4 questions · 1 frame · 4 replies, 0 failed · intervals by question
    ! Only 4 questions (8 are needed): wide intervals, few possible verdicts.

     accuracy in %
     without images: m 100.0 [51.0, 100.0] · chance 33.3
    run: run
    report: run/report.html
    ");
    let called = call_with(BLIND, &bench, &mock, "");
    assert_eq!(called.code, Some(0), "{called:?}");
    assert_each_once(&bench, &mock, QUESTIONS);
}

#[test]
fn deleted_output_stops_with_message() {
    let bench = Bench::with_questions(QUESTIONS);
    let mock = MockBatches::start([Course::of("completed")]);
    for _ in 0..10 {
        let gone = Answer::error(404, "not_found", "No such File object");
        mock.fault("GET files/id/content", Fault::Instead(gone));
    }
    let called = call_with(BLIND, &bench, &mock, "");
    assert_stopped(&mock, &called, "deleted");
    insta::assert_snapshot!(called.messages(), @"
    exit code: 2
     WARN part-1-m-001.jsonl: batch batch_1: its file file-2 cannot be fetched: http://127.0.0.1:[PORT]/v1
        answered 404: No such File object; looked at again
    error: http://127.0.0.1:[PORT]/v1: part-1-m-001.jsonl: batch batch_1: its file file-2 cannot be fetched:
        http://127.0.0.1:[PORT]/v1 answered 404: No such File object; nothing is asked again or deleted. The same
        command looks again; batch import run FILE imports a file of the server's page; batch cancel run frees the
        rest
    ");
}

/// A server that counts only some of the requests of a batch that it calls completed.
#[test]
fn incomplete_counts_are_awaited() {
    let (bench, mock, called) = blind(&[Course::of("completed").uncounted(1)], "");
    assert_stopped(&mock, &called, "uncounted");
    assert_eq!(answered(&bench).len(), QUESTIONS);
}

#[test]
fn fetch_imports_nothing_of_incomplete_batch() {
    let courses = [Course::of("completed").order(Order::Cut)];
    let (bench, mock, _) = blind(&courses, "--detach");
    let fetched = bench.call(&words("batch fetch run"));
    insta::assert_snapshot!(fetched.messages(), @"
    exit code: 1
     WARN part-1-m-001.jsonl: batch batch_1: the server counts 4 replies, and its files have 3; nothing is
        imported, asked again or deleted; look again later (the command of the run without --detach, or batch
        cancel, ends the wait)
    ");
    assert_eq!((answered(&bench).len(), mock.count("DELETE files/id")), (0, 0));
}

#[test]
fn uncounted_failures_are_asked_again() {
    let some = Course::of("completed").lines(|i| [Line::Right, Line::Absent][i % 2]);
    let (bench, mock, called) = blind(&[some, Course::of("completed")], "");
    assert_eq!(called.code, Some(0), "{called:?}");
    assert_each_once_but_lost(&bench, &mock, QUESTIONS / 2);
}

#[test]
fn reply_after_failure_counts() {
    let course = Course::of("in_progress completed").order(Order::AfterFailures);
    let (bench, mock, called) = blind(&[course], "");
    assert_eq!(called.code, Some(0), "{called:?}");
    assert_each_once(&bench, &mock, QUESTIONS);
}

#[test]
fn expired_batch_without_counts_is_awaited() {
    let course = Course::of("in_progress expired").late(4).late_to_count();
    let (bench, mock, called) = blind(&[course], "");
    assert_eq!(called.code, Some(0), "{called:?}");
    assert_each_once(&bench, &mock, QUESTIONS);
    assert_eq!(mock.count("POST batches"), 1);
}

#[test]
fn cancelled_batch_is_fetched_before_deletion() {
    let course =
        Course::of(&"in_progress ".repeat(1000)).lines(|i| if i < 1 { Line::Right } else { Line::Absent }).late(3);
    let (bench, _mock, _) = blind(&[course, Course::of("completed")], "--detach");
    let cancelled = bench.call(&words("batch cancel run --poll 0.02"));
    insta::assert_snapshot!(cancelled.lines_with("cancelled"), @"
    exit code: 1
    part-1-m-001.jsonl: 4 requests to m, batch_1, cancelled: 1 answered, 3 not
    ");
    assert_eq!(answered(&bench).len(), 1);
}

#[test]
fn incomplete_cancelled_batch_keeps_files() {
    let course =
        Course::of(&"in_progress ".repeat(1000)).lines(|i| if i < 1 { Line::Right } else { Line::Absent }).late(1000);
    let (bench, mock, _) = blind(&[course], "--detach");
    let cancelled = bench.call(&words("batch cancel run --poll 0.02"));
    insta::assert_snapshot!(cancelled.messages(), @"
    exit code: 1
     WARN part-1-m-001.jsonl: batch batch_1: the server counts 1 replies, and its files have 0; looked at again
     WARN part-1-m-001.jsonl: batch batch_1: the server counts 1 replies, and its files have 0; its files stay at
        the server, and its requests may be asked and paid again
    ");
    assert_eq!(mock.count("DELETE files/id"), 0);
}

#[test]
fn lost_batch_trials_are_not_repaid() {
    let course = Course::of("in_progress in_progress in_progress completed");
    let (bench, mock, _) = blind(&[course, Course::of("completed")], "--detach");
    std::fs::remove_file(bench.path("run/batch/trials.jsonl")).unwrap();
    let called = call_with(BLIND, &bench, &mock, "");
    insta::assert_snapshot!(called.messages(), @"
    exit code: 2
    error: run/batch/trials.jsonl: 4 trials of part-1-m-001.jsonl, whose batch is at the server, are missing:
        restore this file from a copy; without it they would be asked and paid again. Without a copy, cancel the
        batch on the server's page and delete run/batch
    ");
    assert_eq!(mock.count("POST batches"), 1);
}
