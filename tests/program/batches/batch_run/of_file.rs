//! Batches of the models of a file: each with its own key, settings and course.

use std::collections::BTreeSet;

use serde_json::Value;

use super::{QUESTIONS, answered, assert_each_once};
use crate::support::batches::{Course, Line, MockBatches};
use crate::support::endpoint::Answer;
use crate::support::run::{Bench, Called, called, words};

const RUN: &str = "batch run --data set.jsonl --models models.toml --trust-models --out run --poll 0.02";

const TEMPERATURE: &str = "'temperature' is not supported with this model: only the default (1) is supported";

/// A folder with a file of two blind models at one server; `keys` are further lines of each.
fn bench_of_two(mock: &MockBatches, models: [&str; 2]) -> Bench {
    let bench = Bench::with_questions(QUESTIONS);
    let base = mock.base_url();
    let table = |keys: &str| format!("[[model]]\n{keys}\nview = \"blind\"\nendpoints = [\"{base}\"]\n");
    bench.file("models.toml", models.map(table).concat());
    bench
}

/// A call with the variables that the file names.
fn call(bench: &Bench, line: &str) -> Called {
    let mut command = bench.command(&words(line));
    called(command.env("TEAM_A", "key-a").env("TEAM_B", "key-b"))
}

#[test]
fn batches_use_key_of_model() {
    let mock = MockBatches::start([Course::of("in_progress completed")]);
    let keys = ["name = \"A\"\nid = \"m\"\nkey-env = \"TEAM_A\"", "name = \"B\"\nid = \"n\"\nkey-env = \"TEAM_B\""];
    let bench = bench_of_two(&mock, keys);
    let detached = call(&bench, &format!("{RUN} --no-scout --detach"));
    assert_eq!(detached.code, Some(0), "{detached:?}");
    let uploads: Vec<(bool, String)> = mock
        .requests()
        .iter()
        .filter(|request| request.line.starts_with("POST /v1/files"))
        .map(|request| {
            let body = String::from_utf8_lossy(&request.body);
            let key = request.header("authorization").unwrap();
            (body.contains("\"model\":\"m\""), key.to_owned())
        })
        .collect();
    let own = [(true, "Bearer key-a"), (false, "Bearer key-b")];
    assert_eq!(uploads, own.map(|(is_a, key)| (is_a, key.to_owned())));
    // One key is not enough for both, and says so before anything is asked.
    let before = mock.requests().len();
    for command in ["batch fetch run", "batch cancel run --poll 0.02"] {
        let refused = call(&bench, command);
        assert_eq!(refused.code, Some(2), "{refused:?}");
        assert!(refused.stderr.contains("of A and B"), "{refused:?}");
    }
    assert_eq!(mock.requests().len(), before);
    let called = call(&bench, RUN);
    assert_eq!(called.code, Some(0), "{called:?}");
    assert_each_once(&bench, &mock, 2 * QUESTIONS);
    for request in mock.requests() {
        let key = request.header("authorization").unwrap().to_owned();
        assert!(["Bearer key-a", "Bearer key-b"].contains(&&*key));
        let of = |id: &str| request.line.contains(id);
        if of("batch_1") || of("batch_2") {
            assert_eq!(of("batch_1"), key == "Bearer key-a", "{}", request.line);
        }
    }
}

#[test]
fn folder_fetches_models_with_one_key() {
    let mock = MockBatches::start([Course::of("completed")]);
    let keys = ["id = \"m\"\nrpm = 100", "id = \"n\"\nrpm = 200"];
    let bench = bench_of_two(&mock, keys);
    let detached = call(&bench, &format!("{RUN} --no-scout --detach"));
    assert_eq!(detached.code, Some(0), "{detached:?}");
    let fetched = call(&bench, "batch fetch run");
    assert_eq!(fetched.code, Some(0), "{fetched:?}");
    assert_each_once(&bench, &mock, 2 * QUESTIONS);
}

#[test]
fn refused_batch_field_affects_one_model() {
    let refused = Course::of("completed").lines(|_| Line::Status(400, TEMPERATURE));
    let mock = MockBatches::start([Course::of("completed"), refused, Course::of("completed")]);
    let keys = ["name = \"A\"\nid = \"m\"", "name = \"B\"\nid = \"m\"\ndeployment = \"b\""];
    let bench = bench_of_two(&mock, keys);
    let called = call(&bench, &format!("{RUN} --no-scout"));
    assert_eq!(called.code, Some(0), "{called:?}");
    mock.with(|server| {
        let sent: Vec<bool> =
            server.batches.iter().map(|one| one.requests[0]["body"].get("temperature").is_some()).collect();
        assert_eq!(sent, [true, true, false]);
    });
    let manifest = bench.path("run/manifest.json");
    let manifest: Value = serde_json::from_slice(&std::fs::read(manifest).unwrap()).unwrap();
    let settings = &manifest["settings"];
    assert!(settings.get("adapted for B").is_some(), "{settings}");
    assert!(settings.get("adapted for A").is_none(), "{settings}");
}

#[test]
fn refused_field_costs_submitted_batches() {
    let refused = Course::of("completed").lines(|_| Line::Status(400, TEMPERATURE));
    let courses = [refused.clone(), refused, Course::of("completed")];
    let (bench, mock, called) = super::blind(&courses, "--file-requests 2");
    assert_eq!(called.code, Some(0), "{called:?}");
    assert_eq!(answered(&bench).len(), QUESTIONS);
    assert_eq!(mock.asked().len(), 4);
}

#[test]
fn unusable_model_stops_alone() {
    let mock = MockBatches::start([Course::of("completed")]);
    mock.chat(|body| match body["model"].as_str() {
        Some("typo") => Answer::error(404, "model_not_found", "no such model"),
        _ => Answer::text("C"),
    });
    let bench = bench_of_two(&mock, ["id = \"typo\"", "id = \"m\""]);
    let called = call(&bench, RUN);
    insta::assert_snapshot!(called.lines_with("not asked"), @"
    exit code: 1
    ! not asked any further: http://127.0.0.1:[PORT]/v1: typo: http://127.0.0.1:[PORT]/v1 answered 404: no such
        model (the server knows no model of this name: check --model and --base-url) (replies so far are stored;
        the same command continues)
    ");
    let models: BTreeSet<String> =
        answered(&bench).iter().map(|record| record["model"].as_str().unwrap().to_owned()).collect();
    assert_eq!(models, BTreeSet::from(["m".to_owned()]));
    assert_eq!(answered(&bench).len(), QUESTIONS);
    // Nothing of the other is in a batch.
    assert_eq!(mock.asked().concat().len(), QUESTIONS - 1);
}

#[test]
fn vendor_refusing_batches_stops_its_models() {
    let (one, two) = (
        MockBatches::start([Course::failing("x", "this line is no JSON", &Value::Null)]),
        MockBatches::start([Course::of("in_progress completed")]),
    );
    let bench = Bench::with_questions(QUESTIONS);
    let table = |id: &str, mock: &MockBatches| {
        let base = mock.base_url();
        format!("[[model]]\nid = \"{id}\"\nview = \"blind\"\nendpoints = [\"{base}\"]\n")
    };
    bench.file("models.toml", table("m", &one) + &table("n", &two));
    let called = call(&bench, &format!("{RUN} --no-scout"));
    insta::assert_snapshot!(called, @"
    exit code: 1
    stdout:
    2 models · 4 questions · 1 frame · 4 replies, 4 failed · intervals by question
    ! run: stopped: 4 of 8 trials answered, 4 failed. The same command asks the
      rest.
    ! 4 trials of m failed and are not scored: no whole reply in time.
    ! Only 4 questions (8 are needed): wide intervals, few possible verdicts.

     accuracy in %
     without images: n 100.0 [51.0, 100.0] · chance 33.3
    run: run
    report: run/report.html
    ! not asked any further: http://127.0.0.1:[PORT]/v1: part-1-m-001.jsonl: the batch batch_1 failed: this line
        is no JSON (x); none of its requests has a reply
    ");
    assert_eq!(answered(&bench).len(), QUESTIONS);
    // What cannot be begun is not tried again by the same command.
    assert_eq!(one.count("POST batches"), 1);
}

#[test]
fn detached_run_keeps_adapted_requests() {
    let mock = MockBatches::start([Course::of("completed")]);
    mock.chat(|body| match body.get("temperature") {
        Some(_) => Answer::error(400, "unsupported_value", TEMPERATURE),
        None => Answer::text("C"),
    });
    let bench = bench_of_two(&mock, ["id = \"m\"", "id = \"n\""]);
    let detached = call(&bench, &format!("{RUN} --detach"));
    assert_eq!(detached.code, Some(0), "{detached:?}");
    let fetched = call(&bench, "batch fetch run");
    assert_eq!(fetched.code, Some(0), "{fetched:?}");
    let manifest = bench.path("run/manifest.json");
    let manifest: Value = serde_json::from_slice(&std::fs::read(manifest).unwrap()).unwrap();
    for model in ["m", "n"] {
        let changes = &manifest["settings"][format!("adapted for {model}")];
        assert!(changes.to_string().contains("temperature"), "{changes}");
    }
}
