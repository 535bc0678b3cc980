//! The one error type of the crate.
//!
//! A variant says whose fault it is and where; its message ends with what mends it. There is no `From<io::Error>`:
//! an error of the operating system without its path helps nobody.

use std::fmt::Display;
use std::path::{Path, PathBuf};

/// A `Result` with this crate's [`Error`].
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// What went wrong, by whose fault it is.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A flag, an environment variable or a line of the configuration file that cannot be used.
    #[error("{origin}: {problem}")]
    Usage {
        /// The flag, variable or file that said it.
        origin: String,
        /// What was expected, and how to mend it.
        problem: String,
    },
    /// Words that no command takes, as the parser of the command line says it.
    #[error("{0}")]
    CommandLine(String),
    /// A file or folder that could not be read or written.
    #[error("{}: cannot {action}: {source}", path.display())]
    File {
        /// Where.
        path: PathBuf,
        /// What was tried: "read", "write", "create".
        action: &'static str,
        /// What the operating system said.
        source: std::io::Error,
    },
    /// A file of the user's data whose content is not what it should be.
    #[error("{place}: {problem}")]
    Data {
        /// The file, with its line or frame where there is one.
        place: String,
        /// What was expected, and how to mend it.
        problem: String,
    },
    /// An enhancement model that cannot be used.
    #[error("{}: {problem}", path.display())]
    Enhancer {
        /// The ONNX file.
        path: PathBuf,
        /// What is wrong with it, and how to mend it.
        problem: String,
    },
    /// ONNX Runtime's library was not found, not fit or could not be installed.
    #[error("ONNX Runtime: {0}")]
    Runtime(String),
    /// A prompt template that is missing, broken or does not fit its question.
    #[error("prompt {name}: {problem}")]
    Prompt {
        /// The template's name or path.
        name: String,
        /// What is wrong with it.
        problem: String,
    },
    /// An endpoint that cannot be used at all: every further request would fail alike.
    #[error("{endpoint}: {problem}")]
    Endpoint {
        /// The base URL without credentials.
        endpoint: String,
        /// What it answered, and how to mend it.
        problem: String,
    },
    /// A run folder that does not fit what was asked.
    #[error("{}: {problem}", path.display())]
    Run {
        /// The run folder or its file.
        path: PathBuf,
        /// What is wrong, and how to mend it.
        problem: String,
    },
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

    /// An error in a data file; `place` is its path, with a line or frame where there is one.
    pub fn data(place: impl Display, problem: impl Display) -> Self {
        Self::Data {
            place: place.to_string(),
            problem: problem.to_string(),
        }
    }

    /// The same error, said of another flag or place: what a type's own parser reports gets the flag it came by.
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

    /// An error of JSON in one line (counted from 1) of a data file, without the place that serde counts within the line.
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
