//! Reader of the lines of a file in pieces, so that the file may be larger than the memory: [`Pieces`].

use std::fs::File;
use std::io::{ErrorKind, Read, Seek as _, SeekFrom};
use std::path::Path;

use darkqa_base::error::{Error, Result};
use darkqa_base::files;

/// The size of a piece in bytes; larger only for a longer line. Chosen: enough lines for all cores.
const PIECE_BYTES: u64 = 4 << 20;

/// Size limit of a line, in bytes. Chosen: a thumbnail with crops of all objects has a hundredth of it.
const MAX_LINE_BYTES: usize = 64 << 20;

/// A reader that returns some complete lines of a file at a time.
pub(super) struct Pieces<'p> {
    path: &'p Path,
    file: File,
    /// The beginning of the next line, which was read with the last piece.
    rest: Vec<u8>,
    /// The byte offset of the next line in the file.
    start: u64,
    /// The number of lines before the next line.
    lines: usize,
}

/// A place between two lines of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct LineStart {
    /// Number of bytes before it.
    pub(super) bytes: u64,
    /// Number of lines before it.
    pub(super) lines: usize,
}

/// Some complete lines of a file.
pub(super) struct LineBlock {
    bytes: Vec<u8>,
    /// The byte offset of the first line in the file.
    start: u64,
    /// The number of lines before the first line.
    lines: usize,
}

/// The place of a line in its file.
#[derive(Debug, Clone, Copy)]
pub struct LinePlace {
    /// Byte offset of the line.
    pub start: u64,
    /// Length with the line end, in bytes.
    pub length: usize,
}

impl LinePlace {
    /// Byte offset of the next line.
    pub(super) fn end(self) -> u64 {
        self.start + self.length as u64
    }
}

/// One line that is not blank. Lines that were set aside are blank.
pub(super) struct FileLine<'p> {
    /// The line number, from 1.
    pub(super) number: usize,
    /// The byte offset of the line in the file.
    pub(super) start: u64,
    /// The line with its end.
    pub(super) bytes: &'p [u8],
}

/// Opens a file for reading; `None` if it does not exist.
///
/// # Errors
/// If it cannot be opened.
pub(super) fn open_if_exists(path: &Path) -> Result<Option<File>> {
    match files::open(path) {
        Ok(file) => Ok(Some(file)),
        Err(e) if e.kind() == ErrorKind::NotFound => Ok(None),
        Err(e) => Err(Error::file(path, "open", e)),
    }
}

impl<'p> Pieces<'p> {
    /// Opens a file; `None` if it does not exist.
    pub(super) fn open(path: &'p Path) -> Result<Option<Self>> {
        Self::open_at(path, LineStart::default())
    }

    /// Opens a file to read the lines after a place; `None` if it does not exist.
    pub(super) fn open_at(path: &'p Path, from: LineStart) -> Result<Option<Self>> {
        let Some(mut file) = open_if_exists(path)? else {
            return Ok(None);
        };
        file.seek(SeekFrom::Start(from.bytes)).map_err(|e| Error::file(path, "read", e))?;
        Ok(Some(Self { path, file, rest: Vec::new(), start: from.bytes, lines: from.lines }))
    }

    /// The place after the lines that were read.
    pub(super) fn place(&self) -> LineStart {
        LineStart { bytes: self.start, lines: self.lines }
    }

    /// The next complete lines; `None` after the last. An incomplete last line is skipped.
    ///
    /// # Errors
    /// If the file cannot be read, or a line is longer than any line of a run.
    pub(super) fn next(&mut self) -> Result<Option<LineBlock>> {
        let mut bytes = std::mem::take(&mut self.rest);
        loop {
            let searched = bytes.len();
            let read = (&self.file)
                .take(PIECE_BYTES)
                .read_to_end(&mut bytes)
                .map_err(|e| Error::file(self.path, "read", e))?;
            if read == 0 {
                return Ok(None);
            }
            let end = bytes[searched..].iter().rposition(|byte| *byte == b'\n');
            if let Some(end) = end {
                self.rest = bytes.split_off(searched + end + 1);
                break;
            }
            if bytes.len() > MAX_LINE_BYTES {
                let problem =
                    format!("longer than {MAX_LINE_BYTES} bytes, which no line of a run is; restore the file");
                return Err(Error::line(self.path, self.lines + 1, problem));
            }
        }
        let piece = LineBlock { start: self.start, lines: self.lines, bytes };
        self.start += piece.bytes.len() as u64;
        #[expect(clippy::naive_bytecount, reason = "fast enough without a crate")]
        let line_ends = piece.bytes.iter().filter(|byte| **byte == b'\n').count();
        self.lines += line_ends;
        Ok(Some(piece))
    }
}

impl LineBlock {
    /// All bytes of the lines, blank ones included.
    pub(super) fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// The lines that are not blank, in order.
    pub(super) fn lines(&self) -> Vec<FileLine<'_>> {
        let (mut start, mut lines) = (self.start, Vec::new());
        let split = self.bytes.split_inclusive(|byte| *byte == b'\n');
        for (number, bytes) in (self.lines + 1..).zip(split) {
            if !bytes.trim_ascii().is_empty() {
                lines.push(FileLine { number, start, bytes });
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
    fn too_long_lines_are_errors() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("lines");
        let text = format!("one\n{}", "x".repeat(MAX_LINE_BYTES + 1 + PIECE_BYTES as usize));
        std::fs::write(&path, text).unwrap();
        let mut pieces = Pieces::open(&path).unwrap().unwrap();
        assert!(pieces.next().unwrap().is_some());
        let error = pieces.next().err().unwrap().to_string();
        assert!(error.contains("line 2: longer than 67108864 bytes"), "{error}");
    }

    #[test]
    fn complete_lines_are_read_with_their_places() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("lines");
        let long = "x".repeat(2 * PIECE_BYTES as usize);
        let mut text = format!("one\n   \n{long}\n");
        text.extend((0..700_000).map(|number| format!("{number}\n")));
        std::fs::write(&path, text.clone() + "incomplete").unwrap();
        let mut pieces = Pieces::open(&path).unwrap().unwrap();
        let (mut seen, mut parts) = (Vec::new(), 0);
        while let Some(piece) = pieces.next().unwrap() {
            parts += 1;
            for line in piece.lines() {
                let start = line.start as usize;
                assert_eq!(&text.as_bytes()[start..start + line.bytes.len()], line.bytes);
                seen.push(line.number);
            }
        }
        let expected = std::iter::once(1).chain(3..700_004);
        assert!(parts > 1 && seen.into_iter().eq(expected), "{parts}");
        assert!(Pieces::open(&folder.path().join("none")).unwrap().is_none());
    }
}
