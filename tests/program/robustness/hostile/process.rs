//! A process that a campaign waits for, with the memory that it took at most.

use std::fs::{self, File};
use std::os::unix::process::ExitStatusExt as _;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use crate::support::rooms::rooms;
use crate::support::run::PROGRAM;

/// The most bytes of a stream that are looked at.
const MOST_BYTES: usize = 16 << 20;

/// The time that counts between two looks at a process at most. A longer one means that the machine stood still, and
/// the process with it.
const LONGEST_LOOK: Duration = Duration::from_secs(1);

/// The program in a folder, with the few variables that it needs.
pub(crate) fn program(work: &Path) -> Command {
    let mut command = Command::new(PROGRAM);
    command.current_dir(work).env_clear();
    let kept = ["PATH", "HOME", "XDG_CACHE_HOME", "ORT_DYLIB_PATH", "LD_LIBRARY_PATH"];
    for name in kept {
        if let Some(value) = std::env::var_os(name) {
            command.env(name, value);
        }
    }
    command.env("DARKQA_DATA", rooms(2, "32x32"));
    command
}

/// Output of a process.
#[derive(Debug)]
pub(crate) struct Finished {
    pub(crate) code: Option<i32>,
    pub(crate) signal: Option<i32>,
    pub(crate) took: Duration,
    /// Whether it had to be killed.
    pub(crate) is_late: bool,
    /// Peak resident memory in bytes; 0 where there is no `/proc`.
    pub(crate) memory: u64,
    pub(crate) stdout: Vec<u8>,
    pub(crate) stderr: Vec<u8>,
}

/// A process whose streams go into two files of a folder.
pub(crate) struct Running<'a> {
    child: Child,
    folder: &'a Path,
}

impl<'a> Running<'a> {
    pub(crate) fn start(command: &mut Command, folder: &'a Path) -> Self {
        let stream = |name: &str| File::create(folder.join(name)).unwrap();
        command.stdin(Stdio::null());
        command.stdout(stream("stdout")).stderr(stream("stderr"));
        Self { child: command.spawn().unwrap(), folder }
    }

    /// Output so far.
    pub(crate) fn stdout(&self) -> String {
        let bytes = fs::read(self.folder.join("stdout")).unwrap_or_default();
        String::from_utf8_lossy(&bytes).into_owned()
    }

    /// Whether it wrote to standard error.
    pub(crate) fn has_complained(&self) -> bool {
        let file = fs::metadata(self.folder.join("stderr"));
        file.is_ok_and(|file| file.len() > 0)
    }

    /// Waits for its end; after the `limit` it is killed. After `patience` it is asked to end by a signal, if that is
    /// given.
    pub(crate) fn end(mut self, limit: Duration, patience: Option<Duration>) -> Finished {
        let (mut is_late, mut is_asked) = (false, patience.is_none());
        let (mut took, mut look) = (Duration::ZERO, Instant::now());
        let mut memory = 0;
        let status = loop {
            took += look.elapsed().min(LONGEST_LOOK);
            look = Instant::now();
            memory = peak_memory(self.child.id()).max(memory);
            if let Some(status) = self.child.try_wait().unwrap() {
                break status;
            }
            if !is_asked && Some(took) > patience {
                is_asked = true;
                crate::support::process::signal(&self.child, "-TERM");
            }
            if !is_late && took > limit {
                is_late = true;
                crate::support::process::signal(&self.child, "-9");
            }
            thread::sleep(Duration::from_millis(if took.as_millis() < 500 { 1 } else { 10 }));
        };
        let stream = |name: &str| {
            let mut bytes = fs::read(self.folder.join(name)).unwrap_or_default();
            bytes.truncate(MOST_BYTES);
            bytes
        };
        Finished {
            code: status.code(),
            signal: status.signal(),
            took,
            is_late,
            memory,
            stdout: stream("stdout"),
            stderr: stream("stderr"),
        }
    }
}

/// Peak resident memory of a running process in bytes. The resource usage that `wait4` gives for a process begins with
/// the memory of this test program, which started it.
fn peak_memory(id: u32) -> u64 {
    let status = fs::read_to_string(format!("/proc/{id}/status")).unwrap_or_default();
    let peak = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    let kilobytes = peak.and_then(|peak| peak.trim().strip_suffix("kB")?.trim().parse::<u64>().ok());
    kilobytes.unwrap_or_default() * 1024
}
