//! Access rights of the folders that the program creates: [`FolderAccess`].

use std::path::Path;
use std::{fs, io};

use crate::error::{Error, Result};

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

#[cfg(all(test, unix))]
mod tests {
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
