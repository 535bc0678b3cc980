//! Who may enter a folder that the program makes: [`FolderAccess`].

use std::path::Path;
use std::{fs, io};

use crate::error::{Error, Result};

/// The access of other users of this machine to a new folder.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum FolderAccess {
    /// None: the folder holds replies, and pictures of homes. As nobody else can enter it, all that is in it is private, whatever the
    /// modes of the files are; so `chmod` of the folder alone shares it later.
    #[default]
    Private,
    /// The system's default for new folders (`umask`).
    Shared,
}

impl FolderAccess {
    /// The access for a value of the flag `--shared`.
    pub fn new(is_shared: bool) -> Self {
        if is_shared {
            Self::Shared
        } else {
            Self::Private
        }
    }

    /// Creates a folder; those above it have the mode that the system gives. One that exists keeps its mode.
    ///
    /// # Errors
    /// If it cannot be created.
    pub fn create(self, path: &Path) -> Result<()> {
        self.make(path).map_err(|e| Error::file(path, "create", e))
    }

    /// Creates a folder as [`create`](Self::create), with the error of the system.
    ///
    /// # Errors
    /// If it cannot be created.
    pub fn make(self, path: &Path) -> io::Result<()> {
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
    fn a_new_folder_is_private_and_an_old_one_stays() {
        let scene = tempfile::tempdir().unwrap();
        let mode = |name: &str| {
            let data = fs::metadata(scene.path().join(name)).unwrap();
            data.permissions().mode() & 0o777
        };
        let create = |name: &str, access: FolderAccess| access.create(&scene.path().join(name));
        create("runs/a", FolderAccess::Private).unwrap();
        assert_eq!(mode("runs/a"), 0o700);
        create("runs/b", FolderAccess::Shared).unwrap();
        // Whatever the system gives here, both have it.
        assert_eq!(mode("runs/b"), mode("runs"));
        create("runs", FolderAccess::Private).unwrap();
        assert_eq!(mode("runs/b"), mode("runs"));
        fs::write(scene.path().join("file"), "").unwrap();
        assert!(create("file", FolderAccess::Private).is_err());
    }
}
