//! The error about a file of flags that is not TOML: [`invalid_toml`].

use std::path::Path;

use crate::error::{Error, line_of_toml};

/// The error about invalid TOML, on one line and with its line number.
pub(super) fn invalid_toml(path: &Path, text: &str, error: &toml::de::Error) -> Error {
    let problem: Vec<&str> = error.message().lines().map(str::trim).collect();
    Error::line(
        path,
        line_of_toml(text, error),
        format_args!("not valid TOML: {}", problem.join(", ")),
    )
}
