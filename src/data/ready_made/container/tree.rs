//! Files in a folder or a ZIP file: [`Tree`].

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::SetFile;
use super::archive::Archive;
use crate::root::{Location, Root};
use darkqa_base::error::{Error, Result};
use darkqa_base::files;

/// A folder or a ZIP file. Paths are relative to it.
pub(super) enum Tree {
    Folder {
        folder: PathBuf,
        /// Folder of a hub's cache with the files that the links in a snapshot lead to.
        blobs: Option<PathBuf>,
    },
    Archive(Arc<Archive>),
}

impl Tree {
    /// The tree of a folder, or the newest snapshot if the folder is a repository in a hub's cache.
    ///
    /// # Errors
    /// If the cache does not name a snapshot.
    pub(super) fn from_folder(place: &Path) -> Result<Self> {
        let (folder, blobs) = cached_snapshot(place)?;
        Ok(Self::Folder { folder, blobs })
    }

    /// Path of the folder or the ZIP file.
    pub(super) fn place(&self) -> &Path {
        match self {
            Self::Folder { folder, .. } => folder,
            Self::Archive(archive) => &archive.path,
        }
    }

    /// All files that are not hidden, and the links that lead outside the tree, which are skipped.
    pub(super) fn files(&self) -> Result<(Vec<PathBuf>, Vec<PathBuf>)> {
        match self {
            Self::Archive(archive) => Ok((archive.files(), Vec::new())),
            Self::Folder { folder, blobs } => {
                let mut scan =
                    Scan { root: Root::new(folder, blobs.as_slice())?, files: Vec::new(), outside: Vec::new() };
                scan.add_folder(folder)?;
                let files =
                    scan.files.iter().map(|path| path.strip_prefix(folder).unwrap_or(path).to_owned()).collect();
                Ok((files, scan.outside))
            }
        }
    }

    /// True if the tree has a file with this path.
    pub(super) fn has(&self, path: &str) -> bool {
        match self {
            Self::Folder { folder, blobs } => Root::new(folder, blobs.as_slice())
                .is_ok_and(|root| root.locate(&folder.join(path)) == Location::Inside),
            Self::Archive(archive) => archive.has(path),
        }
    }

    /// Reads the text of a file.
    pub(super) fn read_text(&self, path: &str) -> Result<String> {
        match self {
            Self::Folder { folder, .. } => files::text(&folder.join(path)),
            Self::Archive(archive) => archive.read_text(path),
        }
    }

    /// Opens a file of a table.
    pub(super) fn open(&self, path: &Path, config: String) -> Result<SetFile> {
        match self {
            Self::Folder { folder, .. } => SetFile::open(folder.join(path), config),
            Self::Archive(archive) => SetFile::from_member(archive, path, config),
        }
    }

    /// Full path of a file in the tree.
    pub(super) fn full_path(&self, path: &Path) -> PathBuf {
        self.place().join(path)
    }
}

/// The folder itself, or the newest snapshot if the folder is a repository in a hub's cache; and the folder of the
/// cache with the files that the links in a snapshot lead to, if it lies in the repository.
///
/// # Errors
/// If the cache does not name a snapshot.
pub fn cached_snapshot(place: &Path) -> Result<(PathBuf, Option<PathBuf>)> {
    let canonical = place.canonicalize().unwrap_or_else(|_| place.to_owned());
    if !(is_cached_repository(&canonical) && place.join("snapshots").is_dir()) {
        let repository = canonical.ancestors().nth(2).filter(|path| is_cached_repository(path));
        return Ok((place.to_owned(), repository.and_then(own_blobs)));
    }
    let head = files::text(&place.join("refs/main"))?;
    let snapshot = place.join("snapshots").join(head.trim());
    let is_own = snapshot.canonicalize().is_ok_and(|real| real.starts_with(&canonical));
    if !snapshot.is_dir() || !is_own || head.trim().contains(['/', '\\']) {
        let problem = "refs/main names no folder in snapshots; download the repository again";
        return Err(Error::data(place.display(), problem));
    }
    Ok((snapshot, own_blobs(&canonical)))
}

/// Folder `blobs` of a repository in a hub's cache; `None` if there is none, or if it is a link out of the repository.
fn own_blobs(repository: &Path) -> Option<PathBuf> {
    let blobs = repository.join("blobs").canonicalize().ok()?;
    (blobs.is_dir() && blobs.starts_with(repository)).then_some(blobs)
}

fn is_cached_repository(path: &Path) -> bool {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    name.starts_with("datasets--")
}

/// Scan of a folder and its subfolders.
struct Scan {
    /// Folders that links may lead into.
    root: Root,
    files: Vec<PathBuf>,
    /// Links that lead outside the folders or nowhere.
    outside: Vec<PathBuf>,
}

impl Scan {
    fn add_folder(&mut self, folder: &Path) -> Result<()> {
        for path in files::entries(folder)? {
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            if name.starts_with('.') {
                continue;
            }
            let is_link = fs::symlink_metadata(&path).is_ok_and(|metadata| metadata.is_symlink());
            if is_link && self.root.locate(&path) != Location::Inside {
                self.outside.push(path);
            } else if path.is_dir() && !is_link {
                self.add_folder(&path)?;
            } else if path.is_file() {
                self.files.push(path);
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_of_any_depth_are_found() {
        let root = tempfile::tempdir().unwrap();
        let inner = Path::new("split=test/lang=en/year=2026/month=11/day=28");
        fs::create_dir_all(root.path().join(inner)).unwrap();
        fs::write(root.path().join(inner).join("0.parquet"), "").unwrap();
        let (files, _) = Tree::from_folder(root.path()).unwrap().files().unwrap();
        assert_eq!(files, [inner.join("0.parquet")]);
    }

    #[cfg(unix)]
    #[test]
    fn links_out_are_skipped() {
        let outer = tempfile::tempdir().unwrap();
        let root = outer.path();
        fs::create_dir_all(root.join("set/inner")).unwrap();
        for name in ["secret.csv", "set/a.csv", "set/.hidden.csv"] {
            fs::write(root.join(name), "a").unwrap();
        }
        std::os::unix::fs::symlink(root.join("secret.csv"), root.join("set/b.csv")).unwrap();
        std::os::unix::fs::symlink(root.join("set/a.csv"), root.join("set/inner/c.csv")).unwrap();
        std::os::unix::fs::symlink(root.join("nothing.csv"), root.join("set/d.csv")).unwrap();
        let (files, outside) = Tree::from_folder(&root.join("set")).unwrap().files().unwrap();
        assert_eq!(files, [Path::new("a.csv"), Path::new("inner/c.csv")]);
        assert_eq!(outside, [root.join("set/b.csv"), root.join("set/d.csv")]);
    }

    #[cfg(unix)]
    #[test]
    fn links_into_hub_cache_are_followed() {
        let outer = tempfile::tempdir().unwrap();
        let root = outer.path().join("datasets--a--b");
        fs::create_dir_all(root.join("snapshots/1")).unwrap();
        std::os::unix::fs::symlink("../../blobs/f00", root.join("snapshots/1/a.csv")).unwrap();
        let found = || {
            let tree = Tree::from_folder(&root.join("snapshots/1")).unwrap();
            tree.files().unwrap()
        };
        // The link leads nowhere until its file is downloaded.
        assert_eq!(found(), (Vec::new(), vec![root.join("snapshots/1/a.csv")]));
        fs::create_dir(root.join("blobs")).unwrap();
        fs::write(root.join("blobs/f00"), "a").unwrap();
        assert_eq!(found(), (vec!["a.csv".into()], Vec::new()));
    }
}
