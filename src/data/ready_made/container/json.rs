//! Reader of JSON files: one object per line, a list of objects, or a list inside another object (`--read rows`).
//!
//! Scanner for the rows of a large JSON file: [`JsonScanner`].
//!
//! The scanner walks over the list of rows and the objects around it byte by byte. Only one row at a time is in memory,
//! to be parsed by `serde_json`.

use std::fs::File;
use std::io::{self, BufRead, BufReader, Read as _, Seek as _, SeekFrom};
use std::path::Path;
use std::sync::Arc;

use serde_json::{Map, Value};

use super::super::cells::{Cell, JsonUnit, RowPlace, SetRows};
use darkqa_base::error::{Error, Result};
use darkqa_base::files::{self, NOT_UTF8, json_problem};
use darkqa_base::types::shell_word;

type FileScanner = JsonScanner<BufReader<File>>;

fn open(path: &Path) -> Result<BufReader<File>> {
    let file = files::open(path).map_err(|e| Error::file(path, "read", e))?;
    Ok(BufReader::with_capacity(1 << 16, file))
}

/// Maximum number of values in a row (chosen). A value takes tens of bytes in memory, however short its text is.
const MAX_VALUES: usize = 1 << 20;

/// Checks that a row has at most [`MAX_VALUES`] values.
fn check_values(bytes: &[u8]) -> Result<(), String> {
    let separators = bytes.iter().filter(|byte| matches!(byte, b',' | b'[')).count();
    if separators <= MAX_VALUES {
        return Ok(());
    }
    // Count again without the commas in strings.
    let (mut count, mut in_text, mut is_escaped) = (0, false, false);
    for byte in bytes {
        match byte {
            _ if is_escaped => is_escaped = false,
            b'\\' => is_escaped = true,
            b'"' => in_text = !in_text,
            b',' | b'[' if !in_text => count += 1,
            _ => {}
        }
    }
    if count <= MAX_VALUES {
        return Ok(());
    }
    Err(format!("more than {MAX_VALUES} values in a row"))
}

/// Appends the rows of a file with one object per line. Empty lines and a byte order mark are skipped.
pub(super) fn read_lines(path: &Path, table: &mut SetRows) -> Result<()> {
    let mut reader = open(path)?;
    let mut offset = 0;
    for number in 1.. {
        let mut line = Vec::new();
        let length = (&mut reader)
            .take(MAX_ROW_BYTES as u64 + 2)
            .read_until(b'\n', &mut line)
            .map_err(|e| Error::file(path, "read", e))?;
        if length == 0 {
            break;
        }
        if length > MAX_ROW_BYTES {
            let problem = format_args!("a line of more than {} MB", MAX_ROW_BYTES >> 20);
            return Err(Error::line(path, number, problem));
        }
        let bytes = line.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(&line);
        if !bytes.trim_ascii().is_empty() {
            check_values(bytes).map_err(|problem| Error::line(path, number, problem))?;
            let value = serde_json::from_slice(bytes).map_err(|e| match json_problem(bytes, &e) {
                Some(problem) => Error::line(path, number, problem),
                None => Error::json_line(path, number, &e),
            })?;
            let Value::Object(fields) = value else {
                return Err(Error::line(path, number, "not an object; {\"question\": …} expected"));
            };
            let place = RowPlace::Json {
                offset: offset + (length - bytes.len()) as u64,
                length: bytes.len(),
                number: number as u64,
                unit: JsonUnit::Line,
                inner: None,
            };
            push_row(table, place, fields, None).map_err(|problem| Error::line(path, number, problem))?;
        }
        offset += length as u64;
    }
    Ok(())
}

/// Appends the rows of a JSON file. `rows` is the path to their list, such as `items` or `images.*.qa`.
pub(super) fn read(path: &Path, rows: Option<&str>, table: &mut SetRows) -> Result<()> {
    let steps: Vec<&str> = rows.iter().flat_map(|rows| rows.split('.')).collect();
    let before = table.rows.len();
    let scanner = JsonScanner::new(open(path)?);
    read_rows_at(scanner, path, &steps, table).map_err(|problem| Error::data(path.display(), problem))?;
    if table.rows.len() == before && !steps.is_empty() {
        let problem = format_args!("{}: no list of objects there", steps.join("."));
        return Err(Error::usage("--read rows", problem).at("--read rows"));
    }
    Ok(())
}

/// Appends the rows of the list at the end of a path.
fn read_rows_at(mut scanner: FileScanner, path: &Path, steps: &[&str], table: &mut SetRows) -> Result<(), String> {
    match (scanner.next_kind()?, steps) {
        (ValueKind::Other, _) => return Err("neither a list nor an object".to_owned()),
        (ValueKind::Object, []) => return read_rows_by_id(path, table),
        _ => scan_to_rows(&mut scanner, steps, table)?,
    }
    scanner.expect_end()
}

/// Scans to the list of rows and appends them.
fn scan_to_rows(scanner: &mut FileScanner, steps: &[&str], table: &mut SetRows) -> Result<(), String> {
    match (steps, scanner.next_kind()?) {
        ([] | ["*", _], ValueKind::List) => {
            let inner = steps.get(1).copied();
            let mut number = 0;
            scanner.for_each_item(|scanner| {
                number += 1;
                let value = scanner.read_value(MAX_ROW_BYTES)?;
                push_value(&value, number, inner, table)
            })
        }
        ([name, rest @ ..], ValueKind::Object) => scanner.for_each_field(|scanner, field| {
            if field == *name { scan_to_rows(scanner, rest, table) } else { scanner.skip_value() }
        }),
        _ => scanner.skip_value(),
    }
}

/// Appends an object as a row. With `inner`, appends the objects in its list of this name, each with the other fields
/// of the object.
fn push_value(value: &JsonValue, number: u64, inner: Option<&str>, table: &mut SetRows) -> Result<(), String> {
    let fields = parse_object(value, number)?;
    let Some(list) = inner else {
        return push_row(table, object_place(value, number, None), fields, None);
    };
    let name: Arc<str> = list.into();
    let mut outer = fields;
    let Some(Value::Array(rows)) = outer.remove(list) else {
        return Err(format!("object {number} has no list {list:?}"));
    };
    for (index, row) in rows.into_iter().enumerate() {
        let Value::Object(row) = row else {
            return Err(format!("object {number}: {list:?} is not a list of objects"));
        };
        let place = object_place(value, number, Some(Box::new((index, Arc::clone(&name)))));
        push_row(table, place, row, Some(&outer))?;
    }
    Ok(())
}

fn object_place(value: &JsonValue, number: u64, inner: Option<Box<(usize, Arc<str>)>>) -> RowPlace {
    RowPlace::Json { offset: value.offset, length: value.bytes.len(), number, unit: JsonUnit::Object, inner }
}

/// Parses a value that must be an object; `number` is its position, counted from 1.
fn parse_object(value: &JsonValue, number: u64) -> Result<Map<String, Value>, String> {
    check_values(&value.bytes).map_err(|problem| format!("object {number}: {problem}"))?;
    match serde_json::from_slice(&value.bytes) {
        Ok(Value::Object(fields)) => Ok(fields),
        Ok(_) => Err(format!("value {number} of the list is not an object")),
        Err(e) => match json_problem(&value.bytes, &e) {
            Some(problem) => Err(format!("object {number}: {problem}")),
            None => Err(format!("object {number}, at byte {}: {e}", value.offset + 1)),
        },
    }
}

/// Appends the rows of an object whose fields are the rows by id.
///
/// # Errors
/// If the fields are not objects. If they are lists, the error lists them with their columns.
fn read_rows_by_id(path: &Path, table: &mut SetRows) -> Result<(), String> {
    let mut scanner = JsonScanner::new(open(path).map_err(|e| e.to_string())?);
    let (mut lists, mut number, mut others) = (Vec::new(), 0, 0);
    let (before, mut keys) = (table.rows.len(), Vec::new());
    scanner.for_each_field(|scanner, name| {
        match scanner.next_kind()? {
            ValueKind::Object => {
                number += 1;
                let value = scanner.read_value(MAX_ROW_BYTES)?;
                push_value(&value, number, None, table)?;
                keys.push(name);
            }
            ValueKind::List => {
                let columns = first_object_keys(scanner)?;
                lists.extend(columns.map(|columns| (name, columns)));
            }
            ValueKind::Other => {
                others += 1;
                scanner.skip_value()?;
            }
        }
        Ok(())
    })?;
    scanner.expect_end()?;
    let Some((name, columns)) = lists.first() else {
        return match (number, others) {
            (1.., 0) => table.add_ids(before, keys),
            _ => Err("neither a list of objects, nor objects by their ids".to_owned()),
        };
    };
    let names: Vec<&str> = lists.iter().map(|(name, _)| name.as_str()).collect();
    Err(format!(
        "an object with the lists {}; {name:?} has the columns {}; say where the rows are: --read rows={}, and which column is which if these are no common names: --map question=…,image=…,options=…,answer=…",
        names.join(", "),
        columns.join(", "),
        shell_word(name)
    ))
}

/// Keys of the first object in a list; `None` if it has no object.
fn first_object_keys(scanner: &mut FileScanner) -> Result<Option<Vec<String>>, String> {
    let mut keys = None;
    scanner.for_each_item(|scanner| {
        if keys.is_some() || scanner.next_kind()? != ValueKind::Object {
            return scanner.skip_value();
        }
        let fields = parse_object(&scanner.read_value(MAX_ROW_BYTES)?, 1)?;
        keys = Some(fields.keys().cloned().collect());
        Ok(())
    })?;
    Ok(keys)
}

/// Appends a row. It inherits the fields of `outer` that it does not have.
fn push_row(
    table: &mut SetRows,
    place: RowPlace,
    fields: Map<String, Value>,
    outer: Option<&Map<String, Value>>,
) -> Result<(), String> {
    let mut cells = Vec::new();
    for (name, value) in outer.into_iter().flatten() {
        if !fields.contains_key(name) {
            cells.push((table.add_column(name)?, Cell::from(value.clone())));
        }
    }
    for (name, value) in fields {
        cells.push((table.add_column(&name)?, Cell::from(value)));
    }
    table.push(place, cells)
}

/// Reads one whole cell of the object at an offset. For nested rows, `inner` is the index of the row and the name of
/// its list.
pub(super) fn cell(
    path: &Path,
    offset: u64,
    length: usize,
    inner: Option<(usize, &str)>,
    column: &str,
) -> Result<Cell> {
    let bytes = read_range(path, offset, length).map_err(|e| Error::file(path, "read", e))?;
    let value: Value = serde_json::from_slice(&bytes)
        .map_err(|e| Error::data(path.display(), format_args!("changed while it was read: {e}")))?;
    let cell = inner.and_then(|(index, list)| value.get(list)?.get(index)?.get(column)).or_else(|| value.get(column));
    Ok(cell.cloned().map_or(Cell::Absent, Cell::from))
}

fn read_range(path: &Path, offset: u64, length: usize) -> std::io::Result<Vec<u8>> {
    let mut file = files::open(path)?;
    file.seek(SeekFrom::Start(offset))?;
    let mut bytes = vec![0; length];
    file.read_exact(&mut bytes)?;
    Ok(bytes)
}

/// Maximum length of a row, in bytes: enough for an image of 48 MB in base64.
pub(super) const MAX_ROW_BYTES: usize = 64 << 20;

/// Maximum length of a field name, in bytes.
const MAX_FIELD_NAME_BYTES: usize = 1 << 20;

/// Scanner over the values of a JSON text.
pub(super) struct JsonScanner<R> {
    reader: R,
    /// Number of bytes read.
    offset: u64,
}

/// Kind of the next value, from its first byte.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum ValueKind {
    List,
    Object,
    Other,
}

/// Text of a value.
pub(super) struct JsonValue {
    /// Offset of its first byte in the file.
    pub(super) offset: u64,
    pub(super) bytes: Vec<u8>,
}

impl<R: BufRead> JsonScanner<R> {
    pub(super) fn new(reader: R) -> Self {
        Self { reader, offset: 0 }
    }

    /// Returns the next byte without consuming it.
    fn peek(&mut self) -> Result<Option<u8>, String> {
        loop {
            match self.reader.fill_buf() {
                Ok(buffer) => return Ok(buffer.first().copied()),
                Err(e) if e.kind() == io::ErrorKind::Interrupted => {}
                Err(e) => return Err(e.to_string()),
            }
        }
    }

    /// Consumes one byte.
    fn skip(&mut self) {
        self.reader.consume(1);
        self.offset += 1;
    }

    /// Skips space, and returns the next byte without consuming it.
    fn peek_token(&mut self) -> Result<u8, String> {
        loop {
            match self.peek()? {
                Some(b' ' | b'\t' | b'\r' | b'\n') => self.skip(),
                Some(0xEF) if self.offset == 0 => (0..3).for_each(|_| self.skip()),
                Some(0xFE | 0xFF) => return Err(NOT_UTF8.to_owned()),
                Some(byte) => return Ok(byte),
                None => return Err(format!("the file ends at byte {}", self.offset)),
            }
        }
    }

    /// Consumes the expected byte after space.
    fn expect(&mut self, expected: u8) -> Result<(), String> {
        let found = self.peek_token()?;
        if found == expected {
            self.skip();
            return Ok(());
        }
        Err(format!(
            "{:?} at byte {}, where {:?} is expected",
            char::from(found),
            self.offset + 1,
            char::from(expected)
        ))
    }

    /// Kind of the next value.
    pub(super) fn next_kind(&mut self) -> Result<ValueKind, String> {
        Ok(match self.peek_token()? {
            b'[' => ValueKind::List,
            b'{' => ValueKind::Object,
            _ => ValueKind::Other,
        })
    }

    /// Scans a list. `visit` must read or skip each item.
    pub(super) fn for_each_item(
        &mut self,
        mut visit: impl FnMut(&mut Self) -> Result<(), String>,
    ) -> Result<(), String> {
        self.expect(b'[')?;
        if self.peek_token()? == b']' {
            self.skip();
            return Ok(());
        }
        loop {
            visit(self)?;
            match self.peek_token()? {
                b',' => self.skip(),
                _ => return self.expect(b']'),
            }
        }
    }

    /// Scans an object. `visit` gets the name of each field, and must read or skip its value.
    pub(super) fn for_each_field(
        &mut self,
        mut visit: impl FnMut(&mut Self, String) -> Result<(), String>,
    ) -> Result<(), String> {
        self.expect(b'{')?;
        if self.peek_token()? == b'}' {
            self.skip();
            return Ok(());
        }
        loop {
            if self.peek_token()? != b'"' {
                return Err(format!("byte {} is not the name of a field", self.offset + 1));
            }
            let name = self.read_value(MAX_FIELD_NAME_BYTES)?;
            let name = serde_json::from_slice(&name.bytes).map_err(|e| e.to_string())?;
            self.expect(b':')?;
            visit(self, name)?;
            match self.peek_token()? {
                b',' => self.skip(),
                _ => return self.expect(b'}'),
            }
        }
    }

    /// Reads the next value, of at most `max` bytes.
    pub(super) fn read_value(&mut self, max: usize) -> Result<JsonValue, String> {
        self.peek_token()?;
        let (offset, mut bytes) = (self.offset, Vec::new());
        let mut too_long = false;
        self.consume_value(|chunk| {
            too_long |= bytes.len() + chunk.len() > max;
            if !too_long {
                bytes.extend_from_slice(chunk);
            }
        })?;
        if too_long {
            return Err(format!("a value of more than {} MB begins at byte {}", max >> 20, offset + 1));
        }
        Ok(JsonValue { offset, bytes })
    }

    /// Skips the next value.
    pub(super) fn skip_value(&mut self) -> Result<(), String> {
        self.peek_token()?;
        self.consume_value(|_| ())
    }

    /// Consumes the value that begins at the next byte, and passes its bytes to `visit` in chunks.
    fn consume_value(&mut self, mut visit: impl FnMut(&[u8])) -> Result<(), String> {
        let mut state = ValueState::default();
        loop {
            let buffer = match self.reader.fill_buf() {
                Ok(buffer) => buffer,
                Err(e) if e.kind() == io::ErrorKind::Interrupted => continue,
                Err(e) => return Err(e.to_string()),
            };
            if buffer.is_empty() {
                return match state.depth {
                    0 if state.has_started && !state.in_string => Ok(()),
                    _ => Err(format!("the file ends at byte {} inside a value", self.offset)),
                };
            }
            let (length, is_end) = state.advance(buffer);
            visit(&buffer[..length]);
            self.reader.consume(length);
            self.offset += length as u64;
            if is_end {
                return Ok(());
            }
        }
    }

    /// Checks that only space follows.
    pub(super) fn expect_end(&mut self) -> Result<(), String> {
        while let Some(byte) = self.peek()? {
            if !byte.is_ascii_whitespace() {
                return Err(format!(
                    "{:?} at byte {}, after the end of the JSON value; the name of a file with one object per line ends in .jsonl",
                    char::from(byte),
                    self.offset + 1
                ));
            }
            self.skip();
        }
        Ok(())
    }
}

/// State of a scan over one value.
#[derive(Default)]
struct ValueState {
    has_started: bool,
    /// Number of open brackets and braces.
    depth: usize,
    in_string: bool,
    is_escaped: bool,
}

impl ValueState {
    /// Number of bytes in the buffer that belong to the value, and whether the value ends there.
    fn advance(&mut self, buffer: &[u8]) -> (usize, bool) {
        for (at, &byte) in buffer.iter().enumerate() {
            if self.in_string {
                match byte {
                    _ if self.is_escaped => self.is_escaped = false,
                    b'\\' => self.is_escaped = true,
                    b'"' => {
                        self.in_string = false;
                        if self.depth == 0 {
                            return (at + 1, true);
                        }
                    }
                    _ => {}
                }
                continue;
            }
            let is_first = !self.has_started;
            self.has_started = true;
            match byte {
                b'"' => self.in_string = true,
                b'[' | b'{' => self.depth += 1,
                b']' | b'}' if self.depth > 0 => {
                    self.depth -= 1;
                    if self.depth == 0 {
                        return (at + 1, true);
                    }
                }
                b',' | b']' | b'}' | b' ' | b'\t' | b'\r' | b'\n' if self.depth == 0 => {
                    // Take an invalid first byte as the value, so that its parser reports it.
                    return (at + usize::from(is_first), true);
                }
                _ => {}
            }
        }
        (buffer.len(), false)
    }
}

#[cfg(test)]
mod tests {
    use std::io::BufReader;

    use super::*;

    /// Items of the list `items` in a text, read with a buffer of this size.
    fn items(text: &str, buffer: usize) -> Result<Vec<(u64, String)>, String> {
        let mut found = Vec::new();
        let mut scanner = JsonScanner::new(BufReader::with_capacity(buffer, text.as_bytes()));
        scanner.for_each_field(|scanner, name| {
            if name != "items" {
                return scanner.skip_value();
            }
            scanner.for_each_item(|scanner| {
                let value = scanner.read_value(40)?;
                found.push((value.offset, String::from_utf8(value.bytes).unwrap()));
                Ok(())
            })
        })?;
        scanner.expect_end()?;
        Ok(found)
    }

    #[test]
    fn values_are_complete_at_any_buffer_size() {
        let text = r#" {"a": [1, {"b": "}]"}], "items" : [ {"x": "\"]}"} ,3,"a,b",[] ], "z": null} "#;
        let values = [r#"{"x": "\"]}"}"#, "3", r#""a,b""#, "[]"];
        for buffer in [1, 2, 7, 4096] {
            let found = items(text, buffer).unwrap();
            let texts: Vec<&str> = found.iter().map(|(_, text)| text.as_str()).collect();
            assert_eq!(texts, values);
            for (offset, value) in &found {
                assert!(text[*offset as usize..].starts_with(value.as_str()));
            }
        }
    }

    #[test]
    fn invalid_json_is_refused() {
        for (text, message) in [
            (r#"{"items": [1, 2"#, "the file ends at byte"),
            (r#"{"items": ["abc"#, "inside a value"),
            (r#"{"items" 1}"#, "':' is expected"),
            (r"{items: 1}", "not the name of a field"),
            (r#"{"items": []} {"items": []}"#, "ends in .jsonl"),
            (r#"{"items": [1 2]}"#, "']' is expected"),
            (r#"{"items": ["0123456789012345678901234567890123456789"]}"#, "a value of more than"),
        ] {
            let problem = items(text, 4).unwrap_err();
            assert!(problem.contains(message), "{text}: {problem}");
        }
    }
}
