//! A value in a row of a ready-made set: [`Cell`].

use std::collections::BTreeSet;
use std::sync::Arc;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use serde_json::Value;

use super::text_list::list;
use crate::picture::image_file::format::FileFormat;
use crate::types::Digest;
use crate::types::text::excerpt;

/// The maximum length of a text that may be a path or the id of a row. A longer one of the base64 alphabet is a file (the rule of
/// VLMEvalKit, `vlmeval/dataset/image_base.py`).
pub(in crate::dataset::ready_made) const LONGEST_NAME: usize = 64;

/// The length from which on a text of the base64 alphabet is not kept: its file is read again when it is shown.
const LONGEST_KEPT: usize = 1024;

/// The shortest line of base64 that is wrapped: PEM has 64 characters, MIME 76. Shorter words are those of a sentence.
const SHORTEST_LINE: usize = 60;

/// A value in a row. The bytes of files are not kept. Sets have millions of cells, so that a cell is no larger than a text.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::dataset::ready_made) enum Cell {
    /// Null, or no such column in this row.
    Absent,
    Bool(bool),
    /// A number as its file writes it.
    Number(Box<str>),
    Text(String),
    /// Bytes, of a row that is read to show its image.
    Bytes(Box<[u8]>),
    /// Bytes that were looked at and not kept, of a row that is read for its question.
    File(Box<FileFacts>),
    List(Box<[Cell]>),
    Fields(Fields),
}

/// The fields of a struct, with their names.
pub(in crate::dataset::ready_made) type Fields = Box<[(Arc<str>, Cell)]>;

/// The names of fields in the cells of a table. Equal ones are held once.
#[derive(Debug, Default)]
pub(super) struct FieldNames(BTreeSet<Arc<str>>);

impl FieldNames {
    fn once(&mut self, name: Arc<str>) -> Arc<str> {
        if let Some(known) = self.0.get(&name) {
            return Arc::clone(known);
        }
        self.0.insert(Arc::clone(&name));
        name
    }
}

/// Facts about bytes that are not kept.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(in crate::dataset::ready_made) struct FileFacts {
    pub(in crate::dataset::ready_made) digest: Digest,
    /// The format by the first bytes; `None` if it is none that is read.
    pub(in crate::dataset::ready_made) format: Option<FileFormat>,
}

impl FileFacts {
    pub(in crate::dataset::ready_made) fn from_bytes(bytes: &[u8]) -> Self {
        Self {
            digest: Digest::from_bytes(bytes),
            format: FileFormat::detect(bytes).ok(),
        }
    }
}

impl Cell {
    /// The memory that the cell takes, in bytes.
    pub(super) fn length(&self) -> usize {
        let inner = match self {
            Self::Absent | Self::Bool(_) => 0,
            Self::Number(text) => text.len(),
            Self::Text(text) => text.len(),
            Self::Bytes(bytes) => bytes.len(),
            Self::File(_) => size_of::<FileFacts>(),
            Self::List(cells) => cells.iter().map(Self::length).sum(),
            Self::Fields(fields) => fields
                .iter()
                .map(|(_, cell)| size_of::<Arc<str>>() + cell.length())
                .sum(),
        };
        size_of::<Self>() + inner
    }

    /// The cell without the bytes of files.
    pub(super) fn without_files(self, names: &mut FieldNames) -> Self {
        match self {
            Self::Bytes(bytes) => Self::File(Box::new(FileFacts::from_bytes(&bytes))),
            Self::Text(text) if text.len() > LONGEST_KEPT => match (decoded(&text), list(&text)) {
                (Some(bytes), _) => Self::File(Box::new(FileFacts::from_bytes(&bytes))),
                (None, Some(items)) => {
                    let items = items.into_iter();
                    Self::List(
                        items
                            .map(|item| Self::Text(item).without_files(names))
                            .collect(),
                    )
                }
                (None, None) => Self::Text(text),
            },
            Self::List(cells) => {
                let cells = cells.into_iter();
                Self::List(cells.map(|cell| cell.without_files(names)).collect())
            }
            Self::Fields(fields) => {
                let fields = fields.into_iter();
                Self::Fields(
                    fields
                        .map(|(name, cell)| (names.once(name), cell.without_files(names)))
                        .collect(),
                )
            }
            other => other,
        }
    }

    /// Whether nothing is there: null, an empty text or list, or a word by which tables write that (`nan`, `N/A`, `None`, `null`).
    pub(in crate::dataset::ready_made) fn is_absent(&self) -> bool {
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

    /// The cell as text; `None` if it is absent, or neither a text nor a number nor a truth value.
    pub(in crate::dataset::ready_made) fn text(&self) -> Option<String> {
        match self {
            Self::Bool(is_true) => Some(is_true.to_string()),
            Self::Number(text) => Some(whole(text)),
            Self::Text(text) if !text.trim().is_empty() => Some(text.clone()),
            _ => None,
        }
    }

    /// The list or struct in a text of JSON; `None` if it holds none.
    pub(in crate::dataset::ready_made) fn parsed(&self) -> Option<Self> {
        let Self::Text(text) = self else {
            return None;
        };
        if !text.trim_start().starts_with(['[', '{']) {
            return None;
        }
        serde_json::from_str::<Value>(text).ok().map(Self::from)
    }

    /// The field of a struct, by its name; the item of a list, by its number from 0.
    pub(in crate::dataset::ready_made) fn field(&self, name: &str) -> Option<&Self> {
        if let Self::List(cells) = self {
            return cells.get(name.parse::<usize>().ok()?);
        }
        let Self::Fields(fields) = self else {
            return None;
        };
        fields
            .iter()
            .find(|(field, _)| **field == *name)
            .map(|(_, cell)| cell)
    }

    /// The kind of value, for messages.
    pub(in crate::dataset::ready_made) fn kind(&self) -> &'static str {
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

    /// The value in at most about `most` characters, for messages.
    pub(in crate::dataset::ready_made) fn shown(&self, most: usize) -> String {
        let whole = match self {
            Self::Absent => String::new(),
            Self::Bool(_) | Self::Number(_) => self.text().unwrap_or_default(),
            Self::Text(text) => format!("{text:?}"),
            Self::Bytes(bytes) => format!("{} bytes", bytes.len()),
            Self::File(_) => "bytes".to_owned(),
            Self::List(cells) => {
                let cells: Vec<String> = cells.iter().map(|cell| cell.shown(most)).collect();
                format!("[{}]", cells.join(", "))
            }
            Self::Fields(fields) => {
                let fields: Vec<String> = fields
                    .iter()
                    .map(|(name, cell)| format!("{name}: {}", cell.shown(most)))
                    .collect();
                format!("{{{}}}", fields.join(", "))
            }
        };
        excerpt(&whole, most)
    }
}

impl From<&Cell> for Value {
    /// The value as JSON; of bytes, null.
    fn from(cell: &Cell) -> Self {
        match cell {
            Cell::Absent | Cell::Bytes(_) | Cell::File(_) => Self::Null,
            Cell::Bool(is_true) => Self::Bool(*is_true),
            Cell::Number(text) => text
                .parse()
                .map_or_else(|_| text.as_ref().into(), Self::Number),
            Cell::Text(text) => text.as_str().into(),
            Cell::List(cells) => cells.iter().map(Self::from).collect(),
            Cell::Fields(fields) => {
                let fields = fields.iter();
                Self::Object(
                    fields
                        .map(|(name, cell)| (name.to_string(), Self::from(cell)))
                        .collect(),
                )
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
                let fields = fields.into_iter();
                Self::Fields(
                    fields
                        .map(|(name, value)| (name.into(), Self::from(value)))
                        .collect(),
                )
            }
        }
    }
}

/// The text of a number without a fraction of zero: `3.0` is `3`.
fn whole(number: &str) -> String {
    number.strip_suffix(".0").unwrap_or(number).to_owned()
}

/// The file in a text, if the text is base64 and longer than a name. The head of a `data:` address is cut.
pub(in crate::dataset::ready_made) fn decoded(text: &str) -> Option<Vec<u8>> {
    let text = text.trim();
    let text = match text.strip_prefix("data:") {
        Some(address) => address.split_once(',')?.1,
        None => text,
    };
    if text.len() <= LONGEST_NAME {
        return None;
    }
    let is_base64 = |byte: u8| byte.is_ascii_alphanumeric() || matches!(byte, b'+' | b'/' | b'=');
    if text.bytes().all(is_base64) {
        return STANDARD.decode(text).ok();
    }
    let is_wrapped = text
        .split_ascii_whitespace()
        .next()
        .is_some_and(|line| line.len() >= SHORTEST_LINE);
    let mut bytes = text.bytes();
    if !is_wrapped || !bytes.all(|byte| is_base64(byte) || byte.is_ascii_whitespace()) {
        return None;
    }
    let dense: Vec<u8> = text
        .bytes()
        .filter(|byte| !byte.is_ascii_whitespace())
        .collect();
    STANDARD.decode(dense).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_text_of_base64_is_a_file_and_a_sentence_is_none() {
        assert_eq!(decoded(&"what is this on a table ".repeat(60)), None);
        let file = vec![7; 90];
        let text = STANDARD.encode(&file);
        let wrapped = format!("{}\n{}", &text[..76], &text[76..]);
        for form in [
            text.clone(),
            wrapped,
            format!("data:image/png;base64,{text}"),
        ] {
            assert_eq!(decoded(&form).unwrap(), file, "{form}");
        }
        let path = "a/long/path/of/an/image/that/has/more/than/sixty/four/characters/0.png";
        for text in [&text[..60], path, "What is this? ".repeat(9).as_str()] {
            assert_eq!(decoded(text), None, "{text}");
        }
    }

    #[test]
    fn a_cell_is_no_larger_than_a_text() {
        assert_eq!(size_of::<Cell>(), size_of::<String>());
    }

    #[test]
    fn files_are_known_by_their_digest_and_not_kept() {
        let file = vec![9; 4000];
        let text = Cell::Text(STANDARD.encode(&file)).without_files(&mut FieldNames::default());
        assert_eq!(
            text,
            Cell::Bytes(file.clone().into()).without_files(&mut FieldNames::default())
        );
        assert_eq!(text, Cell::File(Box::new(FileFacts::from_bytes(&file))));
        assert_ne!(
            text,
            Cell::File(Box::new(FileFacts::from_bytes(&file[1..])))
        );
    }

    #[test]
    fn words_for_nothing_are_nothing() {
        for nothing in ["", " ", "nan", "N/A", "None", "null"] {
            assert!(Cell::Text(nothing.to_owned()).is_absent(), "{nothing:?}");
        }
        for something in ["0", "no", "none of these"] {
            assert!(
                !Cell::Text(something.to_owned()).is_absent(),
                "{something:?}"
            );
        }
    }
}
