//! The program as a process that a test waits for, interrupts or kills.

use std::process::{Child, Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use super::run::{Bench, PROGRAM};

impl Bench {
    /// Starts the program in this folder; standard error is not shown.
    pub fn spawn(&self, args: &[&str], stdout: Stdio) -> Child {
        Command::new(PROGRAM)
            .args(args)
            .current_dir(self.path(""))
            .stdout(stdout)
            .stderr(Stdio::null())
            .spawn()
            .unwrap()
    }
}

/// Sends a signal to a process: `-INT`, `-TERM` or `-9`.
pub fn signal(process: &Child, signal: &str) {
    // Every shell has the command; the program of this name is a package of its own.
    let line = format!("kill {signal} {}", process.id());
    let status = Command::new("sh").args(["-c", &line]).status();
    assert!(status.unwrap().success());
}

/// Waits until a condition holds, one minute at most.
pub fn wait_until(condition: impl Fn() -> bool) {
    let start = Instant::now();
    while !condition() {
        assert!(start.elapsed() < Duration::from_mins(1), "nothing came");
        thread::sleep(Duration::from_millis(5));
    }
}
