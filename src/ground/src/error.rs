//! The one error type of the crate.
//!
//! Each variant names the cause and the place; its message ends with the remedy. There is no `From<io::Error>`: an error of
//! the operating system is of no use without its path.

use std::fmt::Display;
use std::path::{Path, PathBuf};

/// A `Result` with this crate's [`Error`].
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// An error, by its cause.
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

/// The most characters of a line of a message about data; a longer one loses its middle (chosen).
const LONGEST_LINE: usize = 600;

/// The characters that a line that is too long keeps at its start, and at its end, where the remedy stands.
const KEPT: (usize, usize) = (300, 200);

/// A text whose lines are no longer than a message may be, whatever names and values data hold.
fn bounded(text: &str) -> String {
    text.split('\n')
        .map(|line| {
            let length = line.chars().count();
            if length <= LONGEST_LINE {
                return line.to_owned();
            }
            let start: String = line.chars().take(KEPT.0).collect();
            let end: String = line.chars().skip(length - KEPT.1).collect();
            format!("{start} … {end}")
        })
        .collect::<Vec<String>>()
        .join("\n")
}

impl Error {
    /// An error about a flag, variable or configuration line.
    pub fn usage(origin: impl Into<String>, problem: impl Display) -> Self {
        Self::Usage {
            origin: origin.into(),
            problem: problem.to_string(),
        }
    }

    /// An error of the operating system about a path.
    pub fn file(path: impl Into<PathBuf>, action: &'static str, source: std::io::Error) -> Self {
        Self::File {
            path: path.into(),
            action,
            source,
        }
    }

    /// An error in a data file; `place` is its path, with the line or frame if known.
    pub fn data(place: impl Display, problem: impl Display) -> Self {
        Self::Data {
            place: bounded(&place.to_string()),
            problem: bounded(&problem.to_string()),
        }
    }

    /// The same error at another flag or place: the parser of a type does not know the flag of its value.
    #[must_use]
    pub fn at(self, origin: impl Into<String>) -> Self {
        match self {
            Self::Usage { problem, .. } => Self::Usage {
                origin: origin.into(),
                problem,
            },
            Self::Data { problem, .. } => Self::Data {
                place: origin.into(),
                problem,
            },
            other => other,
        }
    }

    /// An error of a flag or variable at another one; any other error stays where it is.
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
        let problem = text
            .rsplit_once(" at line ")
            .map_or(&*text, |(problem, _)| problem);
        Self::line(path, line, problem)
    }

    /// An error at one line (counted from 1) of a data file.
    pub fn line(path: &Path, line: usize, problem: impl Display) -> Self {
        Self::data(format_args!("{}, line {line}", path.display()), problem)
    }
}
