//! The one error type of the crate.
//!
//! Each variant names the cause and the place; its message ends with the remedy. There is no `From<io::Error>`: an
//! error of the operating system is useless without its path.

use std::fmt::Display;
use std::path::{Path, PathBuf};

/// A `Result` with this crate's [`Error`].
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// A failure that the user can understand and repair.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A flag, an environment variable or a line of the configuration file that cannot be used.
    #[error("{origin}: {problem}")]
    Usage {
        /// The flag, variable or file that holds the value.
        origin: String,
        /// The mismatch, the expected content, and the remedy.
        problem: String,
    },
    /// A command line that could not be parsed, in the words of the parser.
    #[error("{0}")]
    CommandLine(String),
    /// A file or folder that could not be read or written.
    #[error("{}: cannot {action}: {source}", path.display())]
    File {
        /// The file or folder.
        path: PathBuf,
        /// The action that failed: "read", "write", "create".
        action: &'static str,
        /// The error of the operating system.
        source: std::io::Error,
    },
    /// A data file of the user with unexpected content.
    #[error("{place}: {problem}")]
    Data {
        /// The file, with the line or frame if known.
        place: String,
        /// The mismatch, the expected content, and the remedy.
        problem: String,
    },
    /// An enhancement model that cannot be used.
    #[error("{}: {problem}", path.display())]
    Enhancer {
        /// The path of the ONNX file.
        path: PathBuf,
        /// The fault and the remedy.
        problem: String,
    },
    /// An enhancement model that cannot be used any further, so that the run ends.
    #[error("{}: {problem}", path.display())]
    EnhancerEnded {
        /// The path of the ONNX file.
        path: PathBuf,
        /// The failure, and how to continue.
        problem: String,
    },
    /// The library of ONNX Runtime was not found, is not suitable or could not be installed.
    #[error("ONNX Runtime: {0}")]
    Runtime(String),
    /// A prompt template that is missing, broken or does not fit its question.
    #[error("prompt {name}: {problem}")]
    Prompt {
        /// The template's name or path.
        name: String,
        /// Description of the fault.
        problem: String,
    },
    /// An endpoint that cannot be used: every further request would fail in the same way.
    #[error("{endpoint}: {problem}")]
    Endpoint {
        /// The base URL without credentials.
        endpoint: String,
        /// The endpoint's answer, and the remedy.
        problem: String,
    },
    /// A run folder that does not match the command.
    #[error("{}: {problem}", path.display())]
    Run {
        /// The run folder or its file.
        path: PathBuf,
        /// The fault and the remedy.
        problem: String,
    },
}

/// Maximum length of a line in a message about data, in characters; chosen. A longer line loses its middle.
const MAX_LINE_CHARS: usize = 600;

/// Characters kept at the start of a line that is too long.
const KEPT_START: usize = 300;

/// Characters kept at the end of a line that is too long, where the remedy is.
const KEPT_END: usize = 200;

/// Shortens each line that is too long for a message: names and values in data may have any length.
fn shorten_lines(text: &str) -> String {
    text.split('\n')
        .map(|line| {
            let length = line.chars().count();
            if length <= MAX_LINE_CHARS {
                return line.to_owned();
            }
            let start: String = line.chars().take(KEPT_START).collect();
            let end: String = line.chars().skip(length - KEPT_END).collect();
            format!("{start} … {end}")
        })
        .collect::<Vec<String>>()
        .join("\n")
}

impl Error {
    /// An error about a flag, variable or configuration line.
    pub fn usage(origin: impl Into<String>, problem: impl Display) -> Self {
        Self::Usage { origin: origin.into(), problem: problem.to_string() }
    }

    /// An error of the operating system about a path.
    pub fn file(path: impl Into<PathBuf>, action: &'static str, source: std::io::Error) -> Self {
        Self::File { path: path.into(), action, source }
    }

    /// An error in a data file; `place` is its path, with the line or frame if known.
    pub fn data(place: impl Display, problem: impl Display) -> Self {
        Self::Data { place: shorten_lines(&place.to_string()), problem: shorten_lines(&problem.to_string()) }
    }

    /// Returns the error with another origin: the parser of a value does not know which flag or file the value came
    /// from.
    #[must_use]
    pub fn at(self, origin: impl Into<String>) -> Self {
        match self {
            Self::Usage { problem, .. } => Self::Usage { origin: origin.into(), problem },
            Self::Data { problem, .. } => Self::Data { place: origin.into(), problem },
            other => other,
        }
    }

    /// Returns a usage error with another origin, and any other error unchanged.
    #[must_use]
    pub fn usage_at(self, origin: &str) -> Self {
        match self {
            Self::Usage { .. } => self.at(origin),
            other => other,
        }
    }

    /// A JSON error in one line (counted from 1) of a data file, without serde's position within the line.
    #[must_use]
    pub fn json_line(path: &Path, line: usize, error: &serde_json::Error) -> Self {
        let text = error.to_string();
        let problem = text.rsplit_once(" at line ").map_or(&*text, |(problem, _)| problem);
        Self::line(path, line, problem)
    }

    /// An error at one line (counted from 1) of a data file.
    pub fn line(path: &Path, line: usize, problem: impl Display) -> Self {
        Self::data(format_args!("{}, line {line}", path.display()), problem)
    }
}
