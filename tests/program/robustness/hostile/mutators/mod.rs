//! Damage to files: one step at a time, each from its own number, so that a case can be made again from some of its
//! steps.

mod bytes;
mod footer;
mod json;
mod png;
mod protobuf;
mod words;

use std::path::Path;

use crate::robustness::hostile::random::Random;

/// Kind of a file's content.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Form {
    /// Values of JSON, one a line or one in all.
    Json,
    Png,
    /// A model of ONNX, which is a message of Protocol Buffers.
    Onnx,
    Parquet,
    /// Lines of words: TOML, CSV, TSV, prompts, heads of HTTP.
    Text,
    /// Bytes of which no more is known: JPEG, TIFF, arrays, entries of an image store.
    Bytes,
}

impl Form {
    pub(crate) fn of(path: &Path) -> Self {
        let ending = path.extension().unwrap_or_default();
        match ending.to_string_lossy().as_ref() {
            "json" | "jsonl" => Self::Json,
            "png" => Self::Png,
            "onnx" => Self::Onnx,
            "parquet" => Self::Parquet,
            "toml" | "csv" | "tsv" | "txt" | "http" | "house" => Self::Text,
            _ => Self::Bytes,
        }
    }
}

/// Damages a file in one place, or in one of its structures.
pub(crate) fn step(form: Form, file: &mut Vec<u8>, seed: u64) {
    let mut random = Random::new(seed);
    let by_structure = random.percent(60);
    let done = by_structure
        && match form {
            Form::Json => json::mutate(file, &mut random),
            Form::Png => png::mutate(file, &mut random),
            Form::Onnx => protobuf::mutate(file, &mut random),
            Form::Parquet => footer::mutate(file, &mut random),
            Form::Text => bytes::change_number(file, &mut random),
            Form::Bytes => false,
        };
    if !done {
        bytes::mutate(file, &mut random);
    }
}

#[cfg(test)]
mod tests;
