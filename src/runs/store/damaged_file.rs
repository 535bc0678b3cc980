//! Repair of damaged files other than the records of a run: readable lines are kept, and the damaged file is renamed.

use std::fs;
use std::io::{self, Read as _, Seek as _, SeekFrom};
use std::path::{Path, PathBuf};

use rayon::iter::{IntoParallelRefIterator as _, ParallelIterator as _};
use serde::Serialize;

use super::lines::{StoredLine, json_lines};
use super::pieces::Pieces;
use darkqa_base::error::{Error, Result};
use darkqa_base::files::{reading, write_synced};

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
    let mut file = reading::open(path)?;
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
