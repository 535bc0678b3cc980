//! Interrupts by the user.
#![cfg(unix)]

use std::fs;

use crate::frames;
use crate::support::endpoint::{Answer, MockEndpoint};
use crate::support::run::{Bench, records};

#[cfg(unix)]
#[test]
fn an_interrupt_keeps_what_was_answered() {
    use std::process::{Command, Stdio};
    use std::time::Duration;

    let bench = Bench::new();
    frames(&bench);
    let endpoint = MockEndpoint::start([Answer::text("A"), Answer::silent()]);
    let url = endpoint.base_url();
    let mut program = Command::new(assert_cmd::cargo::cargo_bin("darkqa-eval"))
        .args([
            "--data",
            "frames",
            "--model",
            "m",
            "--base-url",
            &url,
            "--levels",
            "L0",
            "--concurrency",
            "1",
            "--out",
            "run",
        ])
        .current_dir(bench.path(""))
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    while endpoint.requests().len() < 2 {
        std::thread::sleep(Duration::from_millis(5));
    }
    // The first asks to stop; the request that is never answered is given up by the second alone.
    interrupt(&program);
    std::thread::sleep(Duration::from_millis(300));
    assert!(
        program.try_wait().unwrap().is_none(),
        "what is on the wire is waited for"
    );
    interrupt(&program);
    assert_eq!(program.wait().unwrap().code(), Some(130));
    assert_eq!(records(&bench.path("run")).len(), 1);
    let manifest = fs::read_to_string(bench.path("run/manifest.json")).unwrap();
    assert!(manifest.contains("\"cancelled\""), "{manifest}");
}

#[cfg(unix)]
fn interrupt(program: &std::process::Child) {
    let signal = ["-INT", &program.id().to_string()];
    std::process::Command::new("kill")
        .args(signal)
        .status()
        .unwrap();
}

#[cfg(unix)]
#[test]
fn an_interrupt_does_not_wait_for_retries() {
    use std::process::{Command, Stdio};
    use std::time::Duration;

    let bench = Bench::new();
    frames(&bench);
    let later = Answer::error(429, "slow_down", "later").header("retry-after", "100");
    let endpoint = MockEndpoint::start([Answer::text("A"), later]);
    let url = endpoint.base_url();
    let program = Command::new(assert_cmd::cargo::cargo_bin("darkqa-eval"))
        .args([
            "--data",
            "frames",
            "--model",
            "m",
            "--base-url",
            &url,
            "--levels",
            "L0",
            "--concurrency",
            "1",
            "--out",
            "run",
        ])
        .current_dir(bench.path(""))
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    while endpoint.requests().len() < 2 {
        std::thread::sleep(Duration::from_millis(5));
    }
    std::thread::sleep(Duration::from_millis(100));
    interrupt(&program);
    // Would take 100 s otherwise, and the run of the tests with it.
    let output = program.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(130));
    let table = String::from_utf8(output.stdout).unwrap();
    assert!(
        table.starts_with("cancelled: 1 of 3 trials answered, 0 failed"),
        "{table}"
    );
    assert_eq!(
        records(&bench.path("run")).len(),
        1,
        "what was given up has not failed"
    );
}
