//! A file of lines that is read piece by piece, so that it may be larger than the memory: [`Pieces`].

use std::fs::File;
use std::io::{ErrorKind, Read};
use std::path::Path;

use darkqa_ground::error::{Error, Result};
use darkqa_ground::files::reading;

/// The bytes that are read at once. A piece is longer only if one line is. Chosen: enough lines for all cores.
const PIECE_BYTES: u64 = 4 << 20;

/// The most bytes of a line. Chosen: the copies of an image with all things in it take a hundredth.
const MOST_LINE: usize = 64 << 20;

/// The complete lines of a file, some at a time.
pub(super) struct Pieces<'p> {
    path: &'p Path,
    file: File,
    /// Bytes already read of a line that is not complete yet.
    unread: Vec<u8>,
    /// The place of the next line in the file, in bytes.
    start: u64,
    /// The number of lines before it.
    lines: usize,
}

/// Some complete lines of a file.
pub(super) struct Piece {
    bytes: Vec<u8>,
    start: u64,
    lines: usize,
}

/// The place of a line in its file, with its end, in bytes.
#[derive(Debug, Clone, Copy)]
pub struct LinePlace {
    /// Offset of its first byte.
    pub start: u64,
    /// Length with its end.
    pub length: usize,
}

impl LinePlace {
    /// Where the next line begins.
    pub(super) fn end(self) -> u64 {
        self.start + self.length as u64
    }
}

/// One line that is not blank: a line that was set aside is.
pub(super) struct FileLine<'p> {
    /// Its number, from 1.
    pub(super) number: usize,
    /// The place of its first byte in the file.
    pub(super) start: u64,
    /// The line with its end.
    pub(super) bytes: &'p [u8],
}

/// Opens a file to read it; `None` if there is no such file.
///
/// # Errors
/// If it cannot be opened.
pub(super) fn open_if_there(path: &Path) -> Result<Option<File>> {
    match reading::open(path) {
        Ok(file) => Ok(Some(file)),
        Err(e) if e.kind() == ErrorKind::NotFound => Ok(None),
        Err(e) => Err(Error::file(path, "open", e)),
    }
}

impl<'p> Pieces<'p> {
    /// Opens a file; `None` if there is no such file.
    pub(super) fn open(path: &'p Path) -> Result<Option<Self>> {
        Ok(open_if_there(path)?.map(|file| Self {
            path,
            file,
            unread: Vec::new(),
            start: 0,
            lines: 0,
        }))
    }

    /// The next complete lines; `None` after the last. An incomplete last line is left out.
    ///
    /// # Errors
    /// If the file cannot be read, or a line is longer than any line of a run.
    pub(super) fn next(&mut self) -> Result<Option<Piece>> {
        let mut bytes = std::mem::take(&mut self.unread);
        loop {
            let searched = bytes.len();
            let read = (&self.file).take(PIECE_BYTES).read_to_end(&mut bytes);
            if read.map_err(|e| Error::file(self.path, "read", e))? == 0 {
                return Ok(None);
            }
            let end = bytes[searched..].iter().rposition(|byte| *byte == b'\n');
            if let Some(end) = end {
                self.unread = bytes.split_off(searched + end + 1);
                break;
            }
            if bytes.len() > MOST_LINE {
                let problem = format!(
                    "longer than {MOST_LINE} bytes, which no line of a run is; restore the file"
                );
                return Err(Error::line(self.path, self.lines + 1, problem));
            }
        }
        let piece = Piece {
            start: self.start,
            lines: self.lines,
            bytes,
        };
        self.start += piece.bytes.len() as u64;
        #[expect(clippy::naive_bytecount, reason = "fast enough without a crate")]
        let feeds = piece.bytes.iter().filter(|byte| **byte == b'\n').count();
        self.lines += feeds;
        Ok(Some(piece))
    }
}

impl Piece {
    /// The lines that are not blank, in order.
    pub(super) fn lines(&self) -> Vec<FileLine<'_>> {
        let (mut start, mut lines) = (self.start, Vec::new());
        let split = self.bytes.split_inclusive(|byte| *byte == b'\n');
        for (number, bytes) in (self.lines + 1..).zip(split) {
            if !bytes.trim_ascii().is_empty() {
                lines.push(FileLine {
                    number,
                    start,
                    bytes,
                });
            }
            start += bytes.len() as u64;
        }
        lines
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_has_a_largest_length() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("lines");
        let text = format!("one\n{}", "x".repeat(MOST_LINE + 1 + PIECE_BYTES as usize));
        std::fs::write(&path, text).unwrap();
        let mut pieces = Pieces::open(&path).unwrap().unwrap();
        assert!(pieces.next().unwrap().is_some());
        let error = pieces.next().err().unwrap().to_string();
        assert!(
            error.contains("line 2: longer than 67108864 bytes"),
            "{error}"
        );
    }

    #[test]
    fn all_complete_lines_are_read_with_their_places() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("lines");
        let long = "x".repeat(2 * PIECE_BYTES as usize);
        let mut text = format!("one\n   \n{long}\n");
        let numbers = (0..700_000).map(|number| format!("{number}\n"));
        text.extend(numbers);
        std::fs::write(&path, text.clone() + "incomplete").unwrap();
        let mut pieces = Pieces::open(&path).unwrap().unwrap();
        let (mut seen, mut parts) = (Vec::new(), 0);
        while let Some(piece) = pieces.next().unwrap() {
            parts += 1;
            for line in piece.lines() {
                let start = line.start as usize;
                assert_eq!(
                    &text.as_bytes()[start..start + line.bytes.len()],
                    line.bytes
                );
                seen.push(line.number);
            }
        }
        let expected = std::iter::once(1).chain(3..700_004);
        assert!(parts > 1 && seen.into_iter().eq(expected), "{parts}");
        assert!(Pieces::open(&folder.path().join("none")).unwrap().is_none());
    }
}
