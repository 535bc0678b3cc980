//! Few files that a process may have open (`ulimit -n`): no reply is lost, and no trial fails for that.
#![cfg(unix)]

use std::process::Command;
use std::thread;
use std::time::Duration;

use crate::support::endpoint::{Answer, MockEndpoint};
use crate::support::run::{Bench, Called, PROGRAM, called, model_args, records};
use crate::support::table::check_rows;

const TRIALS: usize = 160;

/// The run in a folder after a shell command; its records.
fn run(limit: &str, line: &str) -> (Called, Bench, MockEndpoint) {
    let bench = Bench::with_questions(TRIALS);
    let endpoint = MockEndpoint::answering(|_| {
        thread::sleep(Duration::from_millis(100));
        Answer::text("C")
    });
    let url = endpoint.base_url();
    let line = format!("--data set.jsonl --levels L0 --out run {line}");
    let words = model_args(&url, &line).join(" ");
    let mut command = Command::new("sh");
    command.args(["-c", &format!("{limit} exec {PROGRAM} {words}")]).current_dir(bench.path(""));
    (called(&mut command), bench, endpoint)
}

/// Asserts that every trial was asked once, and has a reply.
fn assert_complete((output, bench, endpoint): &(Called, Bench, MockEndpoint)) {
    assert_eq!(output.code, Some(0), "{output:?}");
    let stored = records(&bench.path("run"));
    assert_eq!((stored.len(), endpoint.requests().len()), (TRIALS, TRIALS));
    assert!(stored.iter().all(|record| record["failure"].is_null()));
}

#[test]
fn few_open_files_limit_requests() {
    let rows = [(24, 32), (64, 32), (64, 256), (128, 128), (128, 256)];
    check_rows(rows, |(files, concurrency)| {
        let limit = format!("ulimit -n {files};");
        let ran = run(&limit, &format!("--concurrency {concurrency}"));
        assert_complete(&ran);
        let said = &ran.0.stderr;
        let expected = format!("instead of {concurrency} (--concurrency)");
        assert!(said.contains(&expected), "{said}");
        assert!(said.contains(&format!("only {files} files")), "{said}");
    });
}

#[test]
fn several_endpoints_share_the_open_files() {
    let other = MockEndpoint::start([Answer::text("C")]);
    let line = format!("--base-url {} --concurrency 256", other.base_url());
    let ran = run("ulimit -n 64;", &line);
    assert_eq!(ran.0.code, Some(0), "{:?}", ran.0);
    // The replicas are compared by what they say of the model.
    let asked = |endpoint: &MockEndpoint| {
        endpoint.requests().into_iter().filter(|request| request.line.starts_with("POST ")).count()
    };
    let sent = asked(&ran.2) + asked(&other);
    assert_eq!((records(&ran.1.path("run")).len(), sent), (TRIALS, TRIALS));
}

#[test]
fn soft_file_limit_is_raised() {
    let ran = run("ulimit -Sn 64;", "--concurrency 64");
    assert_complete(&ran);
    assert!(!ran.0.stderr.contains("instead of"), "{:?}", ran.0);
}
