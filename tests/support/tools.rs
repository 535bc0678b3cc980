//! Tools that a machine may lack. A test without its tool is skipped, and says so.

use std::io::Write as _;
use std::process::Command;

/// Prints the name of the running test and why it is skipped. The capture of test output does not hide it.
pub fn skip(reason: &str) {
    let thread = std::thread::current();
    let test = thread.name().unwrap_or("a test");
    let _ = writeln!(std::io::stderr(), "skipped: {test}: {reason}");
}

/// True if a command line succeeds.
pub fn succeeds(program: &str, arguments: &[&str]) -> bool {
    let output = Command::new(program).args(arguments).output();
    output.is_ok_and(|output| output.status.success())
}

/// True if ffmpeg is on `PATH`; otherwise the test is skipped.
pub fn has_ffmpeg() -> bool {
    let is_there = succeeds("ffmpeg", &["-version"]);
    if !is_there {
        skip("there is no ffmpeg");
    }
    is_there
}
