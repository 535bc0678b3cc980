//! Scanner for the rows of a large JSON file: [`JsonScanner`].
//!
//! The scanner walks over the list of rows and the objects around it byte by byte. Only one row at a time is in memory,
//! to be parsed by `serde_json`.

use std::io::{self, BufRead};

use crate::files::reading::NOT_UTF8;

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
