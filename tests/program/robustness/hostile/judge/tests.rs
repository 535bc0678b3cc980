//! The judge finds what it is there for: each fault, committed by a line of the shell.

use std::fs;
use std::process::Command;
use std::time::Duration;

use super::{Fault, Limits, faults};
use crate::robustness::hostile::canary::Canary;
use crate::robustness::hostile::process::Running;
use crate::support::table::check_rows;

const LIMITS: Limits = Limits { time: Duration::from_secs(2), memory: 300 << 20 };

/// The kinds of the faults of a line of the shell, and whether the canary folder changed.
fn judged(line: &str) -> (Vec<&'static str>, bool) {
    let folder = tempfile::tempdir().unwrap();
    let canary = Canary::make(folder.path());
    let work = folder.path().join("work");
    fs::create_dir(&work).unwrap();
    let mut command = Command::new("sh");
    command.args(["-c", line]).current_dir(&work);
    let finished = Running::start(&mut command, folder.path()).end(LIMITS.time, None);
    let faults = faults(&finished, &[0, 1, 2, 130], LIMITS);
    let kinds = faults.iter().map(Fault::kind).collect();
    (kinds, canary.change().is_some())
}

#[test]
fn each_fault_is_found() {
    let rows: [(&str, &[&str]); 12] = [
        ("true", &[]),
        ("printf 'a\\tb\\n'; exit 1", &[]),
        ("echo 'a.json, line 3: no' >&2; exit 2", &[]),
        ("echo \"thread 'main' panicked at src/main.rs:1:1:\" >&2; exit 101", &["panic", "exit code"]),
        ("exit 3", &["exit code"]),
        ("kill -SEGV $$", &["signal"]),
        ("exec sleep 60", &["hang"]),
        ("printf '\\033[31m'", &["control character"]),
        ("printf '\\177' >&2", &["control character"]),
        ("printf 'a\\302\\2332J'", &["control character"]),
        ("echo result; exit 2", &["output with code 2"]),
        ("exec dd if=/dev/zero of=/dev/null bs=400M count=1 2>&1", &["memory"]),
    ];
    check_rows(rows, |(line, expected)| {
        assert_eq!(judged(line), (expected.to_vec(), false), "{line}");
    });
}

#[test]
fn each_touch_of_canary_is_found() {
    let rows = [
        "echo x >> ../canary/private.txt",
        "touch ../canary/picture.png",
        "echo x > ../canary/inner/new",
        "rm ../canary/inner/records.jsonl",
        "truncate -s 11 ../canary/private.txt",
    ];
    check_rows(rows, |line| {
        assert_eq!(judged(line), (Vec::new(), true), "{line}");
    });
}
