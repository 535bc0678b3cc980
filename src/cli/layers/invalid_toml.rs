//! The error about a file of flags that is not TOML: [`invalid_toml`].

use std::path::Path;

use crate::error::Error;

/// The error about invalid TOML, on one line and with its line number.
pub(super) fn invalid_toml(path: &Path, text: &str, error: &toml::de::Error) -> Error {
    let before = error.span().and_then(|span| text.get(..span.start));
    let line = before.unwrap_or_default().matches('\n').count() + 1;
    let problem: Vec<&str> = error.message().lines().map(str::trim).collect();
    Error::line(
        path,
        line,
        format_args!("not valid TOML: {}", problem.join(", ")),
    )
}
