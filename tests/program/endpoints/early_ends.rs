//! Replies that the server ends early, or refuses for their content: scored in the same way under any word, and paid
//! for twice at most.

use std::collections::HashMap;
use std::sync::Mutex;

use rand::rngs::StdRng;
use rand::{RngExt as _, SeedableRng as _};
use serde_json::{Value, json};

use crate::support::endpoint::{Answer, MockEndpoint};
use crate::support::run::{Bench, Called, model_args, records};
use crate::support::table::check_rows;

/// Number of questions, of which [`ENDED`] end early.
const QUESTIONS: usize = 10;
const ENDED: [usize; 3] = [1, 4, 8];

/// Index of the question in a request.
fn question(body: &Value) -> usize {
    let text = body["messages"][0]["content"].to_string();
    (0..QUESTIONS).find(|i| text.contains(&format!("is it, {i}?"))).unwrap()
}

/// An endpoint that answers right, except at the questions in [`ENDED`]: there `event` gets the number of earlier
/// requests about it.
fn endpoint(event: impl Fn(usize) -> Answer + Send + Sync + 'static) -> MockEndpoint {
    let asked = Mutex::new(HashMap::<usize, usize>::new());
    MockEndpoint::answering(move |body| {
        let question = question(body);
        let mut asked = asked.lock().unwrap();
        let times = asked.entry(question).or_default();
        *times += 1;
        if ENDED.contains(&question) { event(*times - 1) } else { Answer::text("C") }
    })
}

/// A run, with its numbers of right, scored and failed trials, and of requests about each question.
struct Run {
    called: Called,
    right: usize,
    scored: usize,
    failed: usize,
    requests: Vec<usize>,
    bench: Bench,
}

fn run(mock: &MockEndpoint, more: &str) -> Run {
    let bench = Bench::with_questions(QUESTIONS);
    let base = mock.base_url();
    let line = format!("--data set.jsonl --levels L0 --out run {more}");
    let called = bench.call(&model_args(&base, &line));
    let records = records(&bench.path("run"));
    let count = |outcomes: &[&str]| {
        let of = |record: &&Value| outcomes.iter().any(|outcome| record["outcome"] == *outcome);
        records.iter().filter(of).count()
    };
    let mut requests = vec![0; QUESTIONS];
    for request in mock.requests() {
        requests[question(&request.json())] += 1;
    }
    Run {
        right: count(&["right"]),
        scored: count(&["right", "wrong", "unparsed"]),
        failed: count(&["failed"]),
        called,
        requests,
        bench,
    }
}

fn ended(word: &str, text: &str) -> Answer {
    Answer::message(&json!({"content": text}), word)
}

/// A made-up word of letters.
fn word(random: &mut StdRng) -> String {
    let length = random.random_range(4..12);
    (0..length).map(|_| char::from(b'a' + random.random_range(0..26_u8))).collect()
}

/// The same event under any name of the vendor: the trials count as unread, and are paid for twice at most.
#[test]
fn renaming_an_early_end_moves_no_accuracy() {
    let mut random = StdRng::seed_from_u64(7);
    let mut events: Vec<(String, Answer)> = Vec::new();
    for name in ["content_filter", "length", "sensitive", "repetition", "model_context_window_exceeded"] {
        events.push((name.to_owned(), ended(name, "")));
    }
    for text in ["", "It looks like a", "The answer is C."] {
        let name = word(&mut random);
        events.push((format!("{name} {text:?}"), ended(&name, text)));
    }
    for status in [400, 403, 404, 410, 418, 422, 451] {
        let (code, message) = (word(&mut random), word(&mut random));
        events.push((format!("{status} {code}"), Answer::error(status, &code, &message)));
    }
    for body in [
        json!({"choices": null, "base_resp": {"status_code": 1026, "status_msg": "input new_sensitive"}}),
        json!({"error_code": 336_104, "error_msg": "the content is inappropriate"}),
        json!({"error": {"code": "invalid_prompt", "message": "flagged as violating our usage policy"}}),
    ] {
        events.push((body.to_string(), Answer::json(200, &body)));
    }
    check_rows(events, |(name, answer)| {
        let mock = endpoint(move |_| answer.clone());
        let run = run(&mock, "");
        assert_eq!((run.right, run.scored, run.failed), (7, 10, 0), "{name}: {:?}", run.called);
        assert!(run.requests.iter().all(|requests| *requests <= 2), "{name}");
        let total: usize = run.requests.iter().sum();
        // The first trial with an unknown word or cause is asked again; before the first answer each one may be.
        assert!(total <= QUESTIONS + ENDED.len(), "{name}: {total}");
    });
}

/// What another try heals is asked again, and answered.
#[test]
fn broken_generations_are_asked_again() {
    let rows = ["insufficient_system_resource", "abort", "zeitgeist"];
    check_rows(rows, |word| {
        let mock = endpoint(move |times| match times {
            0 => ended(word, "A"),
            _ => Answer::text("C"),
        });
        let run = run(&mock, "");
        assert_eq!((run.right, run.failed), (10, 0), "{word}: {:?}", run.called);
        assert!(run.requests.iter().all(|requests| *requests <= 2), "{word}");
    });
}

/// The server has worked twice then, so that there is no third request.
#[test]
fn second_try_that_a_gateway_cuts_is_the_last() {
    let mock = endpoint(|times| match times {
        0 => ended("zeitgeist", ""),
        _ => Answer::error(524, "timeout", "A timeout occurred"),
    });
    let run = run(&mock, "");
    assert_eq!(run.failed, ENDED.len(), "{:?}", run.called);
    for (question, requests) in run.requests.iter().enumerate() {
        let expected = 1 + usize::from(ENDED.contains(&question));
        assert_eq!(*requests, expected, "{question}: {:?}", run.called);
    }
}

#[test]
fn refusal_that_heals_is_answered() {
    let mock = endpoint(|times| match times {
        0 => Answer::error(403, "odd", "no"),
        _ => Answer::text("C"),
    });
    let run = run(&mock, "");
    assert_eq!((run.right, run.failed), (10, 0), "{:?}", run.called);
}

#[test]
fn refusals_of_all_requests_stop_the_model() {
    let rows = [(Answer::error(401, "x", "no"), 1), (Answer::error(403, "x", "no"), 3), (Answer::new(404, ""), 3)];
    check_rows(rows, |(answer, requests)| {
        let mock = MockEndpoint::start([answer]);
        let run = run(&mock, "");
        assert_eq!(run.called.code, Some(2), "{:?}", run.called);
        assert_eq!((mock.requests().len(), run.scored), (requests, 0));
    });
}

/// A server that begins to refuse everything is no filter of the content.
#[test]
fn revoked_key_is_no_filter() {
    let mock = MockEndpoint::start([Answer::text("C"), Answer::text("C"), Answer::error(403, "x", "no")]);
    let run = run(&mock, "--concurrency 1");
    assert_eq!((run.right, run.scored), (2, 2), "{:?}", run.called);
}

#[test]
fn thoughts_without_an_answer_are_asked_again_once() {
    let thought = json!({"content": "", "reasoning_content": "A? B?"});
    let lost = endpoint({
        let thought = thought.clone();
        move |times| match times {
            0 => Answer::message(&thought, "stop"),
            _ => Answer::text("C"),
        }
    });
    assert_eq!(run(&lost, "").right, 10);
    let none = endpoint(move |_| Answer::message(&thought, "stop"));
    let run = run(&none, "");
    assert_eq!((run.right, run.scored), (7, 10));
    assert!(ENDED.iter().all(|question| run.requests[*question] == 2));
}

#[test]
fn refused_content_is_not_asked_again() {
    let mock = endpoint(|_| Answer::error(400, "content_filter", "The prompt was filtered"));
    let run = run(&mock, "");
    assert_eq!(run.called.code, Some(0), "{:?}", run.called);
    let base = mock.base_url();
    let line = "--data set.jsonl --levels L0 --out run";
    let again = run.bench.call(&model_args(&base, line));
    assert_eq!((again.code, mock.requests().len()), (Some(0), QUESTIONS));
    let records = records(&run.bench.path("run"));
    let refused = records.iter().find(|record| record["finish"] == "filter").unwrap();
    assert_eq!(refused["refusal"], "400: The prompt was filtered");
    assert_eq!(refused["strict"]["why"], "filtered");
}

/// The report counts the words of the server at each level.
#[test]
fn words_of_early_ends_are_counted() {
    let mock = endpoint(|_| ended("NO_IMAGE", ""));
    let run = run(&mock, "");
    let summary = std::fs::read_to_string(run.bench.path("run/summary.json")).unwrap();
    let words = "3 of 10 replies of m ended early without an answer, and count as wrong: NO_IMAGE 3 (L0 3 of 10).";
    assert!(summary.contains(words), "{summary}");
    let plain = endpoint(|_| Answer::text("A"));
    let run = self::run(&plain, "");
    let summary = std::fs::read_to_string(run.bench.path("run/summary.json")).unwrap();
    assert!(!summary.contains("ended early"), "{summary}");
}

#[test]
fn used_up_limit_names_the_flag() {
    let words = "Could not finish the message because max_tokens or model output limit was reached. Please try again with higher max_tokens.";
    let mock = endpoint(move |_| Answer::error(400, "x", words));
    let run = run(&mock, "");
    assert_eq!((run.right, run.scored), (7, 10), "{:?}", run.called);
    assert_eq!(mock.requests().len(), QUESTIONS);
    let summary = std::fs::read_to_string(run.bench.path("run/summary.json")).unwrap();
    assert!(summary.contains("a larger --max-tokens"), "{summary}");
}

/// Refusals that an earlier version stored as failures count as those of this version.
#[test]
fn stored_refusals_count_as_filtered() {
    let mock = endpoint(|_| Answer::error(400, "content_filter", "The prompt was filtered"));
    let run = run(&mock, "");
    let summary = std::fs::read_to_string(run.bench.path("run/summary.csv")).unwrap();
    let old: Vec<String> = records(&run.bench.path("run"))
        .into_iter()
        .map(|mut record| {
            if record["finish"] == "filter" {
                for field in ["reply", "refusal", "finish", "strict", "lenient", "latency_ms"] {
                    record[field] = Value::Null;
                }
                record["outcome"] = "failed".into();
                record["failure"] = json!({"kind": "filtered", "status": 400, "message": "filtered"});
            }
            format!("{record}\n")
        })
        .collect();
    assert!(old.concat().contains("failed"));
    run.bench.file("run/records.jsonl", old.concat());
    run.bench.complete(&["report", "run"]);
    let again = std::fs::read_to_string(run.bench.path("run/summary.csv")).unwrap();
    assert_eq!(again, summary);
}
