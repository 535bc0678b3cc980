//! Files in the folder of a store: [`StoreFolder`].
//!
//! Eviction of old entries from a store: [`sweep`].
//!
//! Table of the content of a store ([`listing`]), and removal of its images ([`clear`]).

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, Read as _, Seek as _, SeekFrom, Write as _};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, SystemTime};

use super::entry::{Shown, facts_at_end};
use darkqa_base::error::{Error, Result};
use darkqa_base::files::{self, FolderAccess};
use darkqa_base::types::Digest;
use darkqa_base::types::text::counted;

/// Version of the layout, as the name of its folder.
const VERSION: &str = "v1";

/// File extension of entries.
const ENTRY: &str = ".img";

/// Prefix of the names of incomplete files.
const UNFINISHED: &str = ".tmp-";

/// The folder of a store.
#[derive(Debug)]
pub(super) struct StoreFolder {
    /// Folder of this version's files.
    root: PathBuf,
    /// Permissions with which the folder is created, at first and after it was deleted.
    access: FolderAccess,
    /// Prefix of the names of this process's incomplete files, unique among the processes of all machines.
    unfinished_prefix: String,
    /// Number of incomplete files created so far.
    unfinished_count: AtomicUsize,
}

/// A file in a store.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct StoredFile {
    pub(super) path: PathBuf,
    pub(super) kind: FileKind,
    /// Length in bytes.
    pub(super) bytes: u64,
    /// Time of the last use, accurate to a day.
    pub(super) used: SystemTime,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum FileKind {
    Entry,
    Unfinished,
}

impl StoreFolder {
    pub(super) fn new(folder: &Path, access: FolderAccess) -> Self {
        let host = fs::read_to_string("/proc/sys/kernel/hostname").unwrap_or_default();
        let host: String =
            host.chars().filter(|letter| letter.is_ascii_alphanumeric() || *letter == '-').take(64).collect();
        Self {
            root: folder.join(VERSION),
            access,
            unfinished_prefix: format!("{UNFINISHED}{host}-{}-", std::process::id()),
            unfinished_count: AtomicUsize::new(0),
        }
    }

    /// Folder of this version's files.
    pub(super) fn root(&self) -> &Path {
        &self.root
    }

    /// Creates the folder if it is missing.
    pub(super) fn create(&self) -> io::Result<()> {
        refuse_link(&self.root)?;
        self.access.create_io(&self.root)
    }

    /// Path of the file of a key.
    pub(super) fn path(&self, key: &Digest) -> PathBuf {
        let name = key.to_string();
        let (folder, rest) = name.split_at(2);
        self.root.join(folder).join(format!("{rest}{ENTRY}"))
    }

    /// Writes the file of a key atomically, without flushing it to the disk, because it can be computed again.
    pub(super) fn write(&self, key: &Digest, content: &[u8]) -> io::Result<()> {
        let path = self.path(key);
        let folder = path.parent().unwrap_or(&self.root);
        self.create()?;
        refuse_link(folder)?;
        self.access.create_io(folder)?;
        let number = self.unfinished_count.fetch_add(1, Ordering::Relaxed);
        let unfinished = folder.join(format!("{}{number}", self.unfinished_prefix));
        let result = File::create_new(&unfinished)
            .and_then(|mut file| file.write_all(content))
            .and_then(|()| fs::rename(&unfinished, &path));
        if result.is_err() {
            // If removal fails, a later sweep removes the file.
            let _ = fs::remove_file(&unfinished);
        }
        result
    }

    /// All files of the store, sorted by path. Foreign files are left out, as are files that are deleted while the
    /// folder is read. A missing folder has no files.
    ///
    /// # Errors
    /// If the folder cannot be read.
    pub(super) fn files(&self) -> io::Result<Vec<StoredFile>> {
        let mut files = Vec::new();
        let Some(folders) = if_exists(fs::read_dir(&self.root))? else {
            return Ok(files);
        };
        for folder in folders {
            let folder = folder?;
            let is_folder = folder.file_type()?.is_dir();
            if !is_folder || !is_hexadecimal(&folder.file_name().to_string_lossy(), 2) {
                continue;
            }
            let Some(entries) = if_exists(fs::read_dir(folder.path()))? else {
                continue;
            };
            for entry in entries {
                files.extend(stored_file(&entry?));
            }
        }
        // The same order on every file system.
        files.sort_by(|a, b| a.path.cmp(&b.path));
        Ok(files)
    }

    /// Opens the file that is locked while files are removed.
    pub(super) fn lock_file(&self) -> io::Result<File> {
        self.create()?;
        let mut options = OpenOptions::new();
        options.write(true).create(true).truncate(false);
        let path = self.root.join(".lock");
        refuse_link(&path)?;
        match files::refuse_pipes(&path) {
            Err(e) if e.kind() != io::ErrorKind::NotFound => Err(io::Error::new(e.kind(), format!(".lock: {e}"))),
            _ => options.open(path),
        }
    }
}

/// Refuses a symbolic link, with which another user could redirect writes to other folders.
fn refuse_link(path: &Path) -> io::Result<()> {
    if path.is_symlink() {
        let problem = format!("{} is a link; delete it", path.display());
        return Err(io::Error::new(io::ErrorKind::InvalidInput, problem));
    }
    Ok(())
}

/// The file of a store for a directory entry; `None` for foreign files.
fn stored_file(entry: &fs::DirEntry) -> Option<StoredFile> {
    let name = entry.file_name().to_string_lossy().into_owned();
    let stem = name.strip_suffix(ENTRY);
    let kind = if stem.is_some_and(|stem| is_hexadecimal(stem, 62)) {
        FileKind::Entry
    } else if name.starts_with(UNFINISHED) {
        FileKind::Unfinished
    } else {
        return None;
    };
    let data = entry.metadata().ok().filter(fs::Metadata::is_file)?;
    Some(StoredFile { path: entry.path(), kind, bytes: data.len(), used: data.modified().ok()? })
}

fn is_hexadecimal(text: &str, length: usize) -> bool {
    text.len() == length && text.bytes().all(|byte| matches!(byte, b'0'..=b'9' | b'a'..=b'f'))
}

/// Turns the error about a missing file or folder into `None`.
pub(super) fn if_exists<T>(result: io::Result<T>) -> io::Result<Option<T>> {
    match result {
        Ok(value) => Ok(Some(value)),
        Err(e) if e.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(e) => Err(e),
    }
}

/// Time since the last use after which an image may be evicted from a full store; chosen. Images used more recently
/// stay even if new ones then find no room: every model goes through all frames in the same order, so a store that
/// evicted the oldest image of a larger set would never contain the next one.
const UNUSED: Duration = Duration::from_hours(14 * 24);

/// Age from which on an incomplete file counts as left behind by a killed process; chosen.
const ABANDONED: Duration = Duration::from_hours(24);

/// Result of a sweep.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct SweepResult {
    /// Bytes in the store afterwards.
    pub(super) bytes: u64,
    /// Images that were removed.
    pub(super) evicted: usize,
}

/// Removes abandoned files, and the least recently used of the unused images while the store has more than `max_bytes`.
/// While another process is sweeping, the bytes are only counted.
///
/// # Errors
/// If the folder cannot be read.
pub(super) fn sweep(folder: &StoreFolder, max_bytes: u64, now: SystemTime) -> io::Result<SweepResult> {
    let mut files = folder.files()?;
    let bytes = files.iter().map(|file| file.bytes).sum();
    let mut result = SweepResult { bytes, evicted: 0 };
    let lock = folder.lock_file()?;
    match lock.try_lock() {
        Err(TryLockError::WouldBlock) => return Ok(result),
        // Some network shares have no locks, and two processes may remove the same files without harm.
        Ok(()) | Err(TryLockError::Error(_)) => {}
    }
    files.sort_by(|a, b| (a.used, &a.path).cmp(&(b.used, &b.path)));
    for file in &files {
        let age = now.duration_since(file.used).unwrap_or_default();
        let is_removable = match file.kind {
            FileKind::Unfinished => age > ABANDONED,
            FileKind::Entry => result.bytes > max_bytes && age > UNUSED,
        };
        if is_removable && remove(file) {
            result.bytes -= file.bytes;
            result.evicted += usize::from(file.kind == FileKind::Entry);
        }
    }
    Ok(result)
}

/// Removes a file; true if it no longer exists.
fn remove(file: &StoredFile) -> bool {
    match fs::remove_file(&file.path) {
        Ok(()) => true,
        Err(e) => e.kind() == io::ErrorKind::NotFound,
    }
}

/// Number of bytes read from the end of a file for its facts; chosen (facts take less than 4 kB).
const TAIL: u64 = 16 << 10;

/// Limits of the age classes in the table, in days.
const AGES: [u64; 3] = [1, 7, 14];

/// Number of images, their size, and the time that they took to compute.
#[derive(Debug, Clone, Copy, Default)]
struct Sum {
    images: usize,
    bytes: u64,
    milliseconds: u64,
}

impl Sum {
    fn add(&mut self, bytes: u64, milliseconds: u64) {
        self.images += 1;
        self.bytes += bytes;
        self.milliseconds += milliseconds;
    }

    fn line(&self, what: &str) -> String {
        let (megabytes, seconds) = (self.bytes as f64 / 1e6, self.milliseconds as f64 / 1e3);
        let images = self.images;
        format!("{images:>9} {megabytes:>11.1} {seconds:>13.1}  {what}\n")
    }
}

/// Table of the images of a store, by description and by time since the last use.
///
/// # Errors
/// If the folder is not a store, or cannot be read.
pub fn listing(folder: &Path) -> Result<String> {
    let (files, now) = (files(folder)?, SystemTime::now());
    let (mut all, mut by_shown) = (Sum::default(), BTreeMap::<Option<Shown>, Sum>::new());
    let mut by_age = [Sum::default(); AGES.len() + 1];
    let mut unfinished = 0;
    for file in &files {
        if file.kind == FileKind::Unfinished {
            unfinished += 1;
            continue;
        }
        let facts = facts(file);
        let (shown, milliseconds) = match facts {
            Some(facts) => (Some(facts.shown), facts.milliseconds),
            None => (None, 0),
        };
        all.add(file.bytes, milliseconds);
        let sum = by_shown.entry(shown).or_default();
        sum.add(file.bytes, milliseconds);
        let age = now.duration_since(file.used).unwrap_or_default();
        let age_class = AGES.iter().position(|days| age < Duration::from_hours(24 * days)).unwrap_or(AGES.len());
        by_age[age_class].add(file.bytes, milliseconds);
    }
    let mut text = String::from("    files          MB  s to make it\n");
    for (shown, sum) in &by_shown {
        text += &sum.line(
            &shown
                .as_ref()
                .map_or_else(|| "damaged, or of another version of the program".to_owned(), ToString::to_string),
        );
    }
    for (age_class, sum) in by_age.iter().enumerate().filter(|(_, sum)| sum.images > 0) {
        text += &sum.line(&match AGES.get(age_class) {
            Some(age) => format!("used less than {} ago", counted(*age as usize, "day")),
            None => format!("not used for {} days", AGES[AGES.len() - 1]),
        });
    }
    text += &all.line(&format!("in all, in {}", folder.display()));
    if unfinished > 0 {
        let _ = writeln!(
            text,
            "{unfinished} unfinished: being written, or left by a killed process and removed after a day"
        );
    }
    Ok(text)
}

/// Removes all images of a store, and returns a message with their number. Foreign files stay.
///
/// # Errors
/// If the folder is not a store, or a file cannot be removed.
pub fn clear(folder: &Path) -> Result<String> {
    let mut sum = Sum::default();
    for file in files(folder)? {
        match fs::remove_file(&file.path) {
            Ok(()) => sum.add(file.bytes, 0),
            Err(e) if e.kind() == io::ErrorKind::NotFound => {}
            Err(e) => return Err(Error::file(&file.path, "remove", e)),
        }
    }
    Ok(format!("{}: {} removed ({:.1} MB)\n", folder.display(), counted(sum.images, "file"), sum.bytes as f64 / 1e6))
}

/// Files of the store in a folder.
fn files(folder: &Path) -> Result<Vec<StoredFile>> {
    let store = StoreFolder::new(folder, FolderAccess::Private);
    if !store.root().is_dir() {
        let problem = "no image store: the folder that --images-cache named is expected";
        return Err(Error::data(folder.display(), problem));
    }
    store.files().map_err(|e| Error::file(store.root(), "read", e))
}

/// Facts of an entry, read without its image; `None` if the entry is damaged.
fn facts(file: &StoredFile) -> Option<super::EntryFacts> {
    let mut content = files::open(&file.path).ok()?;
    let start = file.bytes.saturating_sub(TAIL);
    content.seek(SeekFrom::Start(start)).ok()?;
    let mut tail = Vec::new();
    content.read_to_end(&mut tail).ok()?;
    facts_at_end(&tail, file.bytes).map(|(facts, _)| facts)
}

#[cfg(test)]
mod tests {
    use super::*;
    use darkqa_base::files::FolderAccess;
    use darkqa_base::types::Digest;

    fn key(day: u64) -> Digest {
        Digest::from_bytes(&day.to_le_bytes())
    }

    /// Sweeps a store with files of 100 bytes that were last used this number of days ago; returns the days of the
    /// remaining files.
    fn days_after_sweep(days: &[u64], max_bytes: u64) -> Vec<u64> {
        let place = tempfile::tempdir().unwrap();
        let folder = StoreFolder::new(place.path(), FolderAccess::Private);
        let now = SystemTime::now();
        for day in days {
            folder.write(&key(*day), &[0; 100]).unwrap();
            let file = fs::File::options().write(true).open(folder.path(&key(*day))).unwrap();
            let used = now - Duration::from_hours(24 * day);
            file.set_modified(used).unwrap();
        }
        let result = sweep(&folder, max_bytes, now).unwrap();
        let left: Vec<u64> = days.iter().copied().filter(|day| folder.path(&key(*day)).exists()).collect();
        assert_eq!(result.bytes, 100 * left.len() as u64);
        assert_eq!(result.evicted, days.len() - left.len());
        left
    }

    #[test]
    fn oldest_unused_images_are_evicted_as_needed() {
        assert_eq!(days_after_sweep(&[0, 1, 13], 100), [0, 1, 13]);
        assert_eq!(days_after_sweep(&[40, 20, 3], 300), [40, 20, 3]);
        assert_eq!(days_after_sweep(&[20, 40, 3, 30], 200), [20, 3]);
        assert_eq!(days_after_sweep(&[20, 40, 3], 0), [3]);
    }

    #[test]
    fn abandoned_files_are_removed_and_foreign_ones_stay() {
        let place = tempfile::tempdir().unwrap();
        let folder = StoreFolder::new(place.path(), FolderAccess::Private);
        folder.write(&Digest::from_bytes(b"a"), &[0; 9]).unwrap();
        let path = folder.path(&Digest::from_bytes(b"a"));
        let inside = path.parent().unwrap();
        for name in [".tmp-other-1-0", ".tmp-other-2-0", "notes.txt"] {
            fs::write(inside.join(name), b"123").unwrap();
        }
        let later = SystemTime::now() + Duration::from_hours(25);
        let fresh = fs::File::options().write(true).open(inside.join(".tmp-other-2-0")).unwrap();
        fresh.set_modified(later).unwrap();
        assert_eq!(sweep(&folder, 1000, later).unwrap().bytes, 9 + 3);
        assert!(!inside.join(".tmp-other-1-0").exists());
        assert!(inside.join(".tmp-other-2-0").exists());
        assert!(inside.join("notes.txt").exists());
    }

    #[test]
    fn no_files_are_removed_while_another_process_sweeps() {
        let place = tempfile::tempdir().unwrap();
        let folder = StoreFolder::new(place.path(), FolderAccess::Private);
        folder.write(&Digest::from_bytes(b"a"), &[0; 9]).unwrap();
        let later = SystemTime::now() + UNUSED + ABANDONED;
        let lock = folder.lock_file().unwrap();
        lock.lock().unwrap();
        assert_eq!(sweep(&folder, 0, later).unwrap().bytes, 9);
        drop(lock);
        assert_eq!(sweep(&folder, 0, later).unwrap(), SweepResult { bytes: 0, evicted: 1 });
    }
}
