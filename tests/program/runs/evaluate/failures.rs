//! Broken images, models, endpoints and enhancers: found early, and never taken for answers.

use std::fs;

use serde_json::Value;

use super::text;
use crate::support::endpoint::{Answer, MockEndpoint};
use crate::support::frames::png;
use crate::support::onnx;
use crate::support::process::wait_until;
use crate::support::run::{Bench, model_args, records, words};
use crate::support::table::check_rows;

#[test]
fn broken_image_is_found_early() {
    let bench = Bench::with_frames();
    let whole = png(20);
    let endpoint = MockEndpoint::start([Answer::text("A")]);
    let url = endpoint.base_url();
    let mut corrupt = whole.clone();
    let middle = corrupt.len() / 2;
    corrupt[middle] ^= 0x40;
    let rows = [(&whole[..whole.len() - 40], "ends before"), (&corrupt, "checksum")];
    check_rows(rows, |(broken, message)| {
        bench.file("frames/a.png", broken);
        let run = bench.call(&model_args(&url, "--data frames --levels L0 --out run"));
        assert_eq!(run.code, Some(2), "{run:?}");
        assert!(run.stderr.contains("a.png: not a whole image") && run.stderr.contains(message), "{run:?}");
    });
    assert_eq!(endpoint.requests().len(), 0);
}

#[test]
fn unwritable_folder_is_found_early() {
    let bench = Bench::new();
    bench.file("file", "");
    let rows = [
        ("--out file", "--out: cannot write to"),
        ("--out file/run", "--out: cannot write to"),
        ("--out file/run --dry-run", "--out: cannot write to"),
        ("--resume gone", "--resume: gone: no such folder"),
    ];
    check_rows(rows, |(place, message)| {
        let line = format!("--model random --data nowhere --levels L0 {place}");
        let run = bench.call(&words(&line));
        assert_eq!(run.code, Some(2), "{run:?}");
        assert!(run.stderr.contains(message), "{run:?}");
    });
    let files = fs::read_dir(bench.path("")).unwrap().count();
    assert_eq!(files, 1, "nothing is left behind");
}

#[test]
fn unknown_model_stops_alone() {
    let bench = Bench::with_frames();
    let endpoint = MockEndpoint::start([Answer::error(404, "model_not_found", "no such model")]);
    let url = endpoint.base_url();
    let run = bench
        .call(&words(&format!("--data frames --model random --model gone --base-url {url} --levels L0-L2 --out run")));
    insta::assert_snapshot!(run.lines_with("gone"), @"
    exit code: 1
    ! not asked any further: http://127.0.0.1:[PORT]/v1: gone: http://127.0.0.1:[PORT]/v1 answered 404: no such
        model (the server knows no model of this name: check --model and --base-url) (replies so far are stored;
        the same command continues)
    ");
    let csv = fs::read_to_string(bench.path("run/summary.csv")).unwrap();
    assert!(csv.contains("random,image,L2,noise,,all,strict,3,") && !csv.contains("gone"), "{csv}");
}

#[test]
fn missing_endpoint_is_noticed_soon() {
    let bench = Bench::with_frames();
    let free = std::net::TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
    let url = format!("http://{free}/v1");
    let run = bench.call(&model_args(&url, "--data frames --retries 0 --concurrency 1 --out run"));
    insta::assert_snapshot!(run.messages(), @"
    exit code: 2
    error: http://127.0.0.1:[PORT]/v1: m: 5 trials in a row failed: error sending request: client error (Connect):
        tcp connect error: [OS ERROR] (replies so far are stored; the same command continues)
    ");
    assert_eq!(records(&bench.path("run")).len(), 5);
}

#[test]
fn first_failure_is_described() {
    let bench = Bench::with_frames();
    let page = Answer::new(200, "<html><title>Sign in</title></html>".to_owned());
    let endpoint = MockEndpoint::start([page, Answer::text("A")]);
    let run = bench
        .call(&model_args(&endpoint.base_url(), "--data frames --retries 0 --concurrency 1 --levels L0 --out run"));
    insta::assert_snapshot!(run.messages(), @r#"
    exit code: 1
     WARN m: a trial about a.png failed: http://127.0.0.1:[PORT]/v1 answered with an HTML page titled "Sign in"
    "#);
}

#[test]
fn changed_image_is_not_mixed() {
    let bench = Bench::with_frames();
    let later = Answer::error(429, "slow_down", "later").header("retry-after", "1");
    let endpoint = MockEndpoint::start([later, Answer::text("A")]);
    let url = endpoint.base_url();
    let changed = bench.path("frames/b.png");
    let run = std::thread::scope(|scope| {
        scope.spawn(|| {
            wait_until(|| !endpoint.requests().is_empty());
            fs::write(&changed, png(200)).unwrap();
        });
        bench.call(&model_args(&url, "--data frames --concurrency 1 --out run"))
    });
    assert_eq!(run.code, Some(1), "{run:?}");
    let of_b: Vec<Value> =
        records(&bench.path("run")).into_iter().filter(|record| record["frame"] == "b.png").collect();
    assert_eq!(of_b.len(), 11);
    assert!(
        of_b.iter().all(|record| text(&record["failure"], "message").contains("changed during the run")),
        "{of_b:?}"
    );
}

#[test]
fn failing_enhancer_is_found_early() {
    let bench = Bench::with_frames();
    onnx::not_a_number().write(&bench.path(""), "nan.onnx");
    let endpoint = MockEndpoint::start([Answer::text("A")]);
    let url = endpoint.base_url();
    let run = bench.call(&model_args(&url, "--data frames --llie nan.onnx --out run"));
    insta::assert_snapshot!(run.messages(), @"
    exit code: 2
    error: nan.onnx: on 6 of 6 dark frames its images have values that are not numbers (100 % of the values).
        Check its weights and its divisions by zero. `darkqa-eval enhance doctor nan.onnx IMAGES… --out DIR` tries
        each value range and colour order; --allow bad-enhancer uses it anyway
    ");
    assert_eq!(endpoint.requests().len(), 0);
}
