//! Files of a folder that an import does not read: [`UnreadFiles`].

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use crate::error::Result;
use crate::files::reading::entries;

/// Maximum number of kinds of files in the message.
const MAX_NAMED_KINDS: usize = 8;

/// Unread files by kind: the name of their folder and their extension.
#[derive(Debug, Default, PartialEq, Eq)]
pub(crate) struct UnreadFiles(BTreeMap<String, FilesOfKind>);

#[derive(Debug, PartialEq, Eq)]
struct FilesOfKind {
    count: usize,
    /// Relative path of the first file.
    first: String,
}

impl UnreadFiles {
    /// Finds the files in a folder and its subfolders that are not in `read`. Links to folders are not followed.
    ///
    /// # Errors
    /// If a folder cannot be read.
    pub(super) fn in_folder(folder: &Path, read: &BTreeSet<PathBuf>) -> Result<Self> {
        let mut unread = Self::default();
        unread.add_folder(folder, folder, read)?;
        Ok(unread)
    }

    fn add_folder(&mut self, root: &Path, folder: &Path, read: &BTreeSet<PathBuf>) -> Result<()> {
        for path in entries(folder)? {
            if path.is_symlink() && path.is_dir() {
                continue;
            }
            if path.is_dir() {
                self.add_folder(root, &path, read)?;
            } else if !read.contains(&path) {
                self.count(path.strip_prefix(root).unwrap_or(&path));
            }
        }
        Ok(())
    }

    /// Counts a file, given by its relative path.
    fn count(&mut self, path: &Path) {
        let folder = text(path.parent().and_then(Path::file_name));
        let name = match path.extension() {
            Some(ending) => format!("*.{}", ending.to_string_lossy()),
            None => text(path.file_name()),
        };
        let kind = if folder.is_empty() { name } else { format!("{folder}/{name}") };
        let files = self.0.entry(kind).or_insert_with(|| FilesOfKind { count: 0, first: path.display().to_string() });
        files.count += 1;
    }

    /// Adds the files of another folder.
    pub(super) fn merge(&mut self, other: Self) {
        for (kind, files) in other.0 {
            self.0.entry(kind).and_modify(|known| known.count += files.count).or_insert(files);
        }
    }

    /// Line with the unread files, the most frequent kinds first; empty if there are none.
    pub(crate) fn line(&self) -> String {
        if self.0.is_empty() {
            return String::new();
        }
        let mut kinds: Vec<(&String, &FilesOfKind)> = self.0.iter().collect();
        kinds.sort_by_key(|(kind, files)| (std::cmp::Reverse(files.count), *kind));
        let mut named: Vec<String> = kinds
            .iter()
            .take(MAX_NAMED_KINDS)
            .map(|(kind, files)| match files.count {
                1 => files.first.clone(),
                count => format!("{count} {kind}"),
            })
            .collect();
        let more: usize = kinds.iter().skip(MAX_NAMED_KINDS).map(|(_, files)| files.count).sum();
        if more > 0 {
            named.push(format!("{more} more"));
        }
        format!("not read: {}\n", named.join(", "))
    }
}

fn text(part: Option<&std::ffi::OsStr>) -> String {
    part.unwrap_or_default().to_string_lossy().into_owned()
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    fn write(folder: &Path, name: &str) -> PathBuf {
        let path = folder.join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(&path, "").unwrap();
        path
    }

    #[test]
    fn unread_files_are_counted_by_kind() {
        let folder = tempfile::tempdir().unwrap();
        let read: BTreeSet<PathBuf> = ["s0/rgb/0.png", "s0/rgb/1.png"].map(|name| write(folder.path(), name)).into();
        assert_eq!(UnreadFiles::in_folder(folder.path(), &read).unwrap().line(), "");
        for name in ["s0/sem/0.tif", "s1/sem/1.tif", "s0/note", "README.md"] {
            write(folder.path(), name);
        }
        let unread = UnreadFiles::in_folder(folder.path(), &read).unwrap();
        assert_eq!(unread.line(), "not read: 2 sem/*.tif, README.md, s0/note\n");
        for number in 0..9 {
            write(folder.path(), &format!("more/{number}.e{number}"));
        }
        let line = UnreadFiles::in_folder(folder.path(), &read).unwrap().line();
        assert!(line.ends_with(", 4 more\n"), "{line}");
    }
}
