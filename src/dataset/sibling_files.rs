//! The images beside a ready-made set: [`SiblingFiles`].
//!
//! A frame is named by the path of its image, spelled in one way whatever way the set spells it: relative to the set's
//! folder, with `/`, without `.` and without `..` that leads back. An absolute path into that folder becomes relative;
//! one to elsewhere stays absolute. So one file is one frame, with one noise.

use std::path::{self, Component, Path, PathBuf};

use crate::types::FrameId;

/// The folder of a set, in which its paths begin.
pub(super) struct SiblingFiles<'a> {
    folder: &'a Path,
    /// The same, absolute, without `.` and `..`.
    absolute: PathBuf,
}

impl<'a> SiblingFiles<'a> {
    pub(super) fn of(set: &'a Path) -> Self {
        let folder = set.parent().unwrap_or(Path::new(""));
        let absolute = path::absolute(set).unwrap_or_else(|_| set.to_owned());
        let absolute = plain(absolute.parent().unwrap_or(Path::new("")));
        Self { folder, absolute }
    }

    /// The name and the file of the image that a set spells so.
    pub(super) fn image(&self, spelled: &str) -> Result<(FrameId, PathBuf), String> {
        if spelled.trim().is_empty() {
            return Err("no image is named".to_owned());
        }
        let file = self.folder.join(spelled);
        if !file.is_file() {
            return Err(format!("no such image: {}", file.display()));
        }
        let named = self.named(Path::new(spelled));
        // Behind a link to a folder, `..` leads elsewhere than the words say: such a path keeps its spelling.
        let same = named == spelled
            || file.canonicalize().ok() == self.folder.join(&named).canonicalize().ok();
        let name = if same { named } else { spelled.to_owned() };
        Ok((FrameId(name), file))
    }

    /// The one spelling of a path, by its words alone.
    fn named(&self, spelled: &Path) -> String {
        let absolute = plain(&self.absolute.join(spelled));
        match absolute.strip_prefix(&self.absolute) {
            Ok(within) => slashed(within),
            Err(_) => slashed(&plain(spelled)),
        }
    }
}

/// A path without `.`, and without `..` behind a folder that it leaves.
fn plain(path: &Path) -> PathBuf {
    let mut plain = PathBuf::new();
    for part in path.components() {
        match (part, plain.components().next_back()) {
            (Component::CurDir, _) | (Component::ParentDir, Some(Component::RootDir)) => {}
            (Component::ParentDir, Some(Component::Normal(_))) => {
                plain.pop();
            }
            _ => plain.push(part),
        }
    }
    plain
}

/// A path with `/` between its parts, on every system.
fn slashed(path: &Path) -> String {
    path.to_string_lossy().replace(path::MAIN_SEPARATOR, "/")
}
