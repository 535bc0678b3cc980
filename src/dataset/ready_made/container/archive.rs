//! A set in a ZIP file, which is not unpacked: [`Archive`].

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom};
use std::path::{Component, Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use tempfile::NamedTempFile;
use zip::ZipArchive;

use super::packed::most_unpacked;
use crate::error::{Error, Result};
use crate::files::reading;
use crate::types::FrameId;

/// The maximum number of entries; chosen.
const MOST_ENTRIES: usize = 500_000;

/// The maximum length of the directory, in bytes; chosen. The shortest entry has 47 bytes there and takes half a kilobyte in memory.
const MOST_DIRECTORY: u64 = 48 << 20;

/// The maximum length of an image, in bytes.
const LONGEST_IMAGE: u64 = 1 << 30;

/// A ZIP file whose directory is read.
pub(crate) struct Archive {
    pub(in crate::dataset::ready_made) path: PathBuf,
    /// The place of each file, by its name.
    names: BTreeMap<String, usize>,
    zip: Mutex<ZipArchive<BufReader<BoundedFile>>>,
}

/// A file of which a bounded number of bytes is read while its directory is.
struct BoundedFile {
    file: File,
    /// The bytes that may still be read.
    left: Arc<AtomicU64>,
}

impl Read for BoundedFile {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.file.read(buffer)?;
        let left = self.left.load(Ordering::Relaxed);
        let left = left.saturating_sub(count as u64);
        self.left.store(left, Ordering::Relaxed);
        if left == 0 {
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
    /// The directory of a file.
    ///
    /// # Errors
    /// If it is no ZIP file, or a name in it is absolute, leads out of it or is a link.
    pub(super) fn open(path: &Path) -> Result<Self> {
        let wrong = |problem: String| Error::data(path.display(), problem);
        let file = reading::open(path).map_err(|e| Error::file(path, "read", e))?;
        let left = Arc::new(AtomicU64::new(MOST_DIRECTORY));
        let bounded = BoundedFile {
            file,
            left: Arc::clone(&left),
        };
        let opened = ZipArchive::new(BufReader::new(bounded));
        let count = opened.as_ref().map_or(0, ZipArchive::len);
        if count > MOST_ENTRIES || left.load(Ordering::Relaxed) == 0 {
            return Err(wrong(format!(
                "more than {MOST_ENTRIES} entries, which are not read; unpack it, and name its folder"
            )));
        }
        let mut zip = opened.map_err(|e| wrong(format!("not a whole ZIP file: {e}")))?;
        left.store(u64::MAX, Ordering::Relaxed);
        let mut names = BTreeMap::new();
        for at in 0..zip.len() {
            let entry = zip.by_index_raw(at).map_err(|e| wrong(e.to_string()))?;
            let name = entry.name().to_owned();
            if entry.is_symlink() || !stays_inside(&name) {
                return Err(wrong(format!(
                    "the entry {name:?} leads out of the file, or is a link; such files are not read"
                )));
            }
            if entry.is_file() {
                names.insert(name, at);
            }
        }
        Ok(Self {
            path: path.to_owned(),
            names,
            zip: Mutex::new(zip),
        })
    }

    /// The path of the file.
    pub(in crate::dataset) fn path(&self) -> &Path {
        &self.path
    }

    /// The paths of all files, without hidden ones.
    pub(super) fn files(&self) -> Vec<PathBuf> {
        self.names
            .keys()
            .filter(|name| {
                !name
                    .split('/')
                    .any(|part| part.starts_with('.') || part == "__MACOSX")
            })
            .map(PathBuf::from)
            .collect()
    }

    /// Whether there is a file of this name.
    pub(in crate::dataset::ready_made) fn has(&self, name: &str) -> bool {
        self.names.contains_key(name)
    }

    /// The bytes of an image.
    ///
    /// # Errors
    /// If it cannot be read, or is longer than an image may be, whatever the directory states.
    pub(in crate::dataset) fn read_image(&self, name: &str) -> Result<Vec<u8>> {
        let mut bytes = Vec::new();
        self.copy(name, LONGEST_IMAGE, &mut bytes)?;
        Ok(bytes)
    }

    /// A file of rows, unpacked until it is closed.
    pub(super) fn unpacked(&self, name: &str) -> Result<NamedTempFile> {
        let mut file =
            NamedTempFile::new().map_err(|e| Error::file(std::env::temp_dir(), "write", e))?;
        let packed = self.packed(name)?;
        self.copy(name, most_unpacked(packed), &mut file)?;
        Ok(file)
    }

    /// The text of a file.
    pub(in crate::dataset::ready_made) fn read_text(&self, name: &str) -> Result<String> {
        let mut bytes = Vec::new();
        self.copy(name, 1 << 22, &mut bytes)?;
        Ok(String::from_utf8_lossy(&bytes).into_owned())
    }

    /// The length of a file as it is packed.
    fn packed(&self, name: &str) -> Result<u64> {
        let place = format!("{}, {name}", self.path.display());
        let at = self.names.get(name).copied();
        let at = at.ok_or_else(|| Error::data(&place, "no such file in it"))?;
        let mut zip = self.zip.lock().unwrap_or_else(PoisonError::into_inner);
        let entry = zip.by_index_raw(at).map_err(|e| Error::data(&place, e))?;
        Ok(entry.compressed_size())
    }

    fn copy(&self, name: &str, most: u64, to: &mut impl std::io::Write) -> Result<()> {
        let place = format!("{}, {name}", self.path.display());
        let at = self.names.get(name).copied();
        let at = at.ok_or_else(|| Error::data(&place, "no such file in it"))?;
        let mut zip = self.zip.lock().unwrap_or_else(PoisonError::into_inner);
        let entry = zip.by_index(at).map_err(|e| Error::data(&place, e))?;
        let copied = std::io::copy(&mut entry.take(most.saturating_add(1)), to);
        let copied = copied.map_err(|e| Error::data(&place, e))?;
        if copied > most {
            return Err(Error::data(
                &place,
                format_args!("longer than {} MB", most >> 20),
            ));
        }
        Ok(())
    }

    /// The name of the image that data spell relative to a folder of the file.
    ///
    /// # Errors
    /// If it leads out of the file, or is not in it.
    pub(in crate::dataset::ready_made) fn find(
        &self,
        base: &Path,
        spelled: &str,
    ) -> Result<FrameId, String> {
        let mut parts: Vec<String> = Vec::new();
        for part in base.join(spelled).components() {
            let inside = match part {
                Component::CurDir => true,
                Component::Normal(name) => {
                    parts.push(name.to_string_lossy().into_owned());
                    true
                }
                Component::ParentDir => parts.pop().is_some(),
                Component::RootDir | Component::Prefix(_) => false,
            };
            if !inside {
                return Err(format!("{spelled:?} lies outside {}", self.path.display()));
            }
        }
        let name = parts.join("/");
        if self.names.contains_key(&name) {
            return Ok(FrameId(name));
        }
        Err(format!("no such file: {name:?} in {}", self.path.display()))
    }
}

/// Whether a name is a path below the file.
fn stays_inside(name: &str) -> bool {
    let mut parts = Path::new(name).components();
    !name.contains(['\\', '\0'])
        && parts.all(|part| matches!(part, Component::Normal(_) | Component::CurDir))
}
