//! The rows of a JSON file, found without holding the file: [`JsonScan`].
//!
//! The skeleton of the file (the list of rows, and the objects around it) is walked byte by byte; only one row at a time is in memory,
//! and parsed by `serde_json`.

use std::io::{self, BufRead};

/// The maximum length of a row, in bytes: an image of 48 MB in base64.
pub(super) const LONGEST_ROW: usize = 64 << 20;

/// A reader of JSON that knows its place.
pub(super) struct JsonScan<R> {
    reader: R,
    offset: u64,
}

/// The value at the place of a reader, by its first byte.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    List,
    Object,
    Other,
}

/// A value in the bytes of a file.
pub(super) struct Found {
    /// The place of its first byte.
    pub(super) offset: u64,
    pub(super) bytes: Vec<u8>,
}

impl<R: BufRead> JsonScan<R> {
    pub(super) fn new(reader: R) -> Self {
        Self { reader, offset: 0 }
    }

    /// The next byte, which stays.
    fn peek(&mut self) -> Result<Option<u8>, String> {
        loop {
            match self.reader.fill_buf() {
                Ok(buffer) => return Ok(buffer.first().copied()),
                Err(e) if e.kind() == io::ErrorKind::Interrupted => {}
                Err(e) => return Err(e.to_string()),
            }
        }
    }

    fn skip(&mut self) {
        self.reader.consume(1);
        self.offset += 1;
    }

    /// The next byte that is no space, which stays.
    fn next_sign(&mut self) -> Result<u8, String> {
        loop {
            match self.peek()? {
                Some(b' ' | b'\t' | b'\r' | b'\n') => self.skip(),
                Some(0xEF) if self.offset == 0 => (0..3).for_each(|_| self.skip()),
                Some(byte) => return Ok(byte),
                None => return Err(format!("the file ends at byte {}", self.offset)),
            }
        }
    }

    /// Takes this sign.
    fn take(&mut self, sign: u8) -> Result<(), String> {
        let found = self.next_sign()?;
        if found == sign {
            self.skip();
            return Ok(());
        }
        Err(format!(
            "{:?} at byte {}, where {:?} is expected",
            char::from(found),
            self.offset + 1,
            char::from(sign)
        ))
    }

    /// The kind of the next value.
    pub(super) fn kind(&mut self) -> Result<Kind, String> {
        Ok(match self.next_sign()? {
            b'[' => Kind::List,
            b'{' => Kind::Object,
            _ => Kind::Other,
        })
    }

    /// Walks the elements of a list; `each` must read or skip each.
    pub(super) fn list(
        &mut self,
        mut each: impl FnMut(&mut Self) -> Result<(), String>,
    ) -> Result<(), String> {
        self.take(b'[')?;
        if self.next_sign()? == b']' {
            self.skip();
            return Ok(());
        }
        loop {
            each(self)?;
            match self.next_sign()? {
                b',' => self.skip(),
                _ => return self.take(b']'),
            }
        }
    }

    /// Walks the fields of an object; `each` must read or skip the value of each.
    pub(super) fn object(
        &mut self,
        mut each: impl FnMut(&mut Self, String) -> Result<(), String>,
    ) -> Result<(), String> {
        self.take(b'{')?;
        if self.next_sign()? == b'}' {
            self.skip();
            return Ok(());
        }
        loop {
            if self.next_sign()? != b'"' {
                return Err(format!(
                    "byte {} is not the name of a field",
                    self.offset + 1
                ));
            }
            let name = self.value(1 << 20)?;
            let name = serde_json::from_slice(&name.bytes).map_err(|e| e.to_string())?;
            self.take(b':')?;
            each(self, name)?;
            match self.next_sign()? {
                b',' => self.skip(),
                _ => return self.take(b'}'),
            }
        }
    }

    /// The next value, of at most so many bytes.
    pub(super) fn value(&mut self, longest: usize) -> Result<Found, String> {
        self.next_sign()?;
        let (offset, mut bytes) = (self.offset, Vec::new());
        let mut too_long = false;
        self.walk(|chunk| {
            too_long |= bytes.len() + chunk.len() > longest;
            if !too_long {
                bytes.extend_from_slice(chunk);
            }
        })?;
        if too_long {
            return Err(format!(
                "a value of more than {} MB begins at byte {}",
                longest >> 20,
                offset + 1
            ));
        }
        Ok(Found { offset, bytes })
    }

    /// Skips the next value.
    pub(super) fn skip_value(&mut self) -> Result<(), String> {
        self.next_sign()?;
        self.walk(|_| ())
    }

    /// Walks to the end of the value that begins here, and hands out its bytes.
    fn walk(&mut self, mut each: impl FnMut(&[u8])) -> Result<(), String> {
        let mut state = Walk::default();
        loop {
            let buffer = match self.reader.fill_buf() {
                Ok(buffer) => buffer,
                Err(e) if e.kind() == io::ErrorKind::Interrupted => continue,
                Err(e) => return Err(e.to_string()),
            };
            if buffer.is_empty() {
                return match state.depth {
                    0 if state.begun && !state.in_text => Ok(()),
                    _ => Err(format!(
                        "the file ends at byte {} inside a value",
                        self.offset
                    )),
                };
            }
            let (taken, is_end) = state.take(buffer);
            each(&buffer[..taken]);
            self.reader.consume(taken);
            self.offset += taken as u64;
            if is_end {
                return Ok(());
            }
        }
    }

    /// Checks that nothing but space follows.
    pub(super) fn end(&mut self) -> Result<(), String> {
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

/// The state of a walk over one value.
#[derive(Default)]
struct Walk {
    begun: bool,
    depth: usize,
    in_text: bool,
    is_escaped: bool,
}

impl Walk {
    /// How many bytes of a buffer belong to the value, and whether it ends there.
    fn take(&mut self, buffer: &[u8]) -> (usize, bool) {
        for (at, &byte) in buffer.iter().enumerate() {
            if self.in_text {
                match byte {
                    _ if self.is_escaped => self.is_escaped = false,
                    b'\\' => self.is_escaped = true,
                    b'"' => {
                        self.in_text = false;
                        if self.depth == 0 {
                            return (at + 1, true);
                        }
                    }
                    _ => {}
                }
                continue;
            }
            let is_first = !self.begun;
            self.begun = true;
            match byte {
                b'"' => self.in_text = true,
                b'[' | b'{' => self.depth += 1,
                b']' | b'}' if self.depth > 0 => {
                    self.depth -= 1;
                    if self.depth == 0 {
                        return (at + 1, true);
                    }
                }
                b',' | b']' | b'}' | b' ' | b'\t' | b'\r' | b'\n' if self.depth == 0 => {
                    // A sign where a value is expected is taken, so that its parser refuses it.
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

    /// The elements of the list `items` in a text, read through a buffer of so many bytes.
    fn items(text: &str, buffer: usize) -> Result<Vec<(u64, String)>, String> {
        let mut found = Vec::new();
        let mut scan = JsonScan::new(BufReader::with_capacity(buffer, text.as_bytes()));
        scan.object(|scan, name| {
            if name != "items" {
                return scan.skip_value();
            }
            scan.list(|scan| {
                let value = scan.value(40)?;
                found.push((value.offset, String::from_utf8(value.bytes).unwrap()));
                Ok(())
            })
        })?;
        scan.end()?;
        Ok(found)
    }

    #[test]
    fn values_are_found_whole_at_any_buffer() {
        let text =
            r#" {"a": [1, {"b": "}]"}], "items" : [ {"x": "\"]}"} ,3,"a,b",[] ], "z": null} "#;
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
    fn broken_files_are_refused() {
        for (text, says) in [
            (r#"{"items": [1, 2"#, "the file ends at byte"),
            (r#"{"items": ["abc"#, "inside a value"),
            (r#"{"items" 1}"#, "':' is expected"),
            (r"{items: 1}", "not the name of a field"),
            (r#"{"items": []} {"items": []}"#, "ends in .jsonl"),
            (r#"{"items": [1 2]}"#, "']' is expected"),
            (
                r#"{"items": ["0123456789012345678901234567890123456789"]}"#,
                "a value of more than",
            ),
        ] {
            let problem = items(text, 4).unwrap_err();
            assert!(problem.contains(says), "{text}: {problem}");
        }
    }
}
