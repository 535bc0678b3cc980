//! Interrupts by the user.
#![cfg(unix)]

use std::fs;
use std::process::Stdio;
use std::thread;
use std::time::Duration;

use crate::support::endpoint::{Answer, MockEndpoint};
use crate::support::process::{signal, wait_until};
use crate::support::run::{Bench, model_args, records};

#[test]
fn an_interrupt_keeps_what_was_answered() {
    let bench = Bench::with_frames();
    let endpoint = MockEndpoint::start([Answer::text("A"), Answer::silent()]);
    let url = endpoint.base_url();
    let args = model_args(&url, "--data frames --levels L0 --concurrency 1 --out run");
    let mut program = bench.spawn(&args, Stdio::null());
    wait_until(|| endpoint.requests().len() >= 2);
    // The first asks to stop; the request that is never answered is given up by the second alone.
    signal(&program, "-INT");
    thread::sleep(Duration::from_millis(300));
    assert!(
        program.try_wait().unwrap().is_none(),
        "what is on the wire is waited for"
    );
    signal(&program, "-INT");
    assert_eq!(program.wait().unwrap().code(), Some(130));
    assert_eq!(records(&bench.path("run")).len(), 1);
    let manifest = fs::read_to_string(bench.path("run/manifest.json")).unwrap();
    assert!(manifest.contains("\"cancelled\""), "{manifest}");
}

#[test]
fn an_interrupt_does_not_wait_for_retries() {
    let bench = Bench::with_frames();
    let later = Answer::error(429, "slow_down", "later").header("retry-after", "100");
    let endpoint = MockEndpoint::start([Answer::text("A"), later]);
    let url = endpoint.base_url();
    let args = model_args(&url, "--data frames --levels L0 --concurrency 1 --out run");
    let program = bench.spawn(&args, Stdio::piped());
    wait_until(|| endpoint.requests().len() >= 2);
    thread::sleep(Duration::from_millis(100));
    signal(&program, "-INT");
    // Would take 100 s otherwise, and the run of the tests with it.
    let output = program.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(130));
    let table = String::from_utf8(output.stdout).unwrap();
    assert!(
        table.contains("cancelled: 1 of 3 trials answered, 0 failed"),
        "{table}"
    );
    assert_eq!(
        records(&bench.path("run")).len(),
        1,
        "what was given up has not failed"
    );
}
