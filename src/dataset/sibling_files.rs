//! The image files that a ready-made set names: [`SiblingFiles`].
//!
//! The name of a frame is the normalised path of its image: relative to the folder of the set, with `/`, without `.` and
//! without `..` after a folder. An absolute path into that folder becomes relative; any other absolute path stays. So
//! one file is one frame with one noise, however the set spells its path.

use std::path::{self, Component, Path, PathBuf};

use crate::types::FrameId;

/// The folder of a set. Relative paths start there.
pub(super) struct SiblingFiles<'a> {
    folder: &'a Path,
    /// The same folder as an absolute path without `.` and `..`.
    absolute: PathBuf,
}

impl<'a> SiblingFiles<'a> {
    pub(super) fn of(set: &'a Path) -> Self {
        let folder = set.parent().unwrap_or(Path::new(""));
        let absolute = path::absolute(set).unwrap_or_else(|_| set.to_owned());
        let absolute = without_dots(absolute.parent().unwrap_or(Path::new("")));
        Self { folder, absolute }
    }

    /// The name and the file of an image, from the path as the set spells it.
    pub(super) fn image(&self, spelled: &str) -> Result<(FrameId, PathBuf), String> {
        if spelled.trim().is_empty() {
            return Err("the path of the image is empty".to_owned());
        }
        let file = self.folder.join(spelled);
        if !file.is_file() {
            return Err(format!("no such image: {}", file.display()));
        }
        let normalized = self.normalized(Path::new(spelled));
        // After a symbolic link to a folder, `..` leads to another place than the text says. Such a path stays as it is.
        let same = normalized == spelled
            || file.canonicalize().ok() == self.folder.join(&normalized).canonicalize().ok();
        let name = if same { normalized } else { spelled.to_owned() };
        Ok((FrameId(name), file))
    }

    /// The normalised form of a path, by its text alone.
    fn normalized(&self, spelled: &Path) -> String {
        let absolute = without_dots(&self.absolute.join(spelled));
        match absolute.strip_prefix(&self.absolute) {
            Ok(within) => with_slashes(within),
            Err(_) => with_slashes(&without_dots(spelled)),
        }
    }
}

/// A path without `.`, and without `..` after a folder.
fn without_dots(path: &Path) -> PathBuf {
    let mut clean = PathBuf::new();
    for part in path.components() {
        match (part, clean.components().next_back()) {
            (Component::CurDir, _) | (Component::ParentDir, Some(Component::RootDir)) => {}
            (Component::ParentDir, Some(Component::Normal(_))) => {
                clean.pop();
            }
            _ => clean.push(part),
        }
    }
    clean
}

/// A path with `/` between its parts, on every operating system.
fn with_slashes(path: &Path) -> String {
    path.to_string_lossy().replace(path::MAIN_SEPARATOR, "/")
}
