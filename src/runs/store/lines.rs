//! Files with one JSON object per line. A killed process may leave the last line incomplete.

use std::fs::{File, OpenOptions};
use std::io::{self, ErrorKind, Read, Seek, SeekFrom, Write};
use std::path::Path;

use rayon::prelude::*;
use serde::Serialize;
use serde::de::Error as _;

use super::pieces::{LinePlace, Pieces};
use super::reread_record::RereadRecord;
use super::stored_trial::StoredTrial;
use super::trial_line::TrialLine;
use darkqa_base::error::{Error, Result};
use darkqa_base::files::reading;
use darkqa_base::files::write_synced;
use darkqa_base::types::{ImageFidelity, Record, RunQuestion, Thumbnail, Usage};
use darkqa_score::answers::record::{Detail, reread};

/// Appends lines to a file, which is created if it does not exist.
pub(super) fn append<T: Serialize + StoredLine>(path: &Path, values: &[T]) -> Result<File> {
    let lines = json_lines(path, values)?;
    let mut file = OpenOptions::new()
        .read(true)
        .append(true)
        .create(true)
        .open(path)
        .map_err(|e| Error::file(path, "write", e))?;
    repair::<T>(path, &file)?;
    file.write_all(&lines).map_err(|e| Error::file(path, "write", e))?;
    Ok(file)
}

pub(super) fn json_lines<T: Serialize>(path: &Path, values: &[T]) -> Result<Vec<u8>> {
    let mut lines = Vec::new();
    for value in values {
        serde_json::to_writer(&mut lines, value).map_err(|e| Error::file(path, "write", e.into()))?;
        lines.push(b'\n');
    }
    Ok(lines)
}

/// The complete lines of a file; empty if the file does not exist.
pub(super) fn lines<T: StoredLine>(path: &Path) -> Result<Vec<T>> {
    let mut values = Vec::new();
    each_line(path, |value| values.push(value))?;
    Ok(values)
}

/// Calls `take` with each complete line of a file in order; with none if the file does not exist. Lines are parsed on
/// all cores, and the whole file is never in memory.
pub(super) fn each_line<T: StoredLine>(path: &Path, mut take: impl FnMut(T)) -> Result<()> {
    each_placed_line(path, |value, _| take(value))
}

/// Calls `take` with each complete line as [`each_line`] does, and with its place.
pub(super) fn each_placed_line<T: StoredLine>(path: &Path, mut take: impl FnMut(T, LinePlace)) -> Result<()> {
    let Some(mut pieces) = Pieces::open(path)? else {
        return Ok(());
    };
    while let Some(piece) = pieces.next()? {
        let lines = piece.lines();
        let parsed: Vec<serde_json::Result<T>> = lines
            .par_iter()
            .map(|line| {
                let line = line.bytes.strip_suffix(b"\n").unwrap_or(line.bytes);
                T::parse(line)
            })
            .collect();
        for (line, value) in lines.iter().zip(parsed) {
            let value = value.map_err(|e| {
                let problem = format!("not {}: {e}; {}", T::WHAT, T::REMEDY);
                Error::line(path, line.number, problem)
            })?;
            let (start, length) = (line.start, line.bytes.len());
            take(value, LinePlace { start, length });
        }
    }
    Ok(())
}

/// Moves the lines that are not a `T` to the file `aside`, and replaces them by spaces. A damaged line thus affects
/// only its own trial, and its content is kept.
///
/// # Errors
/// If no line is a `T`, so that this is probably another file.
pub(super) fn set_aside<T: StoredLine>(path: &Path, aside: &Path) -> Result<()> {
    let Some(mut pieces) = Pieces::open(path)? else {
        return Ok(());
    };
    let mut good = 0_usize;
    let mut bad: Vec<BadLine> = Vec::new();
    while let Some(piece) = pieces.next()? {
        let lines = piece.lines();
        let problems: Vec<Option<serde_json::Error>> =
            lines.par_iter().map(|line| T::parse(line.bytes).err()).collect();
        for (line, problem) in lines.iter().zip(problems) {
            match problem {
                None => good += 1,
                Some(e) => bad.push(BadLine {
                    number: line.number,
                    start: line.start,
                    line: line.bytes.to_owned(),
                    problem: e.to_string(),
                }),
            }
        }
    }
    let Some(first) = bad.first() else {
        return Ok(());
    };
    if good == 0 {
        let problem = format!("not {}: {}; {}", T::WHAT, first.problem, T::REMEDY);
        return Err(Error::line(path, first.number, problem));
    }
    let mut lines = match reading::read(aside) {
        Err(e) if e.kind() == ErrorKind::NotFound => Vec::new(),
        read => read.map_err(|e| Error::file(aside, "read", e))?,
    };
    lines.extend(bad.iter().flat_map(|bad| &bad.line));
    write_synced(aside, &lines)?;
    let mut file = OpenOptions::new().write(true).open(path).map_err(|e| Error::file(path, "open", e))?;
    for bad in &bad {
        let blanks = vec![b' '; bad.line.len() - 1];
        file.seek(SeekFrom::Start(bad.start))
            .and_then(|_| file.write_all(&blanks))
            .map_err(|e| Error::file(path, "write", e))?;
    }
    file.sync_all().map_err(|e| Error::file(path, "write", e))?;
    let (what, whose) = match bad.len() {
        1 => (format!("line {} is", first.number), "its trial is"),
        n => (format!("{n} lines are, the first of them line {},", first.number), "their trials are"),
    };
    tracing::warn!(
        "{}: {what} not {} ({}); moved to {}, and {whose} asked again; {}",
        path.display(),
        T::WHAT,
        first.problem,
        aside.display(),
        cost_in_words(&bad)
    );
    Ok(())
}

/// A line that cannot be parsed.
struct BadLine {
    /// The line number, from 1.
    number: usize,
    /// The byte offset of the line in the file.
    start: u64,
    /// The line with its end.
    line: Vec<u8>,
    problem: String,
}

/// The tokens charged for the replies of damaged lines in words, if they can be read.
fn cost_in_words(bad: &[BadLine]) -> String {
    let known: Vec<u64> = bad
        .iter()
        .filter_map(|bad| {
            let value: serde_json::Value = serde_json::from_slice(&bad.line).ok()?;
            let usage: Usage = serde_json::from_value(value.get("usage")?.clone()).ok()?;
            usage.total()
        })
        .collect();
    match known.len() {
        0 => "its cost cannot be read".to_owned(),
        n if n == bad.len() => format!("{} tokens were paid for it", known.iter().sum::<u64>()),
        n => format!("{} tokens were paid for {n} of them", known.iter().sum::<u64>()),
    }
}

const A_RECORD: &str = "a record";
const RECORD_REMEDY: &str = "the command that made the run, called again, sets single such lines aside and asks their trials again; \
                             or restore the file";

/// The content of one line in a file of a run.
pub(super) trait StoredLine: Sized + Send {
    /// The name in error messages, with an article.
    const WHAT: &str;
    /// Remedy for a damaged line.
    const REMEDY: &str = "the command that made the run, called again, makes the file again from its data";

    /// Parses a line, with or without its end.
    fn parse(line: &[u8]) -> serde_json::Result<Self>;
}

impl<D: Detail> StoredLine for Record<D> {
    const WHAT: &str = A_RECORD;
    const REMEDY: &str = RECORD_REMEDY;

    fn parse(line: &[u8]) -> serde_json::Result<Self> {
        D::parse_record(line)
    }
}

impl<D: Detail> StoredLine for RereadRecord<D> {
    const WHAT: &str = A_RECORD;
    const REMEDY: &str = RECORD_REMEDY;

    fn parse(line: &[u8]) -> serde_json::Result<Self> {
        reread(D::parse_record(line)?).map(Self).map_err(serde_json::Error::custom)
    }
}

impl StoredLine for StoredTrial {
    const WHAT: &str = A_RECORD;
    const REMEDY: &str = RECORD_REMEDY;

    fn parse(line: &[u8]) -> serde_json::Result<Self> {
        serde_json::from_slice(line)
    }
}

impl StoredLine for TrialLine {
    const WHAT: &str = A_RECORD;
    const REMEDY: &str = RECORD_REMEDY;

    fn parse(line: &[u8]) -> serde_json::Result<Self> {
        serde_json::from_slice(line)
    }
}

impl StoredLine for RunQuestion {
    const WHAT: &str = "a question";

    fn parse(line: &[u8]) -> serde_json::Result<Self> {
        serde_json::from_slice(line)
    }
}

impl StoredLine for Thumbnail {
    const WHAT: &str = "a thumbnail";

    fn parse(line: &[u8]) -> serde_json::Result<Self> {
        serde_json::from_slice(line)
    }
}

impl StoredLine for ImageFidelity {
    const WHAT: &str = "the fidelity of an image";

    fn parse(line: &[u8]) -> serde_json::Result<Self> {
        serde_json::from_slice(line)
    }
}

/// True if a file seems to contain lines of a type: one of the complete lines in its first `complete` bytes can be
/// parsed, or without complete lines the file begins with `{`.
fn has_lines_of<T: StoredLine>(path: &Path, complete: u64) -> Result<bool> {
    if complete == 0 {
        let mut first = [0];
        let read =
            reading::open(path).and_then(|mut file| file.read(&mut first)).map_err(|e| Error::file(path, "read", e))?;
        return Ok(read == 1 && first == *b"{");
    }
    let Some(mut pieces) = Pieces::open(path)? else {
        return Ok(false);
    };
    let mut is_blank = true;
    while let Some(piece) = pieces.next()? {
        let lines = piece.lines();
        is_blank &= lines.is_empty();
        if lines.iter().any(|line| T::parse(line.bytes).is_ok()) {
            return Ok(true);
        }
    }
    // If all lines are blank, they were set aside.
    Ok(is_blank)
}

/// Cuts off an incomplete last line: everything after the last line end.
///
/// # Errors
/// If the file seems to be of another kind: no complete line can be parsed, or without complete lines it does not begin
/// with `{`. Such a file is not changed.
pub(super) fn repair<T: StoredLine>(path: &Path, file: &File) -> Result<()> {
    let length = file.metadata().map_err(|e| Error::file(path, "read", e))?.len();
    let complete = complete_length(file, length).map_err(|e| Error::file(path, "read", e))?;
    if complete == length {
        return Ok(());
    }
    if !has_lines_of::<T>(path, complete)? {
        let problem = format!("not {}, and no other line is; {}", T::WHAT, T::REMEDY);
        let lines = "its last line, which has no end";
        return Err(Error::data(format!("{}, {lines}", path.display()), problem));
    }
    tracing::warn!("{}: the last line was incomplete and has been removed; its trial is asked again", path.display());
    file.set_len(complete).map_err(|e| Error::file(path, "write", e))
}

/// The number of bytes up to and including the last line end; 0 without a line end.
fn complete_length(mut file: &File, length: u64) -> io::Result<u64> {
    const STEP: u64 = 64 * 1024;
    let mut end = length;
    while end > 0 {
        let start = end.saturating_sub(STEP);
        let mut chunk = vec![0; (end - start) as usize];
        file.seek(SeekFrom::Start(start))?;
        file.read_exact(&mut chunk)?;
        if let Some(at) = chunk.iter().rposition(|&byte| byte == b'\n') {
            return Ok(start + at as u64 + 1);
        }
        end = start;
    }
    Ok(0)
}
