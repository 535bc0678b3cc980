//! Files of one JSON object a line. A killed process may leave the last line incomplete.

use std::fs::{File, OpenOptions};
use std::io::{ErrorKind, Read, Seek, SeekFrom, Write};
use std::path::Path;

use rayon::prelude::*;
use serde::Serialize;
use serde::de::Error as _;

use super::pieces::{FileLine, LinePlace, Pieces};
use super::reread_record::RereadRecord;
use super::stored_trial::StoredTrial;
use super::trial_line::TrialLine;
use darkqa_ground::error::{Error, Result};
use darkqa_ground::files::reading;
use darkqa_ground::files::write_synced;
use darkqa_ground::types::{ImageFidelity, Record, RunQuestion, Thumbnail, Usage};
use darkqa_score::answers::record::{Detail, reread};

/// Appends lines to a file, which is created if it does not exist.
pub(super) fn append<T: Serialize + StoredLine>(path: &Path, values: &[T]) -> Result<File> {
    let lines = json_lines(path, values)?;
    let file = OpenOptions::new()
        .read(true)
        .append(true)
        .create(true)
        .open(path);
    let mut file = file.map_err(|e| Error::file(path, "write", e))?;
    repair::<T>(path, &file)?;
    file.write_all(&lines)
        .map_err(|e| Error::file(path, "write", e))?;
    Ok(file)
}

pub(super) fn json_lines<T: Serialize>(path: &Path, values: &[T]) -> Result<Vec<u8>> {
    let mut lines = Vec::new();
    for value in values {
        serde_json::to_writer(&mut lines, value)
            .map_err(|e| Error::file(path, "write", e.into()))?;
        lines.push(b'\n');
    }
    Ok(lines)
}

/// The complete lines of a file of a run; none if there is no such file.
pub(super) fn lines<T: StoredLine>(path: &Path) -> Result<Vec<T>> {
    let mut values = Vec::new();
    each_line(path, |value| values.push(value))?;
    Ok(values)
}

/// Hands over the complete lines of a file of a run in order, none if there is no such file. They are parsed on all cores, and the
/// file is not held in memory.
pub(super) fn each_line<T: StoredLine>(path: &Path, mut take: impl FnMut(T)) -> Result<()> {
    each_placed_line(path, |value, _| take(value))
}

/// Hands over the complete lines of a file as [`each_line`], each with its place.
pub(super) fn each_placed_line<T: StoredLine>(
    path: &Path,
    mut take: impl FnMut(T, LinePlace),
) -> Result<()> {
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

/// Moves the lines that are no `T` into the file `aside`, and leaves blanks in their place. So one damaged line costs its own trial
/// alone, and nothing of it is lost.
///
/// # Errors
/// If no line at all is a `T`: then it is another file.
pub(super) fn set_aside<T: StoredLine>(path: &Path, aside: &Path) -> Result<()> {
    let Some(mut pieces) = Pieces::open(path)? else {
        return Ok(());
    };
    let mut good = 0_usize;
    let mut bad: Vec<BadLine> = Vec::new();
    while let Some(piece) = pieces.next()? {
        let lines = piece.lines();
        let problem = |line: &FileLine<'_>| T::parse(line.bytes).err();
        let problems: Vec<Option<serde_json::Error>> = lines.par_iter().map(problem).collect();
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
    let mut file = OpenOptions::new()
        .write(true)
        .open(path)
        .map_err(|e| Error::file(path, "open", e))?;
    for bad in &bad {
        let blanks = vec![b' '; bad.line.len() - 1];
        file.seek(SeekFrom::Start(bad.start))
            .and_then(|_| file.write_all(&blanks))
            .map_err(|e| Error::file(path, "write", e))?;
    }
    file.sync_all().map_err(|e| Error::file(path, "write", e))?;
    let (what, whose) = match bad.len() {
        1 => (format!("line {} is", first.number), "its trial is"),
        n => (
            format!("{n} lines are, the first of them line {},", first.number),
            "their trials are",
        ),
    };
    tracing::warn!(
        "{}: {what} not {} ({}); moved to {}, and {whose} asked again; {}",
        path.display(),
        T::WHAT,
        first.problem,
        aside.display(),
        paid(&bad)
    );
    Ok(())
}

/// A line that cannot be read.
struct BadLine {
    /// Its number, from 1.
    number: usize,
    /// The place of its first byte in the file.
    start: u64,
    /// The line with its end.
    line: Vec<u8>,
    problem: String,
}

/// Tokens charged for the replies of damaged lines, as far as they can be read.
fn paid(bad: &[BadLine]) -> String {
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
        n => format!(
            "{} tokens were paid for {n} of them",
            known.iter().sum::<u64>()
        ),
    }
}

const A_RECORD: &str = "a record";
const REMEDY_OF_A_RECORD: &str = "the command that made the run, called again, sets single such lines aside and asks their trials again; \
                             or restore the file";

/// The content of one line in a file of a run.
pub(super) trait StoredLine: Sized + Send {
    /// The name in error messages, with its article.
    const WHAT: &str;
    /// Remedy for a damaged line.
    const REMEDY: &str =
        "the command that made the run, called again, makes the file again from its data";

    /// Parses a line, with or without its end.
    fn parse(line: &[u8]) -> serde_json::Result<Self>;
}

impl<D: Detail> StoredLine for Record<D> {
    const WHAT: &str = A_RECORD;
    const REMEDY: &str = REMEDY_OF_A_RECORD;

    fn parse(line: &[u8]) -> serde_json::Result<Self> {
        D::parse_record(line)
    }
}

impl<D: Detail> StoredLine for RereadRecord<D> {
    const WHAT: &str = A_RECORD;
    const REMEDY: &str = REMEDY_OF_A_RECORD;

    fn parse(line: &[u8]) -> serde_json::Result<Self> {
        reread(D::parse_record(line)?)
            .map(Self)
            .map_err(serde_json::Error::custom)
    }
}

impl StoredLine for StoredTrial {
    const WHAT: &str = A_RECORD;
    const REMEDY: &str = REMEDY_OF_A_RECORD;

    fn parse(line: &[u8]) -> serde_json::Result<Self> {
        serde_json::from_slice(line)
    }
}

impl StoredLine for TrialLine {
    const WHAT: &str = A_RECORD;
    const REMEDY: &str = REMEDY_OF_A_RECORD;

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

/// Whether a file has lines of a kind: one of the whole lines in its first `complete` bytes does, or without any whole line it begins as
/// an object.
fn is_of<T: StoredLine>(path: &Path, complete: u64) -> Result<bool> {
    let unreadable = |e| Error::file(path, "read", e);
    if complete == 0 {
        let mut first = [0];
        return Ok(reading::open(path)
            .and_then(|mut file| file.read(&mut first))
            .map_err(unreadable)?
            == 1
            && first == *b"{");
    }
    let Some(mut pieces) = Pieces::open(path)? else {
        return Ok(false);
    };
    let mut is_blank = true;
    while let Some(piece) = pieces.next()? {
        let lines = piece.lines();
        is_blank &= lines.is_empty();
        let mut lines = lines.iter();
        if lines.any(|line| T::parse(line.bytes).is_ok()) {
            return Ok(true);
        }
    }
    // All lines were set aside.
    Ok(is_blank)
}

/// Cuts off an incomplete last line: everything after the last line end.
///
/// # Errors
/// If the file does not look like one of this kind: no whole line parses, or there is none and the incomplete one does not begin as one.
/// Such a file is left unchanged.
pub(super) fn repair<T: StoredLine>(path: &Path, mut file: &File) -> Result<()> {
    const STEP: u64 = 64 * 1024;
    let unreadable = |e| Error::file(path, "read", e);
    let length = file.metadata().map_err(unreadable)?.len();
    let (mut end, mut complete) = (length, 0);
    while end > 0 && complete == 0 {
        let start = end.saturating_sub(STEP);
        let mut chunk = vec![0; (end - start) as usize];
        file.seek(SeekFrom::Start(start)).map_err(unreadable)?;
        file.read_exact(&mut chunk).map_err(unreadable)?;
        complete = chunk
            .iter()
            .rposition(|&byte| byte == b'\n')
            .map_or(0, |at| start + at as u64 + 1);
        end = start;
    }
    if complete == length {
        return Ok(());
    }
    if !is_of::<T>(path, complete)? {
        let problem = format!("not {}, and no other line is; {}", T::WHAT, T::REMEDY);
        let lines = "its last line, which has no end";
        return Err(Error::data(format!("{}, {lines}", path.display()), problem));
    }
    tracing::warn!(
        "{}: the last line was incomplete and has been removed; its trial is asked again",
        path.display()
    );
    file.set_len(complete)
        .map_err(|e| Error::file(path, "write", e))
}
