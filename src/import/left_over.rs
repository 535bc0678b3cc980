//! The files of a folder that an import does not read: [`LeftOver`].

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use crate::error::Result;
use crate::files::reading::entries;

/// The most kinds of files that are named.
const MOST_NAMED: usize = 8;

/// The files that are not read, by their kind: the name of their folder and the ending of their names. A single file of its kind has
/// its name.
#[derive(Debug, Default, PartialEq, Eq)]
pub(crate) struct LeftOver(BTreeMap<String, Files>);

#[derive(Debug, PartialEq, Eq)]
struct Files {
    count: usize,
    first: String,
}

impl LeftOver {
    /// The files in a folder and below, without those that are read. Links to folders are not followed.
    ///
    /// # Errors
    /// If a folder cannot be read.
    pub(super) fn in_folder(folder: &Path, read: &BTreeSet<PathBuf>) -> Result<Self> {
        let mut left = Self::default();
        left.add(folder, folder, read)?;
        Ok(left)
    }

    fn add(&mut self, root: &Path, folder: &Path, read: &BTreeSet<PathBuf>) -> Result<()> {
        for path in entries(folder)? {
            if path.is_symlink() && path.is_dir() {
                continue;
            }
            if path.is_dir() {
                self.add(root, &path, read)?;
            } else if !read.contains(&path) {
                let within = path.strip_prefix(root).unwrap_or(&path);
                self.count(within);
            }
        }
        Ok(())
    }

    fn count(&mut self, path: &Path) {
        let text = |part: Option<&std::ffi::OsStr>| {
            part.map(|part| part.to_string_lossy().into_owned())
                .unwrap_or_default()
        };
        let folder = text(path.parent().and_then(Path::file_name));
        let name = match path.extension() {
            Some(ending) => format!("*.{}", ending.to_string_lossy()),
            None => text(path.file_name()),
        };
        let kind = if folder.is_empty() {
            name
        } else {
            format!("{folder}/{name}")
        };
        let files = self.0.entry(kind).or_insert_with(|| Files {
            count: 0,
            first: path.display().to_string(),
        });
        files.count += 1;
    }

    /// Adds the files of another folder.
    pub(super) fn join(&mut self, other: Self) {
        for (kind, files) in other.0 {
            match self.0.get_mut(&kind) {
                Some(known) => known.count += files.count,
                None => {
                    self.0.insert(kind, files);
                }
            }
        }
    }

    /// One line that names the files, the most frequent kinds first; empty if there are none.
    pub(crate) fn line(&self) -> String {
        if self.0.is_empty() {
            return String::new();
        }
        let mut kinds: Vec<(&String, &Files)> = self.0.iter().collect();
        kinds.sort_by_key(|(kind, files)| (std::cmp::Reverse(files.count), *kind));
        let mut named: Vec<String> = kinds
            .iter()
            .take(MOST_NAMED)
            .map(|(kind, files)| match files.count {
                1 => files.first.clone(),
                count => format!("{count} {kind}"),
            })
            .collect();
        let more: usize = kinds
            .iter()
            .skip(MOST_NAMED)
            .map(|(_, files)| files.count)
            .sum();
        if more > 0 {
            named.push(format!("{more} more"));
        }
        format!("not read: {}\n", named.join(", "))
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn files_that_are_not_read_are_named_by_kind() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str| {
            let path = folder.path().join(name);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(&path, "").unwrap();
            path
        };
        let read: BTreeSet<PathBuf> = ["s0/rgb/0.png", "s0/rgb/1.png"].map(write).into();
        assert_eq!(
            LeftOver::in_folder(folder.path(), &read).unwrap().line(),
            ""
        );
        for name in ["s0/sem/0.tif", "s1/sem/1.tif", "s0/note", "README.md"] {
            write(name);
        }
        let left = LeftOver::in_folder(folder.path(), &read).unwrap();
        assert_eq!(left.line(), "not read: 2 sem/*.tif, README.md, s0/note\n");
        for number in 0..9 {
            write(&format!("more/{number}.e{number}"));
        }
        let line = LeftOver::in_folder(folder.path(), &read).unwrap().line();
        assert!(line.ends_with(", 4 more\n"), "{line}");
    }
}
