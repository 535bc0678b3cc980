//! Files in the folder of a store: [`StoreFolder`].

use std::fs::{self, File, OpenOptions};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::SystemTime;

use crate::files::folder_access::FolderAccess;
use crate::files::reading;
use crate::types::Digest;

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
        match reading::refuse_pipes(&path) {
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
