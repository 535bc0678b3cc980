//! Interrupts by the user.
#![cfg(unix)]

use std::fs;
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use crate::support::endpoint::{Answer, MockEndpoint};
use crate::support::process::{signal, wait_until};
use crate::support::run::{Bench, PROGRAM, model_args, records};
use crate::support::snapshot::redacted;

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
    assert!(program.try_wait().unwrap().is_none(), "what is on the wire is waited for");
    signal(&program, "-INT");
    assert_eq!(program.wait().unwrap().code(), Some(130));
    assert_eq!(records(&bench.path("run")).len(), 1);
    let manifest = fs::read_to_string(bench.path("run/manifest.json")).unwrap();
    assert!(manifest.contains("\"cancelled\""), "{manifest}");
}

/// A batch system sends one SIGTERM, and kills some time later: what came is written before that.
#[test]
fn interrupt_abandons_requests_after_grace() {
    let bench = Bench::with_frames();
    let endpoint = MockEndpoint::start([Answer::text("A"), Answer::silent()]);
    let url = endpoint.base_url();
    let args = "--data frames --levels L0 --concurrency 1 --timeout 100000 --out run --grace 1.5";
    let args = model_args(&url, args);
    let mut program = Command::new(PROGRAM)
        .args(&args)
        .current_dir(bench.path(""))
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    wait_until(|| endpoint.requests().len() >= 2);
    signal(&program, "-TERM");
    thread::sleep(Duration::from_millis(300));
    assert!(program.try_wait().unwrap().is_none(), "what is on the wire is waited for");
    // Would take 100,000 s otherwise, and the run of the tests with it.
    let output = program.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(130), "{output:?}");
    let said = String::from_utf8(output.stderr).unwrap();
    insta::assert_snapshot!(
        redacted(said.trim_start()),
        @"WARN requests given up while in flight: 1; they may be paid for, and the same command asks them again"
    );
    assert_eq!(records(&bench.path("run")).len(), 1);
    let table = String::from_utf8(output.stdout).unwrap();
    insta::assert_snapshot!(redacted(&table), @"
    m · 1 question · 1 frame · 1 reply, 0 failed · intervals by question
    ! run: cancelled: 1 of 3 trials answered, 0 failed. The same command asks the
      rest.
    ! Only 1 question (8 are needed): wide intervals, few possible verdicts.

     accuracy in %
     m            L0   95 %
     untouched   0.0   0.0 +79.3
     95 %: how far the widest interval of the row reaches down and up
     chance 44.4
    run: run
    report: run/report.html
    ");
}

#[test]
fn interrupt_does_not_wait_for_retries() {
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
    insta::assert_snapshot!(redacted(&table), @"
    m · 1 question · 1 frame · 1 reply, 0 failed · intervals by question
    ! run: cancelled: 1 of 3 trials answered, 0 failed. The same command asks the
      rest.
    ! Only 1 question (8 are needed): wide intervals, few possible verdicts.

     accuracy in %
     m            L0   95 %
     untouched   0.0   0.0 +79.3
     95 %: how far the widest interval of the row reaches down and up
     chance 44.4
    run: run
    report: run/report.html
    ");
    assert_eq!(records(&bench.path("run")).len(), 1, "what was given up has not failed");
}

/// A closed terminal asks to stop, as SIGTERM does; under `nohup` it does not.
#[test]
fn closed_terminal_interrupts_unless_ignored() {
    let bench = Bench::with_frames();
    // No reply comes before the signal.
    let is_signalled = Arc::new(AtomicBool::new(false));
    let may_answer = Arc::clone(&is_signalled);
    let endpoint = MockEndpoint::answering(move |_| {
        wait_until(|| may_answer.load(Ordering::SeqCst));
        thread::sleep(Duration::from_millis(300));
        Answer::text("A")
    });
    let url = endpoint.base_url();
    let args = model_args(&url, "--data frames --levels L0 --concurrency 1 --out run");
    let mut program = bench.spawn(&args, Stdio::null());
    wait_until(|| !endpoint.requests().is_empty());
    signal(&program, "-HUP");
    is_signalled.store(true, Ordering::SeqCst);
    assert_eq!(program.wait().unwrap().code(), Some(130));
    let kept = records(&bench.path("run")).len();
    assert!((1..3).contains(&kept), "what is on the wire is waited for: {kept}");

    let mut ignoring = Command::new("sh")
        .args(["-c", "trap '' HUP; exec \"$0\" \"$@\""])
        .arg(PROGRAM)
        .args(&args)
        .current_dir(bench.path(""))
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let before = endpoint.requests().len();
    wait_until(|| endpoint.requests().len() > before);
    signal(&ignoring, "-HUP");
    assert_eq!(ignoring.wait().unwrap().code(), Some(0));
    assert_eq!(records(&bench.path("run")).len(), 3);
}

/// Whoever read standard error has gone: warnings and errors go nowhere, and nothing panics.
#[test]
fn a_closed_standard_error_ends_nothing() {
    let bench = Bench::with_frames();
    let endpoint = MockEndpoint::start([Answer::error(500, "broken", "no"), Answer::text("A")]);
    let url = endpoint.base_url();
    let line = "--data frames --levels L0 --concurrency 1 --out run --image jpeg:95";
    for (args, code) in [(model_args(&url, line), 0), (vec!["--model", "random", "--data", "none"], 2)] {
        let status = Command::new("sh")
            .args(["-c", "\"$0\" \"$@\" 2>&-"])
            .arg(PROGRAM)
            .args(&args)
            .current_dir(bench.path(""))
            .stdout(Stdio::null())
            .status();
        assert_eq!(status.unwrap().code(), Some(code), "{args:?}");
    }
}
