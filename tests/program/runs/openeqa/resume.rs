//! Runs that go on: after a stop, and with replies of a batch.

use std::fs;

use serde_json::{Value, json};

use super::images;
use crate::support::endpoint::{Answer, MockEndpoint};
use crate::support::house::House;
use crate::support::run::{model_args, records, words};

#[test]
fn batch_replies_are_imported_on_resume() {
    let house = House::new();
    let silent = MockEndpoint::start([Answer::error(400, "bad", "must not be asked")]);
    let base = silent.base_url();
    let args = model_args(&base, "--judge j --levels L0,L4 --out run");
    let batch = [&args[..], &["--batch"]].concat();
    let called = house.call(&batch);
    insta::assert_snapshot!(called, @"
    exit code: 0
    stdout:
    6 requests in 1 file; 0 already answered, 0 waiting for an earlier batch
    run/batch/1-m-001.jsonl (6 requests)
    upload each file to the Batch API, then run: darkqa-eval batch import run OUTPUT.jsonl ERRORS.jsonl …
    then run the same command again, for the remaining requests and the marks
    stderr:
     WARN 1 of 2 walks has fewer frames than --num-frames 3: they are shown several times in a request, as
        upstream does (the 2 frames of scannet-v0/001-b, for example)
    ");
    let answer = |file: &str, text: &dyn Fn(usize) -> String| {
        let input = fs::read_to_string(house.0.path(file)).unwrap();
        let lines = input.lines().enumerate().map(|(i, line)| {
            let line: Value = serde_json::from_str(line).unwrap();
            let body = json!({"choices": [{"message": {"content": text(i)}, "finish_reason": "stop"}], "usage": {"prompt_tokens": 9}});
            let line = json!({"custom_id": line["custom_id"], "response": {"status_code": 200, "body": body}, "error": null});
            format!("{line}\n")
        });
        house.0.file("out.jsonl", lines.collect::<String>());
        let called = house.0.call(&words("batch import run out.jsonl"));
        assert_eq!(called.code, Some(0), "{called:?}");
        assert!(called.stdout.contains("imported, 0 failed"), "{called:?}");
    };
    let line: Value = serde_json::from_str(
        fs::read_to_string(house.0.path("run/batch/1-m-001.jsonl")).unwrap().lines().next().unwrap(),
    )
    .unwrap();
    assert_eq!(images(&line["body"]).len(), 3);
    answer("run/batch/1-m-001.jsonl", &|i| format!("answer {i}"));
    // Now the marks, one for each different answer.
    let called = house.call(&batch);
    insta::assert_snapshot!(called, @"
    exit code: 0
    stdout:
    6 requests in 1 file; 0 already answered, 0 waiting for an earlier batch
    run/batch/1-j-001.jsonl (6 requests)
    upload each file to the Batch API, then run: darkqa-eval batch import run OUTPUT.jsonl ERRORS.jsonl …
    stderr:
     WARN 1 of 2 walks has fewer frames than --num-frames 3: they are shown several times in a request, as
        upstream does (the 2 frames of scannet-v0/001-b, for example)
    ");
    answer("run/batch/1-j-001.jsonl", &|_| "Your mark: 4".to_owned());
    let called = house.call(&args);
    insta::assert_snapshot!(called.lines_with("75.0"), @"
    exit code: 0
     m       with noise   75.0   75.0 (0.0)   6 of 6   −72.1 +24.7
     m       with noise   hm3d-v0                 75.0   75.0 (0.0)   −57.6 +22.7
                          scannet-v0              75.0   75.0 (0.0)   −63.2 +23.5
                          attribute recognition   75.0   75.0 (0.0)   −63.2 +23.5
                          object localization     75.0   75.0 (0.0)   −63.2 +23.5
                          world knowledge         75.0   75.0 (0.0)   −63.2 +23.5
    ");
    assert!(silent.requests().is_empty());
    // As a whole it is there already.
    assert_eq!(house.call(&args).stdout, called.stdout);
    // Another judge marks the same answers.
    house.0.file("j.jsonl", "{\"default\": \"1\"}");
    let other = [&args[..4], &words("--judge script:j.jsonl --levels L0,L4 --out run")].concat();
    let called = house.call(&other);
    assert!(called.stdout.contains("0.0 (0.0)") && silent.requests().is_empty(), "{called:?}");
}

#[test]
fn stopped_open_run_resumes() {
    let house = House::new();
    let refused = Answer::error(401, "invalid_api_key", "no");
    let model = MockEndpoint::start([Answer::text("one"), refused]);
    let base = model.base_url();
    let args = model_args(&base, "--levels L0 --concurrency 1 --out run");
    let called = house.call(&args);
    assert_eq!(called.code, Some(2), "{called:?}");
    assert_eq!(records(&house.0.path("run")).len(), 1);
    let well = MockEndpoint::start([Answer::text("more")]);
    let base = well.base_url();
    let again = model_args(&base, "--levels L0 --concurrency 1 --resume run");
    let called = house.call(&again);
    assert_eq!(called.code, Some(0), "{called:?}");
    assert_eq!(well.requests().len(), 2);
    // An evaluation is not mixed up with it.
    let other = words("--data rooms:frames=1 --model random --out run");
    let called = house.0.call(&other);
    insta::assert_snapshot!(called.messages(), @r#"
    exit code: 2
    error: run/manifest.json: the run has the schema "darkqa.openeqa/2", "darkqa.run/2" is expected here; use
        another folder
    "#);
}
