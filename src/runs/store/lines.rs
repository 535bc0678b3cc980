//! Files with one JSON object per line. A killed process may leave the last line incomplete.
//!
//! Repair of damaged files other than the records of a run: readable lines are kept, and the damaged file is renamed.

use std::fs::{self, File, OpenOptions};
use std::io::{self, ErrorKind, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use rayon::iter::{IntoParallelRefIterator as _, ParallelIterator as _};
use serde::Serialize;
use serde::de::Error as _;

use super::pieces::{LinePlace, LineStart, Pieces};
use super::stored_trial::{RereadRecord, StoredTrial, TrialLine};
use darkqa_base::error::{Error, Result};
use darkqa_base::files::{self, write_synced};
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
pub(super) fn each_placed_line<T: StoredLine>(path: &Path, take: impl FnMut(T, LinePlace)) -> Result<()> {
    each_placed_line_after(path, LineStart::default(), |_| {}, take).map(drop)
}

/// Calls `take` with each complete line after a place, and `see` with all bytes of these lines, in order. Returns the
/// place after them.
pub(super) fn each_placed_line_after<T: StoredLine>(
    path: &Path,
    from: LineStart,
    mut see: impl FnMut(&[u8]),
    mut take: impl FnMut(T, LinePlace),
) -> Result<LineStart> {
    let Some(mut pieces) = Pieces::open_at(path, from)? else {
        return Ok(from);
    };
    while let Some(piece) = pieces.next()? {
        see(piece.bytes());
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
    Ok(pieces.place())
}

/// Moves the lines after a place that are not a `T` to the file `aside`, and replaces them by spaces. A damaged line
/// thus affects only its own trial, and its content is kept.
///
/// # Errors
/// If no line is a `T`, so that this is probably another file.
pub(super) fn set_aside<T: StoredLine>(path: &Path, from: LineStart, aside: &Path) -> Result<()> {
    let Some(mut pieces) = Pieces::open_at(path, from)? else {
        return Ok(());
    };
    let mut good = from.lines;
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
    let mut lines = match files::read(aside) {
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
        let record = D::parse_record(line)?;
        let stored = record.detail.reading();
        let record = reread(record).map_err(serde_json::Error::custom)?;
        Ok(Self { is_changed: record.detail.reading() != stored, record })
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
            files::open(path).and_then(|mut file| file.read(&mut first)).map_err(|e| Error::file(path, "read", e))?;
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

/// Calls `take` with each readable line of a file in order; with none if the file does not exist. Returns a description
/// of the damage, or `None` if every line is readable. A last line without a line end counts as damage.
pub(super) fn each_readable_line<T: StoredLine>(path: &Path, mut take: impl FnMut(T)) -> Option<String> {
    let mut broken = Vec::new();
    let read = each_parsed_line(path, |number, line| match line {
        Some(line) => take(line),
        None => broken.push(number),
    });
    match (read, &broken[..]) {
        (Err(e), _) => Some(e.to_string()),
        (Ok(LastLine::Whole), []) => None,
        (Ok(LastLine::Cut), []) => Some(format!("{}: the last line is cut", path.display())),
        (Ok(_), [number]) => Some(format!("{}, line {number}: not {}", path.display(), T::WHAT)),
        (Ok(_), [first, ..]) => Some(format!(
            "{}: {} lines are not {}, the first of them line {first}",
            path.display(),
            broken.len(),
            T::WHAT
        )),
    }
}

/// State of the last line of a file.
enum LastLine {
    /// With a line end.
    Whole,
    /// Without a line end.
    Cut,
}

/// Calls `take` with the number and the content of each line of a file; the content is `None` if it cannot be parsed.
fn each_parsed_line<T: StoredLine>(path: &Path, mut take: impl FnMut(usize, Option<T>)) -> Result<LastLine> {
    let Some(mut pieces) = Pieces::open(path)? else {
        return Ok(LastLine::Whole);
    };
    while let Some(piece) = pieces.next()? {
        let lines = piece.lines();
        let parsed: Vec<Option<T>> = lines
            .par_iter()
            .map(|line| {
                let bytes = line.bytes.strip_suffix(b"\n").unwrap_or(line.bytes);
                T::parse(bytes).ok()
            })
            .collect();
        for (line, parsed) in lines.iter().zip(parsed) {
            take(line.number, parsed);
        }
    }
    match last_byte(path).map_err(|e| Error::file(path, "read", e))? {
        None | Some(b'\n') => Ok(LastLine::Whole),
        Some(_) => Ok(LastLine::Cut),
    }
}

/// The last byte of a file; `None` if it is empty.
fn last_byte(path: &Path) -> io::Result<Option<u8>> {
    let mut file = files::open(path)?;
    if file.metadata()?.len() == 0 {
        return Ok(None);
    }
    let mut last = [0];
    file.seek(SeekFrom::End(-1))?;
    file.read_exact(&mut last)?;
    Ok(Some(last[0]))
}

/// Maximum number of damaged files of one name that are kept; chosen. After that, the first of them is replaced.
const MAX_ASIDE: usize = 1000;

/// Renames a damaged file within its folder and returns the new path.
///
/// # Errors
/// If it cannot be renamed.
pub fn set_file_aside(path: &Path) -> Result<PathBuf> {
    let aside = (1..=MAX_ASIDE)
        .map(|number| path_aside(path, number))
        .find(|path| fs::symlink_metadata(path).is_err())
        .unwrap_or_else(|| path_aside(path, 1));
    fs::rename(path, &aside).map_err(|e| Error::file(path, "rename", e))?;
    Ok(aside)
}

/// The path of a damaged file with this number, from 1.
fn path_aside(path: &Path, number: usize) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(match number {
        1 => ".damaged".to_owned(),
        _ => format!(".damaged-{number}"),
    });
    PathBuf::from(name)
}

/// Replaces a damaged file of notes about images by its readable lines, with a warning. Returns true if the file is
/// damaged, missing or empty.
pub(super) fn repair_notes<T: Serialize + StoredLine>(path: &Path) -> bool {
    let mut count = 0_usize;
    let Some(damage) = each_readable_line(path, |_: T| count += 1) else {
        return count == 0;
    };
    let mut lines: Vec<T> = Vec::with_capacity(count);
    each_readable_line(path, |line| lines.push(line));
    match replace(path, &lines) {
        Ok(()) => tracing::warn!("{damage}; its missing lines are computed again from the data"),
        Err(e) => tracing::warn!("{damage}; {e}; the report lacks it"),
    }
    true
}

/// Replaces a file by these lines; anything else at its path is set aside.
fn replace<T: Serialize>(path: &Path, lines: &[T]) -> Result<()> {
    if !path.is_file() {
        set_file_aside(path)?;
    }
    write_synced(path, &json_lines(path, lines)?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use darkqa_base::types::ImageFidelity;

    #[test]
    fn readable_lines_are_kept() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("fidelity.jsonl");
        assert_eq!(count_readable(&path), (0, None), "a missing file is not damaged");
        let image = "0".repeat(64);
        let good = format!(r#"{{"frame":"f","condition":"L3-ev","image":"{image}","psnr":20.0,"ssim":0.5}}"#);
        for (text, lines, damage) in [
            (String::new(), 0, None),
            (format!("{good}\n"), 1, None),
            (format!("{good}\n{good}"), 1, Some("the last line is cut")),
            ("\u{0}#".to_owned(), 0, Some("the last line is cut")),
            (format!("{good}\n\u{0}\u{1}\n{good}\n"), 2, Some("line 2: not the fidelity")),
            (format!("{{}}\n[]\n{good}\n"), 1, Some("2 lines are not the fidelity")),
        ] {
            fs::write(&path, &text).unwrap();
            let (readable, found) = count_readable(&path);
            assert_eq!(readable, lines, "{text:?}");
            assert_eq!(found.is_some(), damage.is_some(), "{text:?}: {found:?}");
            let words = found.unwrap_or_default();
            assert!(words.contains(damage.unwrap_or_default()), "{words}");
        }
        let aside = set_file_aside(&path).unwrap();
        assert!(aside.exists() && !path.exists());
        fs::create_dir(&path).unwrap();
        assert!(count_readable(&path).1.is_some());
    }

    /// The number of readable lines of a file, and its damage.
    fn count_readable(path: &Path) -> (usize, Option<String>) {
        let mut count = 0;
        let damage = each_readable_line(path, |_: ImageFidelity| count += 1);
        (count, damage)
    }
}
