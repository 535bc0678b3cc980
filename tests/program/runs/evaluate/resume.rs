//! The same command on a folder that holds a run: what is asked again, and what is not.

use std::fs;

use serde_json::{Value, json};

use crate::support::endpoint::{Answer, MockEndpoint};
use crate::support::run::{Bench, model_args, records, words};
use crate::support::snapshot::{lines_with, redacted};
use crate::support::table::check_rows;

#[test]
fn stopped_run_resumes() {
    let bench = Bench::with_frames();
    let answers = std::iter::repeat_n(Answer::text("A"), 4)
        .chain([Answer::error(401, "invalid_api_key", "no such key")])
        .chain([Answer::text("B")]);
    let endpoint = MockEndpoint::start(answers);
    let url = endpoint.base_url();
    let args = model_args(&url, "--data frames --levels L0-L2 --concurrency 1");
    let stopped = bench.call(&args);
    insta::assert_snapshot!(stopped.messages(), @"
    exit code: 2
    error: http://127.0.0.1:[PORT]/v1: m: http://127.0.0.1:[PORT]/v1 answered 401: no such key (no key was sent:
        set OPENAI_API_KEY, or name another variable or a file with --api-key-env or --api-key-file) (replies so
        far are stored; the same command continues)
    ");
    let runs: Vec<_> = fs::read_dir(bench.path("results")).unwrap().map(|entry| entry.unwrap().path()).collect();
    assert_eq!((runs.len(), records(&runs[0]).len()), (1, 4));

    bench.complete(&args);
    assert_eq!(endpoint.requests().len(), 15 + 1, "3 questions in 5 conditions, and the one that was refused");
    assert_eq!(records(&runs[0]).len(), 15);

    let table = bench.complete(&args);
    insta::assert_snapshot!(lines_with(&table, "exposure drop"), @"exposure drop   0.0    0.0   66.7   −65.4 +98.4");
    assert_eq!(endpoint.requests().len(), 15 + 1, "a complete run asks nothing");
}

#[test]
fn mistyped_address_does_not_bind_run() {
    let bench = Bench::with_frames();
    let line = "--data frames --levels L0 --retries 0 --out run";
    let wrong = bench.call(&model_args("http://127.0.0.1:9/v1", line));
    assert_eq!(wrong.code, Some(1), "{wrong:?}");
    let endpoint = MockEndpoint::start([Answer::text("A")]);
    let right = bench.call(&model_args(&endpoint.base_url(), line));
    insta::assert_snapshot!(right.messages(), @r#"
    exit code: 0
     WARN m was asked at "http://127.0.0.1:9/v1" in this run; from now on it is asked at
        "http://127.0.0.1:[PORT]/v1"
    "#);
    // Now there are replies, so that another address needs a word of the user.
    let other = MockEndpoint::start([Answer::text("A")]);
    let refused = bench.call(&model_args(&other.base_url(), line));
    insta::assert_snapshot!(refused.messages(), @r#"
    exit code: 2
    error: run: the model m has another --base-url in this run: it was "http://127.0.0.1:[PORT]/v1", now it is
        "http://127.0.0.1:[PORT]/v1"; use another --out, or the same --base-url (the same model at another
        address: --resume)
    "#);
}

#[test]
fn only_torn_record_is_repeated() {
    let bench = Bench::with_frames();
    let endpoint = MockEndpoint::start([Answer::text("A")]);
    let url = endpoint.base_url();
    let args = model_args(&url, "--data frames --levels L0 --out run");
    bench.complete(&args);
    let path = bench.path("run/records.jsonl");
    let stored = fs::read(&path).unwrap();
    fs::write(&path, &stored[..stored.len() - 20]).unwrap();
    let manifest = fs::read_to_string(bench.path("run/manifest.json")).unwrap();
    bench.file("run/manifest.json", manifest.replace("\"complete\"", "\"started\""));
    bench.complete(&args);
    assert_eq!((records(&bench.path("run")).len(), endpoint.requests().len()), (3, 4));
}

#[test]
fn failed_trials_are_counted_and_repeated() {
    let bench = Bench::with_frames();
    let broken = Answer::error(413, "bad_image", "cannot look at this");
    let endpoint = MockEndpoint::start([Answer::text("B"), broken, Answer::text("A")]);
    let url = endpoint.base_url();
    let args = model_args(&url, "--data frames --levels L0 --concurrency 1 --out run");
    let first = bench.call(&args);
    assert_eq!(first.code, Some(1), "{first:?}");
    let csv = fs::read_to_string(bench.path("run/summary.csv")).unwrap();
    assert!(csv.contains("m,image,L0,none,,all,strict,2,2,0,1,1"), "{csv}");
    let failed = records(&bench.path("run")).into_iter().find(|record| record["outcome"] == "failed").unwrap();
    assert_eq!((&failed["failure"]["status"], &failed["strict"]), (&json!(413), &Value::Null));
    bench.complete(&args);
    assert_eq!(endpoint.requests().len(), 4, "only the failed one is asked again");
}

#[test]
fn other_configuration_is_refused() {
    let bench = Bench::new();
    let args = words("--model random --levels L0 --out run");
    bench.complete(&args);
    let rows = [("--seed", "7"), ("--image", "jpeg:90")];
    check_rows(rows, |(field, value)| {
        let refused = bench.call(&[&args[..], &[field, value]].concat());
        assert_eq!(refused.code, Some(2), "{refused:?}");
        assert!(refused.stderr.contains(&format!("another {field}")), "{refused:?}");
    });
}

#[test]
fn stored_replies_parse_like_new() {
    let bench = Bench::with_frames();
    bench.file("script.jsonl", "{\"default\":\"A\"}\n");
    let args = words("--data frames --model script:script.jsonl --levels L0 --out run");
    let table = bench.complete(&args);
    let path = bench.path("run/records.jsonl");
    let records = fs::read_to_string(&path).unwrap();
    fs::write(&path, records.replace("\"chosen\":0", "\"chosen\":1")).unwrap();
    assert_eq!(bench.complete(&args), table);
}

#[test]
fn showing_a_complete_run_changes_nothing() {
    let bench = Bench::new();
    let args = words("--model random --levels L0 --out run");
    let table = bench.complete(&args);
    let file = |name: &str| fs::read(bench.path("run").join(name)).unwrap();
    let before = ["manifest.json", "summary.json", "records.jsonl"].map(file);
    let more = [&args[..], &["--concurrency", "3"]].concat();
    assert_eq!(bench.complete(&more), table);
    assert_eq!(["manifest.json", "summary.json", "records.jsonl"].map(file), before);
}

#[test]
fn dry_run_refuses_what_run_refuses() {
    let bench = Bench::with_frames();
    let line = "--model random --data frames --levels L0,L3 --out run";
    bench.complete(&words(line));
    for more in ["--seed 3", "--seed 3 --dry-run"] {
        let called = bench.call(&words(&format!("{line} {more}")));
        assert_eq!(called.code, Some(2), "{more}: {called:?}");
        assert!(called.stderr.contains("another --seed"), "{more}: {called:?}");
    }
    let deeper = line.replace("L0,L3", "L0,L3,L5 --dry-run");
    let more = bench.complete(&words(&deeper));
    insta::assert_snapshot!(redacted(&more), @"
    Nothing was sent. 6 of 15 trials are left to ask.
    at no endpoint, built in: random 6
    power: 3 questions in 2 frames detects no difference between two conditions; 5 points need about 593 frames
        (one model; level 2.50 % after correction; assumed: 20 % of answers change without an effect, correlation
        0.05 in a frame)
    only 2 frames (8 are needed): intervals and tests would be rough
    ");
}
