//! A set in a ZIP file, read without unpacking the whole file: [`Archive`].
//!
//! Decompression of files up to a limit: [`decompress_gzip`], [`max_decompressed_size`].

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{self, BufReader, Read, Seek, SeekFrom};
use std::path::{Component, Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use flate2::read::MultiGzDecoder;
use tempfile::NamedTempFile;
use zip::ZipArchive;

use darkqa_base::error::{Error, Result};
use darkqa_base::files;
use darkqa_base::types::FrameId;

/// Maximum number of entries (chosen).
const MAX_ENTRIES: usize = 500_000;

/// Maximum length of the directory, in bytes (chosen). The shortest entry has 47 bytes and takes half a kilobyte in
/// memory.
const MAX_DIRECTORY_BYTES: u64 = 48 << 20;

/// Maximum length of an image, in bytes.
const MAX_IMAGE_BYTES: u64 = 1 << 30;

/// Maximum length of a text file other than a table, in bytes.
const MAX_TEXT_BYTES: u64 = 1 << 22;

/// A ZIP file with its directory in memory.
pub struct Archive {
    pub path: PathBuf,
    /// Index of each file, by its name.
    indices: BTreeMap<String, usize>,
    zip: Mutex<ZipArchive<BufReader<BoundedFile>>>,
}

/// A file with a limit for the bytes to read, to refuse huge directories.
struct BoundedFile {
    file: File,
    /// Number of bytes that may still be read.
    remaining: Arc<AtomicU64>,
}

impl Read for BoundedFile {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.file.read(buffer)?;
        let remaining = self.remaining.load(Ordering::Relaxed).saturating_sub(count as u64);
        self.remaining.store(remaining, Ordering::Relaxed);
        if remaining == 0 {
            return Err(io::Error::other("the directory is too long"));
        }
        Ok(count)
    }
}

impl Seek for BoundedFile {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.file.seek(to)
    }
}

impl std::fmt::Debug for Archive {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Archive({})", self.path.display())
    }
}

impl Archive {
    /// Opens a ZIP file and reads its directory.
    ///
    /// # Errors
    /// If it is not a ZIP file, or an entry is a link or has a path that is absolute or leads outside.
    pub fn open(path: &Path) -> Result<Self> {
        let file = files::open(path).map_err(|e| Error::file(path, "read", e))?;
        let remaining = Arc::new(AtomicU64::new(MAX_DIRECTORY_BYTES));
        let bounded = BoundedFile { file, remaining: Arc::clone(&remaining) };
        let opened = ZipArchive::new(BufReader::new(bounded));
        let count = opened.as_ref().map_or(0, ZipArchive::len);
        if count > MAX_ENTRIES || remaining.load(Ordering::Relaxed) == 0 {
            return Err(Error::data(
                path.display(),
                format_args!("more than {MAX_ENTRIES} entries, which are not read; unpack it, and name its folder"),
            ));
        }
        let mut zip = opened.map_err(|e| Error::data(path.display(), format_args!("not a whole ZIP file: {e}")))?;
        remaining.store(u64::MAX, Ordering::Relaxed);
        let mut indices = BTreeMap::new();
        for index in 0..zip.len() {
            let entry = zip.by_index_raw(index).map_err(|e| Error::data(path.display(), e))?;
            let name = entry.name().to_owned();
            if entry.is_symlink() || !is_inside(&name) {
                return Err(Error::data(
                    path.display(),
                    format_args!("the entry {name:?} leads out of the file, or is a link; such files are not read"),
                ));
            }
            if entry.is_file() {
                indices.insert(name, index);
            }
        }
        Ok(Self { path: path.to_owned(), indices, zip: Mutex::new(zip) })
    }

    /// Path of the ZIP file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Paths of all files that are not hidden.
    pub(super) fn files(&self) -> Vec<PathBuf> {
        self.indices
            .keys()
            .filter(|name| !name.split('/').any(|part| part.starts_with('.') || part == "__MACOSX"))
            .map(PathBuf::from)
            .collect()
    }

    /// True if the archive has a file with this name.
    pub fn has(&self, name: &str) -> bool {
        self.indices.contains_key(name)
    }

    /// Reads an image file.
    ///
    /// # Errors
    /// If it cannot be read or is longer than a gigabyte, whatever size the directory states.
    pub fn read_image(&self, name: &str) -> Result<Vec<u8>> {
        let mut bytes = Vec::new();
        self.copy(name, MAX_IMAGE_BYTES, &mut bytes)?;
        Ok(bytes)
    }

    /// Folders that have a file of this name, each with its last `/`; empty for the top level.
    pub fn folders_with(&self, file: &str) -> Vec<String> {
        let folders = self.indices.keys().filter_map(|name| name.strip_suffix(file));
        folders.filter(|folder| folder.is_empty() || folder.ends_with('/')).map(str::to_owned).collect()
    }

    /// Decompresses files to new paths, each given with its name. All together have a maximum length.
    ///
    /// # Errors
    /// If a file cannot be read or written, or the files are too long, whatever sizes the directory states.
    pub fn unpack(&self, files: impl Iterator<Item = (String, PathBuf)>) -> Result<()> {
        let compressed = fs::metadata(&self.path).map_err(|e| Error::file(&self.path, "read", e))?.len();
        let mut remaining = max_decompressed_size(compressed);
        for (name, path) in files {
            let mut file = File::create_new(&path).map_err(|e| Error::file(&path, "write", e))?;
            remaining -= self.copy(&name, remaining, &mut file)?;
        }
        Ok(())
    }

    /// Decompresses a file to a temporary copy.
    pub(super) fn decompress(&self, name: &str) -> Result<NamedTempFile> {
        let mut file = NamedTempFile::new().map_err(|e| Error::file(std::env::temp_dir(), "write", e))?;
        let max = max_decompressed_size(self.compressed_size(name)?);
        self.copy(name, max, &mut file)?;
        Ok(file)
    }

    /// Reads a short text file.
    pub fn read_text(&self, name: &str) -> Result<String> {
        let mut bytes = Vec::new();
        self.copy(name, MAX_TEXT_BYTES, &mut bytes)?;
        Ok(String::from_utf8_lossy(&bytes).into_owned())
    }

    /// Path of a file in the archive, for messages.
    fn place(&self, name: &str) -> String {
        format!("{}, {name}", self.path.display())
    }

    /// Index of a file.
    fn index(&self, name: &str) -> Result<usize> {
        self.indices.get(name).copied().ok_or_else(|| Error::data(self.place(name), "no such file in it"))
    }

    /// Compressed size of a file, in bytes.
    fn compressed_size(&self, name: &str) -> Result<u64> {
        let index = self.index(name)?;
        let mut zip = self.zip.lock().unwrap_or_else(PoisonError::into_inner);
        let entry = zip.by_index_raw(index).map_err(|e| Error::data(self.place(name), e))?;
        Ok(entry.compressed_size())
    }

    /// Decompresses a file of at most `max` bytes; returns its length.
    fn copy(&self, name: &str, max: u64, to: &mut impl std::io::Write) -> Result<u64> {
        let index = self.index(name)?;
        let mut zip = self.zip.lock().unwrap_or_else(PoisonError::into_inner);
        let entry = zip.by_index(index).map_err(|e| Error::data(self.place(name), e))?;
        let copied =
            std::io::copy(&mut entry.take(max.saturating_add(1)), to).map_err(|e| Error::data(self.place(name), e))?;
        if copied > max {
            let problem = format_args!("longer than {} MB", max >> 20);
            return Err(Error::data(self.place(name), problem));
        }
        Ok(copied)
    }

    /// Finds the image of a path in the data, relative to a folder of the archive. Returns its full name.
    ///
    /// # Errors
    /// If the path leads outside the archive, or there is no such file.
    pub fn find(&self, base: &Path, spelled: &str) -> Result<FrameId, String> {
        let mut parts: Vec<String> = Vec::new();
        for part in base.join(spelled).components() {
            let is_inside = match part {
                Component::CurDir => true,
                Component::Normal(name) => {
                    parts.push(name.to_string_lossy().into_owned());
                    true
                }
                Component::ParentDir => parts.pop().is_some(),
                Component::RootDir | Component::Prefix(_) => false,
            };
            if !is_inside {
                return Err(format!("{spelled:?} lies outside {}", self.path.display()));
            }
        }
        let name = parts.join("/");
        if self.has(&name) {
            return Ok(FrameId(name));
        }
        Err(format!("no such file: {name:?} in {}", self.path.display()))
    }
}

/// True if the name of an entry is a relative path that stays inside the archive.
fn is_inside(name: &str) -> bool {
    let mut parts = Path::new(name).components();
    !name.contains(['\\', '\0']) && parts.all(|part| matches!(part, Component::Normal(_) | Component::CurDir))
}

/// Maximum decompressed size of a file with this compressed size, in bytes: a gigabyte, or 200 times the compressed
/// size (chosen). No table compresses better, but decompression bombs do.
fn max_decompressed_size(compressed: u64) -> u64 {
    compressed.saturating_mul(200).max(1 << 30)
}

/// Decompresses a file to a temporary copy. A compressed file does not allow to read images at their offsets.
pub(super) fn decompress_gzip(path: &Path) -> Result<NamedTempFile> {
    let file = files::open(path).map_err(|e| Error::file(path, "read", e))?;
    let mut copy = NamedTempFile::new().map_err(|e| Error::file(std::env::temp_dir(), "write", e))?;
    let max = max_decompressed_size(file.metadata().map_or(0, |metadata| metadata.len()));
    let mut content = MultiGzDecoder::new(BufReader::new(file)).take(max + 1);
    let copied = std::io::copy(&mut content, &mut copy)
        .map_err(|e| Error::data(path.display(), format_args!("cannot be unpacked: {e}")))?;
    if copied > max {
        let problem = format_args!(
            "unpacks to more than {} MB, which no table of its length does; unpack it and name the file in it",
            max >> 20
        );
        return Err(Error::data(path.display(), problem));
    }
    Ok(copy)
}
