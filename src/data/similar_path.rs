//! Files whose path is spelled in another way than in the data: [`folded`], [`SimilarPaths`].

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use percent_encoding::percent_decode_str;
use unicode_normalization::UnicodeNormalization as _;

use crate::files::reading::entries;

/// A path without differences of spelling: percent-encoding, backslashes, the case of letters, and the form of Unicode.
pub(super) fn folded(path: &str) -> String {
    let decoded = percent_decode_str(path).decode_utf8_lossy();
    decoded.replace('\\', "/").nfc().collect::<String>().to_lowercase()
}

/// Search for files by their [`folded`] paths. Each folder is read once.
#[derive(Debug, Clone, Default)]
pub(super) struct SimilarPaths {
    /// Names in a folder, by their folded form.
    folders: Arc<Mutex<HashMap<PathBuf, HashMap<String, String>>>>,
}

impl SimilarPaths {
    /// Path of an existing file relative to `base` that differs from `spelled` only in its spelling.
    pub(super) fn find(&self, base: &Path, spelled: &str) -> Option<String> {
        let mut found: Vec<String> = Vec::new();
        for part in folded(spelled).split('/').filter(|part| !matches!(*part, "" | ".")) {
            let folder = base.join(found.join("/"));
            let mut folders = self.folders.lock().unwrap_or_else(PoisonError::into_inner);
            let names = folders.entry(folder).or_insert_with_key(|folder| names(folder));
            found.push(names.get(part)?.clone());
        }
        let found = found.join("/");
        base.join(&found).is_file().then_some(found)
    }
}

/// Names in a folder, by their folded form.
fn names(folder: &Path) -> HashMap<String, String> {
    let paths = entries(folder).unwrap_or_default();
    paths.iter().filter_map(|path| path.file_name()?.to_str()).map(|name| (folded(name), name.to_owned())).collect()
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn other_spellings_of_a_path_are_found() {
        let folder = tempfile::tempdir().unwrap();
        fs::create_dir(folder.path().join("My Images")).unwrap();
        fs::write(folder.path().join("My Images/cafe\u{301}.PNG"), "").unwrap();
        for spelled in ["My%20Images/cafe%CC%81.PNG", "./my images/Caf\u{e9}.png", "My Images\\cafe\u{301}.PNG"] {
            assert_eq!(
                SimilarPaths::default().find(folder.path(), spelled).unwrap(),
                "My Images/cafe\u{301}.PNG",
                "{spelled}"
            );
        }
        for other in ["My Images", "My Images/tea.png", "../My Images/cafe.png"] {
            assert_eq!(SimilarPaths::default().find(folder.path(), other), None, "{other}");
        }
    }
}
