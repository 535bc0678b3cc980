//! What a user states about a model beside it, in `MODEL.onnx.toml`: [`Sidecar`].

use std::fmt;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use serde::Deserialize;

use crate::error::{Error, Result};

/// The statements of a sidecar; every key may be missing, an unknown key is an error.
#[derive(Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Sidecar {
    /// Which output is the enhanced image.
    pub(super) output: Option<OutputChoice>,
}

/// An output by its place, counted from 0, or by its name.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
#[serde(
    untagged,
    expecting = "`output` is an index from 0 or a name in quotes"
)]
pub(super) enum OutputChoice {
    /// Its place among the outputs, from 0.
    Index(usize),
    /// Its name.
    Name(String),
}

impl fmt::Display for OutputChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Index(index) => write!(f, "output = {index}"),
            Self::Name(name) => write!(f, "output = {name:?}"),
        }
    }
}

/// The path of a model's sidecar: the model's own with `.toml` after it.
pub(super) fn path_for(model: &Path) -> PathBuf {
    let mut path = model.as_os_str().to_owned();
    path.push(".toml");
    path.into()
}

/// The text of the sidecar of a model; empty where there is none.
pub(super) fn text_for(model: &Path) -> Result<String> {
    let path = path_for(model);
    match std::fs::read_to_string(&path) {
        Ok(text) => Ok(text),
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(String::new()),
        Err(error) => Err(Error::file(path, "read", error)),
    }
}

impl Sidecar {
    /// Reads the text of the sidecar of `model`.
    pub(super) fn parse(model: &Path, text: &str) -> Result<Self> {
        toml::from_str(text).map_err(|error| {
            Error::data(
                path_for(model).display(),
                format_args!(
                    "{}; the one key that is supported is `output`: the name or the index of the output that is the image",
                    error.message()
                ),
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn outputs_are_stated_by_index_or_name() {
        let model = Path::new("a/model.onnx");
        let read = |text| Sidecar::parse(model, text).unwrap().output;
        assert_eq!(read(""), None);
        assert_eq!(read("output = 1"), Some(OutputChoice::Index(1)));
        assert_eq!(
            read("output = \"enhanced\""),
            Some(OutputChoice::Name("enhanced".into()))
        );
    }

    #[test]
    fn unknown_keys_and_values_are_errors_that_name_the_file() {
        let model = Path::new("a/model.onnx");
        for (text, part) in [
            ("range_in = \"-1..1\"", "range_in"),
            ("output = -1", "index from 0"),
            ("output = [1]", "index from 0"),
            ("output", "expected"),
        ] {
            let message = Sidecar::parse(model, text).unwrap_err().to_string();
            assert!(message.starts_with("a/model.onnx.toml: "), "{message}");
            assert!(message.contains(part), "{message}");
        }
    }
}
