//! The places of files in a store's folder: [`StoreFolder`].

use std::fs::{self, File, OpenOptions};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::SystemTime;

use crate::files::folder_access::FolderAccess;
use crate::files::reading;
use crate::types::Digest;

/// Version of the layout, a folder of its own.
const VERSION: &str = "v1";
/// Ending of the name of an entry's file.
const ENTRY: &str = ".img";
/// Beginning of the name of a file that is not complete.
const UNFINISHED: &str = ".tmp-";

/// The folder of a store.
#[derive(Debug)]
pub(super) struct StoreFolder {
    /// Folder of this version's files.
    root: PathBuf,
    /// Who may enter it. It is made again if somebody deletes it.
    access: FolderAccess,
    /// Beginning of the names of this process's unfinished files: no other process, on this machine or another, has it.
    unfinished: String,
    /// Number of unfinished files so far.
    count: AtomicUsize,
}

/// A file in a store.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct StoredFile {
    pub(super) path: PathBuf,
    pub(super) kind: FileKind,
    /// Length in bytes.
    pub(super) bytes: u64,
    /// When it was last used, to a day.
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
        let plain = |letter: &char| letter.is_ascii_alphanumeric() || *letter == '-';
        let host: String = host.chars().filter(plain).take(64).collect();
        Self {
            root: folder.join(VERSION),
            access,
            unfinished: format!("{UNFINISHED}{host}-{}-", std::process::id()),
            count: AtomicUsize::new(0),
        }
    }

    /// The folder of this version's files.
    pub(super) fn root(&self) -> &Path {
        &self.root
    }

    /// Makes the folder.
    pub(super) fn make(&self) -> io::Result<()> {
        refuse_link(&self.root)?;
        self.access.create_io(&self.root)
    }

    /// The file of a key.
    pub(super) fn place(&self, key: &Digest) -> PathBuf {
        let name = key.to_string();
        let (folder, rest) = name.split_at(2);
        self.root.join(folder).join(format!("{rest}{ENTRY}"))
    }

    /// Writes the file of a key, completely or not at all. It is not forced to the disk, as it can be made again.
    pub(super) fn write(&self, key: &Digest, content: &[u8]) -> io::Result<()> {
        let place = self.place(key);
        let folder = place.parent().unwrap_or(&self.root);
        self.make()?;
        refuse_link(folder)?;
        self.access.create_io(folder)?;
        let number = self.count.fetch_add(1, Ordering::Relaxed);
        let unfinished = folder.join(format!("{}{number}", self.unfinished));
        let written = File::create_new(&unfinished)
            .and_then(|mut file| file.write_all(content))
            .and_then(|()| fs::rename(&unfinished, &place));
        if written.is_err() {
            // What remains is swept when it is old.
            let _ = fs::remove_file(&unfinished);
        }
        written
    }

    /// All files of the store; what is not of its form is left out. Files that vanish meanwhile are, too.
    ///
    /// # Errors
    /// If the folder cannot be read. One that does not exist has no files.
    pub(super) fn files(&self) -> io::Result<Vec<StoredFile>> {
        let mut files = Vec::new();
        let Some(folders) = found(fs::read_dir(&self.root))? else {
            return Ok(files);
        };
        for folder in folders {
            let folder = folder?;
            let is_folder = folder.file_type()?.is_dir();
            if !is_folder || !is_hexadecimal(&folder.file_name().to_string_lossy(), 2) {
                continue;
            }
            let Some(entries) = found(fs::read_dir(folder.path()))? else {
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

    /// The file that is locked while files are removed.
    pub(super) fn lock_file(&self) -> io::Result<File> {
        self.make()?;
        let mut options = OpenOptions::new();
        options.write(true).create(true).truncate(false);
        let path = self.root.join(".lock");
        refuse_link(&path)?;
        match reading::refuse_pipes(&path) {
            Err(e) if e.kind() != io::ErrorKind::NotFound => {
                Err(io::Error::new(e.kind(), format!(".lock: {e}")))
            }
            _ => options.open(path),
        }
    }
}

/// Refuses a link in a store, which may come from a stranger: what is written there would go elsewhere.
fn refuse_link(path: &Path) -> io::Result<()> {
    if path.is_symlink() {
        let problem = format!("{} is a link; delete it", path.display());
        return Err(io::Error::new(io::ErrorKind::InvalidInput, problem));
    }
    Ok(())
}

/// A file of a store; `None` for what is not one.
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
    Some(StoredFile {
        path: entry.path(),
        kind,
        bytes: data.len(),
        used: data.modified().ok()?,
    })
}

fn is_hexadecimal(text: &str, length: usize) -> bool {
    let digit = |byte: u8| byte.is_ascii_digit() || (b'a'..=b'f').contains(&byte);
    text.len() == length && text.bytes().all(digit)
}

/// A result, or `None` if the file or folder does not exist.
pub(super) fn found<T>(result: io::Result<T>) -> io::Result<Option<T>> {
    match result {
        Ok(value) => Ok(Some(value)),
        Err(e) if e.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(e) => Err(e),
    }
}
