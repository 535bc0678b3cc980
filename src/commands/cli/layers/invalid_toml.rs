//! The error about a file of flags that is not TOML: [`invalid_toml`].

use std::path::Path;

use crate::error::Error;
use crate::types::text::TomlFault;

/// The error about invalid TOML, on one line and with its line number.
pub(super) fn invalid_toml(path: &Path, text: &str, error: &toml::de::Error) -> Error {
    let TomlFault { line, problem } = TomlFault::new(text, error);
    Error::line(path, line, format_args!("not valid TOML: {problem}"))
}
