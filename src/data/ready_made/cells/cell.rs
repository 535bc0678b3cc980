//! Value in a row of a ready-made set: [`Cell`].
//!
//! Path from a cell to a value inside it: [`PathStep`].

use std::collections::BTreeSet;
use std::sync::Arc;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use serde_json::Value;

use super::text_list::parse_list;
use darkqa_base::types::Digest;
use darkqa_base::types::text::excerpt;
use darkqa_pictures::image_file::format::FileFormat;

/// Maximum length of a path or a row id, in bytes. A longer text in the base64 alphabet is a file (as in VLMEvalKit,
/// `vlmeval/dataset/image_base.py`).
pub(crate) const MAX_NAME_LENGTH: usize = 64;

/// Maximum length of a base64 text that is kept in memory, in bytes (chosen). A longer one is read from its file again
/// when needed.
const MAX_KEPT_BASE64: usize = 1024;

/// Minimum length of a line of wrapped base64 (PEM has 64 characters, MIME 76). Shorter words belong to a sentence.
const MIN_BASE64_LINE: usize = 60;

/// Value in a row, without the bytes of images. Sets have millions of cells, so a cell is no larger than a `String`.
#[derive(Debug, Clone, PartialEq)]
pub enum Cell {
    /// Null, or no such column in this row.
    Absent,
    Bool(bool),
    /// Number as written in its file.
    Number(Box<str>),
    Text(String),
    /// Bytes of a file. Only in rows that are read for their image.
    Bytes(Box<[u8]>),
    /// Digest and format of a file whose bytes were dropped. Only in rows that are read for their question.
    File(Box<DroppedFile>),
    List(Box<[Cell]>),
    Fields(Fields),
}

/// Fields of a struct with their names.
pub(crate) type Fields = Box<[(Arc<str>, Cell)]>;

/// Interner for the names of fields in the cells of a table.
#[derive(Debug, Default)]
pub(super) struct FieldNames(BTreeSet<Arc<str>>);

impl FieldNames {
    fn intern(&mut self, name: Arc<str>) -> Arc<str> {
        if let Some(known) = self.0.get(&name) {
            return Arc::clone(known);
        }
        self.0.insert(Arc::clone(&name));
        name
    }
}

/// Digest and format of a file whose bytes were dropped.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct DroppedFile {
    pub digest: Digest,
    /// Image format, from the first bytes; `None` if it is not supported.
    pub format: Option<FileFormat>,
}

impl DroppedFile {
    pub fn from_bytes(bytes: &[u8]) -> Self {
        Self { digest: Digest::from_bytes(bytes), format: FileFormat::detect(bytes).ok() }
    }
}

impl Cell {
    /// Memory of the cell, in bytes.
    pub(super) fn memory_size(&self) -> usize {
        let inner = match self {
            Self::Absent | Self::Bool(_) => 0,
            Self::Number(text) => text.len(),
            Self::Text(text) => text.len(),
            Self::Bytes(bytes) => bytes.len(),
            Self::File(_) => size_of::<DroppedFile>(),
            Self::List(cells) => cells.iter().map(Self::memory_size).sum(),
            Self::Fields(fields) => fields.iter().map(|(_, cell)| size_of::<Arc<str>>() + cell.memory_size()).sum(),
        };
        size_of::<Self>() + inner
    }

    /// Replaces the bytes of files by their digest and format.
    pub(super) fn without_files(self, names: &mut FieldNames) -> Self {
        match self {
            Self::Bytes(bytes) => Self::File(Box::new(DroppedFile::from_bytes(&bytes))),
            Self::Text(text) if text.len() > MAX_KEPT_BASE64 => match (decode_base64(&text), parse_list(&text)) {
                (Some(bytes), _) => Self::File(Box::new(DroppedFile::from_bytes(&bytes))),
                (None, Some(items)) => {
                    Self::List(items.into_iter().map(|item| Self::Text(item).without_files(names)).collect())
                }
                (None, None) => Self::Text(text),
            },
            Self::List(cells) => Self::List(cells.into_iter().map(|cell| cell.without_files(names)).collect()),
            Self::Fields(fields) => Self::Fields(
                fields.into_iter().map(|(name, cell)| (names.intern(name), cell.without_files(names))).collect(),
            ),
            other => other,
        }
    }

    /// True if the cell has no value: null, an empty text or list, or a word for a missing value (`nan`, `N/A`, `None`,
    /// `null`).
    pub fn is_absent(&self) -> bool {
        match self {
            Self::Absent => true,
            Self::Text(text) => {
                let text = text.trim().to_ascii_lowercase();
                matches!(&*text, "" | "nan" | "n/a" | "none" | "null")
            }
            Self::List(cells) => cells.is_empty(),
            Self::Fields(fields) => fields.iter().all(|(_, cell)| cell.is_absent()),
            _ => false,
        }
    }

    /// The cell as text; `None` if it is not a text, number or truth value, or is blank.
    pub fn text(&self) -> Option<String> {
        match self {
            Self::Bool(is_true) => Some(is_true.to_string()),
            Self::Number(text) => Some(without_zero_fraction(text)),
            Self::Text(text) if !text.trim().is_empty() => Some(text.clone()),
            _ => None,
        }
    }

    /// Parses a text with a JSON list or object; `None` if the cell has none.
    pub fn parsed(&self) -> Option<Self> {
        let Self::Text(text) = self else {
            return None;
        };
        if !text.trim_start().starts_with(['[', '{']) {
            return None;
        }
        serde_json::from_str::<Value>(text).ok().map(Self::from)
    }

    /// Field of a struct by its name, or item of a list by its index from 0.
    pub fn field(&self, name: &str) -> Option<&Self> {
        if let Self::List(cells) = self {
            return cells.get(name.parse::<usize>().ok()?);
        }
        let Self::Fields(fields) = self else {
            return None;
        };
        fields.iter().find(|(field, _)| **field == *name).map(|(_, cell)| cell)
    }

    /// Kind of value, for messages.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Absent => "nothing",
            Self::Bool(_) => "truth",
            Self::Number(_) => "number",
            Self::Text(_) => "text",
            Self::Bytes(_) | Self::File(_) => "file",
            Self::List(_) => "list",
            Self::Fields(_) => "struct",
        }
    }

    /// Excerpt of the value with at most about `max` characters, for messages.
    pub fn excerpt(&self, max: usize) -> String {
        let whole = match self {
            Self::Absent => String::new(),
            Self::Bool(_) | Self::Number(_) => self.text().unwrap_or_default(),
            Self::Text(text) => format!("{text:?}"),
            Self::Bytes(bytes) => format!("{} bytes", bytes.len()),
            Self::File(_) => "bytes".to_owned(),
            Self::List(cells) => {
                let cells: Vec<String> = cells.iter().map(|cell| cell.excerpt(max)).collect();
                format!("[{}]", cells.join(", "))
            }
            Self::Fields(fields) => {
                let fields: Vec<String> =
                    fields.iter().map(|(name, cell)| format!("{name}: {}", cell.excerpt(max))).collect();
                format!("{{{}}}", fields.join(", "))
            }
        };
        excerpt(&whole, max)
    }
}

impl From<&Cell> for Value {
    /// Converts the cell to JSON; bytes become null.
    fn from(cell: &Cell) -> Self {
        match cell {
            Cell::Absent | Cell::Bytes(_) | Cell::File(_) => Self::Null,
            Cell::Bool(is_true) => Self::Bool(*is_true),
            Cell::Number(text) => text.parse().map_or_else(|_| text.as_ref().into(), Self::Number),
            Cell::Text(text) => text.as_str().into(),
            Cell::List(cells) => cells.iter().map(Self::from).collect(),
            Cell::Fields(fields) => {
                Self::Object(fields.iter().map(|(name, cell)| (name.to_string(), Self::from(cell))).collect())
            }
        }
    }
}

impl From<Value> for Cell {
    fn from(value: Value) -> Self {
        match value {
            Value::Null => Self::Absent,
            Value::Bool(is_true) => Self::Bool(is_true),
            Value::Number(number) => Self::Number(number.to_string().into()),
            Value::String(text) => Self::Text(text),
            Value::Array(values) => Self::List(values.into_iter().map(Self::from).collect()),
            Value::Object(fields) => {
                Self::Fields(fields.into_iter().map(|(name, value)| (name.into(), Self::from(value))).collect())
            }
        }
    }
}

/// Text of a number without a zero fraction: `3` for `3.0`.
fn without_zero_fraction(number: &str) -> String {
    number.strip_suffix(".0").unwrap_or(number).to_owned()
}

/// Decodes a text of base64, or a `data:` URL, that is longer than a name; `None` for other texts.
pub(crate) fn decode_base64(text: &str) -> Option<Vec<u8>> {
    let text = text.trim();
    let text = match text.strip_prefix("data:") {
        Some(url) => url.split_once(',')?.1,
        None => text,
    };
    if text.len() <= MAX_NAME_LENGTH {
        return None;
    }
    if text.bytes().all(is_base64) {
        return STANDARD.decode(text).ok();
    }
    let is_wrapped = text.split_ascii_whitespace().next().is_some_and(|line| line.len() >= MIN_BASE64_LINE);
    if !is_wrapped || !text.bytes().all(is_base64_or_space) {
        return None;
    }
    let unwrapped: Vec<u8> = text.bytes().filter(|byte| !byte.is_ascii_whitespace()).collect();
    STANDARD.decode(unwrapped).ok()
}

fn is_base64(byte: u8) -> bool {
    byte.is_ascii_alphanumeric() || matches!(byte, b'+' | b'/' | b'=')
}

fn is_base64_or_space(byte: u8) -> bool {
    is_base64(byte) || byte.is_ascii_whitespace()
}

/// Step of the path from a cell to a value inside it.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub enum PathStep {
    /// Item of a list, or of a text with a list.
    Item(usize),
    /// Field of a struct.
    Field(String),
}

impl Cell {
    /// Value at the end of a path; `None` if there is none.
    pub fn value_at(&self, steps: &[PathStep]) -> Option<Self> {
        let Some((step, rest)) = steps.split_first() else {
            return Some(self.clone());
        };
        match (self, step) {
            (Self::List(cells), PathStep::Item(index)) => cells.get(*index)?.value_at(rest),
            (Self::Text(text), PathStep::Item(index)) => {
                let item = parse_list(text)?.into_iter().nth(*index)?;
                Self::Text(item).value_at(rest)
            }
            (_, PathStep::Field(name)) => self.field(name)?.value_at(rest),
            (_, PathStep::Item(_)) => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_base64_is_decoded_and_sentences_are_not() {
        assert_eq!(decode_base64(&"what is this on a table ".repeat(60)), None);
        let file = vec![7; 90];
        let text = STANDARD.encode(&file);
        let wrapped = format!("{}\n{}", &text[..76], &text[76..]);
        for form in [text.clone(), wrapped, format!("data:image/png;base64,{text}")] {
            assert_eq!(decode_base64(&form).unwrap(), file, "{form}");
        }
        let path = "a/long/path/of/an/image/that/has/more/than/sixty/four/characters/0.png";
        for text in [&text[..60], path, "What is this? ".repeat(9).as_str()] {
            assert_eq!(decode_base64(text), None, "{text}");
        }
    }

    #[test]
    fn cell_is_no_larger_than_string() {
        assert_eq!(size_of::<Cell>(), size_of::<String>());
    }

    #[test]
    fn files_are_replaced_by_their_digest() {
        let file = vec![9; 4000];
        let text = Cell::Text(STANDARD.encode(&file)).without_files(&mut FieldNames::default());
        assert_eq!(text, Cell::Bytes(file.clone().into()).without_files(&mut FieldNames::default()));
        assert_eq!(text, Cell::File(Box::new(DroppedFile::from_bytes(&file))));
        assert_ne!(text, Cell::File(Box::new(DroppedFile::from_bytes(&file[1..]))));
    }

    #[test]
    fn words_for_missing_values_are_absent() {
        for nothing in ["", " ", "nan", "N/A", "None", "null"] {
            assert!(Cell::Text(nothing.to_owned()).is_absent(), "{nothing:?}");
        }
        for something in ["0", "no", "none of these"] {
            assert!(!Cell::Text(something.to_owned()).is_absent(), "{something:?}");
        }
    }
}
