//! Files that are written completely or not at all, by [`write()`] and [`write_synced`], and readers of folders
//! ([`entries`]), files ([`open`]), text files ([`text`], [`settings`]) and files of one JSON object a line
//! ([`json_lines`]).
//!
//! Each reader has a size limit and refuses pipes and devices: a downloaded data set may contain a link to `/dev/zero`,
//! which would fill the memory, or a pipe, which would block for ever.
//!
//! Access rights of the folders that the program creates: [`FolderAccess`].
//!
//! Calls of third-party decoders whose panics become errors: [`guarded`].
//!
//! A decoder should return an error for every broken file. Some panic instead: the OpenEXR decoder on a few damaged
//! blocks of lossy compression (found by mutated files). One file must not end a run.

use std::cell::Cell;
use std::ffi::OsStr;
use std::fs::{self, File};
use std::io::{self, BufRead as _, BufReader, BufWriter, Read as _, Write as _};
use std::panic::{self, AssertUnwindSafe};
use std::path::{Path, PathBuf};
use std::sync::Once;

use serde::de::DeserializeOwned;

use crate::error::{Error, Result};

/// The ending of a file's name until the file is complete.
pub const UNFINISHED: &str = ".part";

/// Writes a file that can be regenerated: a killed process leaves the old or the new content, a power cut may lose
/// both.
///
/// # Errors
/// If the folder cannot be created or the file cannot be written.
pub fn write(path: &Path, content: &[u8]) -> Result<()> {
    replace(path, content, |_| Ok(()))
}

/// Writes a file and forces it to the disk before it returns.
///
/// # Errors
/// If the folder cannot be created or the file cannot be written.
pub fn write_synced(path: &Path, content: &[u8]) -> Result<()> {
    replace(path, content, File::sync_all)
}

/// True for the name of an unfinished file, which a killed process may leave behind.
pub fn is_unfinished(name: &OsStr) -> bool {
    name.to_string_lossy().ends_with(UNFINISHED)
}

/// Writes a file through `write`, and forces it to the disk before it returns. A file with the same content is left
/// untouched.
///
/// # Errors
/// If the folder cannot be created, the file cannot be written, or `write` fails.
pub fn write_with(path: &Path, write: impl FnOnce(&mut dyn io::Write) -> Result<()>) -> Result<()> {
    create_folder(path)?;
    let unfinished = unfinished(path);
    let mut file = create_new(&unfinished).map(BufWriter::new).map_err(|e| Error::file(&unfinished, "write", e))?;
    write(&mut file)?;
    file.flush().and_then(|()| file.get_ref().sync_all()).map_err(|e| Error::file(&unfinished, "write", e))?;
    drop(file);
    if has_same_content(path, &unfinished).unwrap_or(false) {
        return fs::remove_file(&unfinished).map_err(|e| Error::file(&unfinished, "write", e));
    }
    fs::rename(&unfinished, path).map_err(|e| Error::file(path, "write", e))
}

fn has_same_content(one: &Path, other: &Path) -> io::Result<bool> {
    if fs::metadata(one)?.len() != fs::metadata(other)?.len() {
        return Ok(false);
    }
    let [mut one, mut other] = [BufReader::new(File::open(one)?), BufReader::new(File::open(other)?)];
    loop {
        let (a, b) = (one.fill_buf()?, other.fill_buf()?);
        let length = a.len().min(b.len());
        if length == 0 {
            return Ok(a.len() == b.len());
        }
        if a[..length] != b[..length] {
            return Ok(false);
        }
        one.consume(length);
        other.consume(length);
    }
}

/// The temporary path of a file until it is complete: a hidden file in the same folder.
pub fn unfinished(path: &Path) -> PathBuf {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    path.with_file_name(format!(".{name}{UNFINISHED}"))
}

/// Creates an empty file, in place of a file that a killed process left there. A link at the path is replaced, not
/// followed.
///
/// # Errors
/// If the path is a folder, or the file cannot be created.
pub fn create_new(path: &Path) -> io::Result<File> {
    match fs::remove_file(path) {
        Err(e) if e.kind() != io::ErrorKind::NotFound => return Err(e),
        _ => {}
    }
    File::options().write(true).create_new(true).open(path)
}

fn create_folder(path: &Path) -> Result<()> {
    match path.parent() {
        Some(folder) => fs::create_dir_all(folder).map_err(|e| Error::file(folder, "create", e)),
        None => Ok(()),
    }
}

// tempfile's `persist` is not used: its random name leaves a further file after each killed process, and its file mode
// denies access to colleagues who share a results folder.
fn replace(path: &Path, content: &[u8], sync: impl FnOnce(&File) -> io::Result<()>) -> Result<()> {
    create_folder(path)?;
    let unfinished = unfinished(path);
    create_new(&unfinished)
        .and_then(|mut file| {
            file.write_all(content)?;
            sync(&file)
        })
        .map_err(|e| Error::file(&unfinished, "write", e))?;
    fs::rename(&unfinished, path).map_err(|e| Error::file(path, "write", e))
}

/// Size limit of a settings file, in bytes. Chosen: people write a few kilobytes.
const MAX_SETTINGS_BYTES: u64 = 1 << 20;

/// Size limit of one line of JSON, in bytes. Chosen: a question with its choices has less than a kilobyte.
const MAX_LINE_BYTES: u64 = 4 << 20;

/// Size limit of any other file that is read at once, in bytes. Chosen: the largest published lists of questions have a
/// tenth of it.
const MAX_BYTES: u64 = 1 << 30;

/// Error message for text in UTF-16 or an older encoding.
pub const NOT_UTF8: &str = "not UTF-8; save the file as UTF-8";

/// The paths in a folder, sorted by name.
///
/// # Errors
/// If the folder cannot be read.
pub fn entries(folder: &Path) -> Result<Vec<PathBuf>> {
    let mut paths = fs::read_dir(folder)
        .and_then(|entries| entries.map(|entry| entry.map(|entry| entry.path())).collect::<io::Result<Vec<PathBuf>>>())
        .map_err(|e| Error::file(folder, "read", e))?;
    paths.sort();
    Ok(paths)
}

/// Opens a file for reading. Pipes and devices are refused, because they may never end or block for ever, unless the
/// path itself is in `/dev` or `/proc`: `/dev/stdin`, or the shell's `<(command)`.
///
/// # Errors
/// If the file cannot be opened.
pub fn open(path: &Path) -> io::Result<File> {
    refuse_pipes(path)?;
    File::open(path)
}

/// Checks a path as [`open`] does, for callers that open the file in another way.
///
/// # Errors
/// If the path is a pipe or a device, or does not exist.
pub fn refuse_pipes(path: &Path) -> io::Result<()> {
    let kind = fs::metadata(path)?.file_type();
    let is_named = path.starts_with("/dev") || path.starts_with("/proc");
    if kind.is_file() || kind.is_dir() || is_named {
        return Ok(());
    }
    let problem = "this is a pipe or a device, not a file; put a file there";
    Err(io::Error::new(io::ErrorKind::InvalidInput, problem))
}

/// The bytes of a file that [`open`] opens.
///
/// # Errors
/// If the file cannot be read, or is larger than 1 GB.
pub fn read(path: &Path) -> io::Result<Vec<u8>> {
    read_at_most(path, MAX_BYTES)
}

/// The text of a file that [`open`] opens.
///
/// # Errors
/// If the file cannot be read, is larger than 1 GB, or is not UTF-8.
pub fn read_to_string(path: &Path) -> io::Result<String> {
    read(path).and_then(utf8)
}

fn read_at_most(path: &Path, most: u64) -> io::Result<Vec<u8>> {
    let file = open(path)?;
    let length = file.metadata()?.len();
    // The length is checked before memory is reserved: a sparse file takes little room on the disk but all of it in
    // memory.
    if length > most {
        return Err(too_large(most));
    }
    let mut bytes = Vec::with_capacity(length as usize);
    if file.take(most + 1).read_to_end(&mut bytes)? as u64 > most {
        return Err(too_large(most));
    }
    Ok(bytes)
}

fn too_large(most: u64) -> io::Error {
    let problem = format!("larger than {most} bytes, which no file of its kind needs");
    io::Error::new(io::ErrorKind::InvalidData, problem)
}

fn utf8(bytes: Vec<u8>) -> io::Result<String> {
    String::from_utf8(bytes).map_err(|e| io::Error::new(io::ErrorKind::InvalidData, e))
}

/// The bytes of a file.
///
/// # Errors
/// If the file cannot be read, or is larger than 1 GB.
pub fn bytes(path: &Path) -> Result<Vec<u8>> {
    at_most(path, MAX_BYTES)
}

/// The text of a file.
///
/// # Errors
/// If the file cannot be read, is larger than 1 GB, or is not UTF-8.
pub fn text(path: &Path) -> Result<String> {
    read_to_string(path).map_err(|e| Error::file(path, "read", e))
}

/// The text of a settings file.
///
/// # Errors
/// If the file cannot be read, is larger than 1 MB, or is not UTF-8.
pub fn settings(path: &Path) -> Result<String> {
    read_at_most(path, MAX_SETTINGS_BYTES).and_then(utf8).map_err(|e| Error::file(path, "read", e))
}

/// Reads a file of at most `most` bytes.
///
/// # Errors
/// If the file cannot be read or is larger.
pub fn at_most(path: &Path, most: u64) -> Result<Vec<u8>> {
    read_at_most(path, most).map_err(|e| Error::file(path, "read", e))
}

/// The value in a JSON file.
///
/// # Errors
/// If the file cannot be read or does not hold such a value.
pub fn json<T: DeserializeOwned>(path: &Path) -> Result<T> {
    serde_json::from_str(&text(path)?).map_err(|e| Error::data(path.display(), e))
}

/// Error message for text that is not JSON because it is not UTF-8, or has a `NaN` or `Infinity`, as Python writes
/// them; `None` for other faults.
#[must_use]
pub fn json_problem(bytes: &[u8], error: &serde_json::Error) -> Option<&'static str> {
    if str::from_utf8(bytes).is_err() {
        return Some(NOT_UTF8);
    }
    let line = bytes.split(|byte| *byte == b'\n').nth(error.line() - 1)?;
    let rest = line.get(error.column().saturating_sub(1)..)?;
    let rest = rest.strip_prefix(b"-").unwrap_or(rest);
    (rest.starts_with(b"NaN") || rest.starts_with(b"Infinity"))
        .then_some("NaN or Infinity, which JSON does not have; write null in its place")
}

/// The objects of a file with their line numbers, counted from 1; empty lines and a byte order mark are skipped.
///
/// # Errors
/// If the file cannot be read, or a line is longer than 4 MB or does not hold such an object; the error names the line.
pub fn json_lines<T: DeserializeOwned>(path: &Path) -> Result<Vec<(usize, T)>> {
    let mut file = open(path).map(BufReader::new).map_err(|e| Error::file(path, "read", e))?;
    let (mut values, mut line) = (Vec::new(), Vec::new());
    for number in 1.. {
        line.clear();
        let read = (&mut file)
            .take(MAX_LINE_BYTES + 1)
            .read_until(b'\n', &mut line)
            .map_err(|e| Error::file(path, "read", e))?;
        if read == 0 {
            break;
        }
        if line.len() as u64 > MAX_LINE_BYTES {
            let problem = format!("longer than {MAX_LINE_BYTES} bytes, which no line of its kind needs");
            return Err(Error::line(path, number, problem));
        }
        let text = match number {
            1 => line.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(&line),
            _ => &line[..],
        };
        if !text.trim_ascii().is_empty() {
            let value = serde_json::from_slice(text.trim_ascii_end()).map_err(|e| match json_problem(text, &e) {
                Some(problem) => Error::line(path, number, problem),
                None => Error::json_line(path, number, &e),
            })?;
            values.push((number, value));
        }
    }
    Ok(values)
}

/// The access of other users of this machine to a new folder.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum FolderAccess {
    /// No access, because a run contains replies and pictures of homes. Nobody else can enter the folder, so its files
    /// are private whatever their modes are, and `chmod` of the folder alone shares them later.
    #[default]
    Private,
    /// The system's default for new folders (`umask`).
    Shared,
}

impl FolderAccess {
    /// The access for a value of the flag `--shared`.
    pub fn new(is_shared: bool) -> Self {
        if is_shared { Self::Shared } else { Self::Private }
    }

    /// Creates a folder. Missing parents get the system's default mode; an existing folder keeps its mode.
    ///
    /// # Errors
    /// If it cannot be created.
    pub fn create(self, path: &Path) -> Result<()> {
        self.create_io(path).map_err(|e| Error::file(path, "create", e))
    }

    /// Creates a folder as [`create`](Self::create) does, but returns the bare error of the operating system.
    ///
    /// # Errors
    /// If it cannot be created.
    pub fn create_io(self, path: &Path) -> io::Result<()> {
        if let Some(above) = path.parent() {
            fs::create_dir_all(above)?;
        }
        let mut builder = fs::DirBuilder::new();
        #[cfg(unix)]
        if self == Self::Private {
            std::os::unix::fs::DirBuilderExt::mode(&mut builder, 0o700);
        }
        match builder.create(path) {
            Err(e) if !path.is_dir() => Err(e),
            _ => Ok(()),
        }
    }
}

thread_local! {
    /// Whether a decoder runs in this thread, so that its panic is not printed.
    static GUARDED: Cell<bool> = const { Cell::new(false) };
}

/// Runs a decoder and returns its result, or an error if it panics. Callers use nothing that the decoder worked on
/// after a panic.
pub fn guarded<T>(decode: impl FnOnce() -> Result<T, String>) -> Result<T, String> {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let print = panic::take_hook();
        panic::set_hook(Box::new(move |info| {
            if !GUARDED.get() {
                print(info);
            }
        }));
    });
    let outer = GUARDED.replace(true);
    let decoded = panic::catch_unwind(AssertUnwindSafe(decode));
    GUARDED.set(outer);
    decoded.unwrap_or_else(|_| {
        let problem = "not a whole file: its decoder broke down; copy or export it again";
        Err(problem.to_owned())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_name_the_file_and_its_limit() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("list.jsonl");
        let text = format!("\u{feff}1\n\n  2 \r\n{}3\n", " ".repeat(MAX_LINE_BYTES as usize));
        fs::write(&path, &text).unwrap();
        let error = json_lines::<u8>(&path).unwrap_err().to_string();
        assert!(error.contains("line 4: longer than 4194304 bytes"), "{error}");
        fs::write(&path, text.trim_end_matches(['3', '\n', ' '])).unwrap();
        assert_eq!(json_lines::<u8>(&path).unwrap(), [(1, 1), (3, 2)]);
        assert!(settings(&path).is_ok());
        fs::write(&path, "1\nNaN\n").unwrap();
        let error = json_lines::<u8>(&path).unwrap_err().to_string();
        assert!(error.contains("line 2: NaN or Infinity, which JSON does not have"), "{error}");
        fs::write(&path, b"\xFF\xFE1\0\n\0").unwrap();
        let error = json_lines::<u8>(&path).unwrap_err().to_string();
        assert!(error.ends_with("line 1: not UTF-8; save the file as UTF-8"), "{error}");
        fs::write(&path, vec![b' '; 1 + MAX_SETTINGS_BYTES as usize]).unwrap();
        let error = settings(&path).unwrap_err().to_string();
        assert!(error.contains("list.jsonl") && error.contains("larger than 1048576 bytes"), "{error}");
        fs::write(&path, b"\xff").unwrap();
        let error = super::text(&path).unwrap_err().to_string();
        assert!(error.to_lowercase().contains("utf-8"), "{error}");
    }

    #[test]
    fn a_panic_is_an_error() {
        let broken = guarded(|| -> Result<u8, String> { panic!("in a decoder") });
        assert!(broken.unwrap_err().contains("broke down"));
        assert_eq!(guarded(|| Ok(1)), Ok(1));
        assert_eq!(guarded(|| Err::<u8, _>("no".to_owned())), Err("no".to_owned()));
        let nested = guarded(|| {
            let inner = guarded(|| -> Result<u8, String> { panic!("in an inner decoder") });
            inner.or(Ok(2))
        });
        assert_eq!(nested, Ok(2));
    }
}

#[cfg(all(test, unix))]
mod unix_tests {
    use super::*;

    #[test]
    fn links_are_replaced_not_followed() {
        let folder = tempfile::tempdir().unwrap();
        let [private, link] = ["private", "new.part"].map(|name| folder.path().join(name));
        fs::write(&private, "private").unwrap();
        std::os::unix::fs::symlink(&private, &link).unwrap();
        let mut file = create_new(&link).unwrap();
        file.write_all(b"new").unwrap();
        assert_eq!(fs::read(&private).unwrap(), b"private");
        assert_eq!(fs::read(&link).unwrap(), b"new");
        assert!(!link.is_symlink());
    }
}

#[cfg(all(test, unix))]
mod folder_tests {
    use std::os::unix::fs::PermissionsExt as _;

    use super::*;

    #[test]
    fn only_new_private_folders_get_a_mode() {
        let folder = tempfile::tempdir().unwrap();
        let [runs, private, shared, file] = ["runs", "runs/a", "runs/b", "file"].map(|name| folder.path().join(name));
        FolderAccess::Private.create(&private).unwrap();
        assert_eq!(mode(&private), 0o700);
        FolderAccess::Shared.create(&shared).unwrap();
        // Both have the system's default mode.
        assert_eq!(mode(&shared), mode(&runs));
        FolderAccess::Private.create(&runs).unwrap();
        assert_eq!(mode(&shared), mode(&runs));
        fs::write(&file, "").unwrap();
        assert!(FolderAccess::Private.create(&file).is_err());
    }

    fn mode(path: &Path) -> u32 {
        fs::metadata(path).unwrap().permissions().mode() & 0o777
    }
}
