//! Limits: tokens that may wait, and dollars.

use serde_json::Value;

use super::{BLIND, QUESTIONS, answered, assert_each_once, blind, call_with};
use crate::support::batches::{Course, MockBatches};
use crate::support::endpoint::Answer;
use crate::support::run::{Bench, words};

const QUOTA: &str = "Enqueued token limit reached for m in organization o. Limit: 1,000,000 enqueued tokens. Please try again once some \
    in_progress batches have been completed.";

#[test]
fn a_full_quota_is_a_wait() {
    let refused = Course::refused(Answer::error(429, "token_limit_exceeded", QUOTA));
    let failed = Course::failing("token_limit_exceeded", QUOTA, &Value::Null);
    for first in [refused, failed] {
        let (bench, mock, called) = blind(&[first, Course::of("completed")], "");
        assert_eq!(called.code, Some(0), "{called:?}");
        assert!(called.stderr.contains("at most 1000000 tokens"), "{called:?}");
        assert_each_once(&bench, &mock, QUESTIONS);
        // The file is not uploaded again.
        assert_eq!((mock.count("POST files"), mock.count("POST batches")), (1, 2));
    }
}

#[test]
fn waiting_tokens_respect_server_limit() {
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
    let calls: Vec<&str> = log.iter().map(String::as_str).filter(|one| one.contains("batches")).collect();
    let one = ["POST batches", "GET batches/id", "GET batches/id", "GET batches/id"];
    assert_eq!(calls, one.repeat(QUESTIONS));
}

#[test]
fn part_over_quota_is_split() {
    let words = "Enqueued token limit reached for m in organization o. Limit: 120 enqueued tokens.";
    let small = Course::refused(Answer::error(429, "token_limit_exceeded", words));
    let (bench, mock, called) = blind(&[small, Course::of("completed")], "");
    assert_eq!(called.code, Some(0), "{called:?}");
    assert_each_once(&bench, &mock, QUESTIONS);
    assert_eq!(mock.asked().len(), QUESTIONS);
    // One that is refused again and again although nothing else waits.
    let full = Course::failing("token_limit_exceeded", QUOTA, &Value::Null);
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
    insta::assert_snapshot!(called.messages(), @"
    exit code: 2
     WARN m: at most 7 tokens may wait for batches; further ones are submitted when others have ended
    error: http://127.0.0.1:[PORT]/v1: part-1-m-001.jsonl: one request has about 64 tokens, more than may wait for
        batches of m; send smaller images with --image max-side=N
    ");
}

#[test]
fn cost_limit_uses_batch_price() {
    let prices = "as-of = \"2026-01-01\"\nbatch = 0.5\n[models]\nm = { input = 10, output = 10 }\n";
    let bench = Bench::with_questions(QUESTIONS);
    bench.file("prices.toml", prices);
    let mock = MockBatches::start([Course::of("completed")]);
    // A reply is charged 91 tokens at half of 10 dollars a million: $0.000455. A question a part, which may cost up to
    // $0.0012: the bytes of its text, 64 and 16 tokens.
    let limited = |limit: &str| {
        let more =
            format!("--prices prices.toml --file-requests 1 --enqueued-tokens 60 --max-tokens 16 --max-cost {limit}");
        call_with(BLIND, &bench, &mock, &more)
    };
    let called = limited("0.002");
    insta::assert_snapshot!(called.messages(), @"
    exit code: 3
     WARN stopped: one more batch could exceed the $0.0020 of --max-cost; the same command with a higher limit
        continues, and batch cancel frees the requests that wait
    ");
    assert_eq!(answered(&bench).len(), 2, "{called:?}");
    let called = limited("0.01");
    assert_eq!(called.code, Some(0), "{called:?}");
    assert_each_once(&bench, &mock, QUESTIONS);
}

#[test]
fn cost_limit_holds_for_file_models() {
    // The name in tables has no row in the table of prices; the id has one, or the file states the price.
    let table = "as-of = \"2026-01-01\"\nbatch = 0.5\n[models]\nm = { input = 10, output = 10 }\n";
    let other = "as-of = \"2026-01-01\"\nbatch = 0.5\n[models]\nother = { input = 1, output = 1 }\n";
    for (prices, price) in [(table, ""), (other, "price = { input = 10, output = 10 }\n")] {
        let bench = Bench::with_questions(QUESTIONS);
        let mock = MockBatches::start([Course::of("completed")]);
        bench.file("prices.toml", prices);
        let base = mock.base_url();
        let models =
            format!("[[model]]\nname = \"A name\"\nid = \"m\"\nview = \"blind\"\nendpoints = [\"{base}\"]\n{price}");
        bench.file("models.toml", models);
        let limited = |limit: &str| {
            let line = format!(
                "batch run --data set.jsonl --models models.toml --out run --poll 0.02 --no-scout --prices prices.toml \
                 --file-requests 1 --enqueued-tokens 60 --max-tokens 16 --max-cost {limit}"
            );
            bench.call(&words(&line))
        };
        // Two replies of $0.000455.
        let called = limited("0.002");
        assert_eq!(called.code, Some(3), "{called:?}");
        assert_eq!(answered(&bench).len(), 2, "{called:?}");
        let called = limited("0.01");
        assert_eq!(called.code, Some(0), "{called:?}");
        assert_each_once(&bench, &mock, QUESTIONS);
    }
}

/// Replies that are as long as their limit, where a letter was expected.
#[test]
fn token_limit_bounds_batch() {
    let bench = Bench::with_questions(40);
    let prices = "as-of = \"2026-01-01\"\nbatch = 0.5\n[models]\nm = { input = 1, output = 100 }\n";
    bench.file("prices.toml", prices);
    let mock = MockBatches::start([Course::of("completed").tokens(1024)]);
    let more = "--prices prices.toml --max-cost 1";
    let called = call_with(BLIND, &bench, &mock, more);
    assert_eq!(called.code, Some(3), "{called:?}");
    // $0.0513 each.
    let sent = mock.asked().concat().len();
    assert!((16..=19).contains(&sent), "{sent}: {called:?}");
    assert_eq!(answered(&bench).len(), sent);
    // Short replies release what was reserved for long ones, so all are asked, one batch after the other.
    let bench = Bench::with_questions(40);
    bench.file("prices.toml", prices);
    let mock = MockBatches::start([Course::of("completed")]);
    let called = call_with(BLIND, &bench, &mock, more);
    assert_eq!(called.code, Some(0), "{called:?}");
    assert_each_once(&bench, &mock, 40);
    assert!(mock.asked().len() > 1);
}

/// Batches that are out count against the limit of a run that asks directly.
#[test]
fn direct_run_leaves_room_for_batches() {
    let bench = Bench::with_questions(QUESTIONS);
    let prices = "as-of = \"2026-01-01\"\nbatch = 0.5\n[models]\nm = { input = 1, output = 100 }\n";
    bench.file("prices.toml", prices);
    let mock = MockBatches::start([Course::of(&"in_progress ".repeat(99))]);
    let more = "--prices prices.toml --max-cost 0.25 --detach --limit 3";
    let called = call_with(BLIND, &bench, &mock, more);
    assert_eq!(called.code, Some(0), "{called:?}");
    // Three requests of up to $0.0513 are out, so one of $0.1026 does not fit.
    let direct = "--data set.jsonl --blind-model m --resume run --prices prices.toml --max-cost 0.25";
    let called = call_with(direct, &bench, &mock, "");
    assert_eq!((called.code, mock.count("POST chat/completions")), (Some(3), 0), "{called:?}");
}
