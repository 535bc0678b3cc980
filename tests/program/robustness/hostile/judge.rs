//! What a process of the program may do whatever it reads, and what is a fault.

use std::fmt;
use std::time::Duration;

use crate::robustness::hostile::process::Finished;

/// Limits of a process.
#[derive(Clone, Copy)]
pub(crate) struct Limits {
    pub(crate) time: Duration,
    pub(crate) memory: u64,
}

impl Limits {
    pub(crate) const PROGRAM: Self = Self { time: Duration::from_secs(20), memory: 1 << 30 };
}

/// Fault of a process.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Fault {
    Panic,
    Signal(i32),
    /// An exit code that the documentation does not have.
    Code(i32),
    Hang,
    /// Bytes of memory.
    Memory(u64),
    /// A raw control character in a stream.
    Control(char),
    /// Results although an error stopped everything.
    Output,
    /// A file outside the working folder was touched, or its content sent or shown.
    Canary(String),
}

impl Fault {
    /// Name of the fault in a summary; a reduced case keeps it.
    pub(crate) fn kind(&self) -> &'static str {
        match self {
            Self::Panic => "panic",
            Self::Signal(_) => "signal",
            Self::Code(_) => "exit code",
            Self::Hang => "hang",
            Self::Memory(_) => "memory",
            Self::Control(_) => "control character",
            Self::Output => "output with code 2",
            Self::Canary(_) => "canary",
        }
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Signal(number) => write!(f, "signal {number}"),
            Self::Code(code) => write!(f, "exit code {code}"),
            Self::Memory(bytes) => write!(f, "memory: {} MB", bytes >> 20),
            Self::Control(c) => write!(f, "control character U+{:04X}", u32::from(*c)),
            Self::Canary(what) => write!(f, "canary: {what}"),
            Self::Panic | Self::Hang | Self::Output => f.write_str(self.kind()),
        }
    }
}

/// The faults of a process that may end with these codes.
pub(crate) fn faults(finished: &Finished, codes: &[i32], limits: Limits) -> Vec<Fault> {
    let mut faults = Vec::new();
    let text = |stream: &[u8]| String::from_utf8_lossy(stream).into_owned();
    let (stdout, stderr) = (text(&finished.stdout), text(&finished.stderr));
    if stderr.contains("panicked at") {
        faults.push(Fault::Panic);
    }
    if finished.is_late || finished.took > limits.time {
        faults.push(Fault::Hang);
    } else if let Some(signal) = finished.signal {
        faults.push(Fault::Signal(signal));
    }
    if let Some(code) = finished.code.filter(|code| !codes.contains(code)) {
        faults.push(Fault::Code(code));
    }
    if finished.memory > limits.memory {
        faults.push(Fault::Memory(finished.memory));
    }
    let is_raw = |c: &char| c.is_control() && !['\n', '\t'].contains(c);
    let found = stdout.chars().chain(stderr.chars()).find(is_raw);
    faults.extend(found.map(Fault::Control));
    if finished.code == Some(2) && !stdout.is_empty() {
        faults.push(Fault::Output);
    }
    faults
}

/// Whether an error names the file that was damaged, by the last part of its path.
pub(crate) fn names(finished: &Finished, file: &str) -> bool {
    let name = file.rsplit('/').next().unwrap_or(file);
    String::from_utf8_lossy(&finished.stderr).contains(name)
}

#[cfg(test)]
mod tests;
