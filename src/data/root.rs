//! Folders that a data set may read files from: [`Root`].
//!
//! A downloaded data set must not be able to send private files of the user to an endpoint. Every path in the data is
//! therefore resolved here, following links, and must be below the folder of the data or a folder given with
//! `--data-root`.
//!
//! Files whose path is spelled in another way than in the data: [`folded`], [`SimilarPaths`].

use std::collections::HashMap;
use std::fs;
use std::path::{self, Component, Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use clap::Args;
use percent_encoding::percent_decode_str;
use unicode_normalization::UnicodeNormalization as _;

use darkqa_base::error::{Error, Result};
use darkqa_base::files::{self, entries};
use darkqa_base::types::{Decides, FrameId, shell_word};

/// Flag for further folders with files of the data.
#[derive(Debug, Clone, Default, Args)]
pub struct RootArgs {
    /// Additional folder for files that the data name; repeatable; default: the data folder only
    #[arg(long, value_name = "DIR", add = Decides::Reply)]
    pub data_root: Vec<PathBuf>,
}

/// Prefixes of URLs, which are not paths on this machine.
const SCHEMES: [&str; 6] = ["http:", "https:", "ftp:", "file:", "s3:", "gs:"];

/// Reserved device names on Windows, with or without an extension. On other systems they are ordinary file names.
const DEVICES: [&str; 22] = [
    "con", "prn", "aux", "nul", "com1", "com2", "com3", "com4", "com5", "com6", "com7", "com8", "com9", "lpt1", "lpt2",
    "lpt3", "lpt4", "lpt5", "lpt6", "lpt7", "lpt8", "lpt9",
];

/// Folder of a data set, and further folders that the user allows.
#[derive(Debug, Clone)]
pub struct Root {
    folder: PathBuf,
    /// The folder as an absolute path without `.` and `..`.
    absolute: PathBuf,
    /// All folders, with links resolved.
    canonical: Vec<PathBuf>,
    /// All folders as absolute paths, with links unresolved.
    unresolved: Vec<PathBuf>,
    similar: SimilarPaths,
}

/// Location of a path relative to the allowed folders, following links.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Location {
    /// Below one of the folders.
    Inside,
    /// Outside all folders.
    Outside,
    /// The path does not exist.
    Missing,
}

impl Root {
    /// Allows the folder of a data set and further folders.
    ///
    /// # Errors
    /// If one of the folders does not exist.
    pub fn new(folder: &Path, further: &[PathBuf]) -> Result<Self> {
        let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
        let (mut canonical, mut unresolved) = (Vec::new(), Vec::new());
        let folders = std::iter::once(folder).chain(further.iter().map(PathBuf::as_path));
        for (number, folder) in folders.enumerate() {
            let place = folder.canonicalize().map_err(|e| match number {
                0 => Error::file(folder, "read", e),
                _ => Error::usage("--data-root", format_args!("{}: {e}", folder.display())),
            })?;
            canonical.push(place);
            unresolved.push(without_dots(&absolute(folder)));
        }
        Ok(Self {
            absolute: unresolved[0].clone(),
            folder: folder.to_owned(),
            canonical,
            unresolved,
            similar: SimilarPaths::default(),
        })
    }

    /// Folder of the data, as given.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Name and path of an image that the data name by a path relative to `base`.
    ///
    /// The name of a frame is the normalised path of its image, so that one file is one frame (with one noise seed)
    /// however its path is written. The path is relative to the folder of the data, with `/`, without `.` and without
    /// `..` after a folder. Outside this folder, it is the path in the data without `.`.
    ///
    /// # Errors
    /// As [`Self::file`].
    pub fn image(&self, base: &Path, spelled: &str) -> Result<(FrameId, PathBuf), String> {
        let file = self.file(base, Path::new(spelled))?;
        let absolute = without_dots(&absolute(&base.join(spelled)));
        let normalized = match absolute.strip_prefix(&self.absolute) {
            Ok(within) => with_slashes(within),
            Err(_) => with_slashes(&without_dots(Path::new(spelled))),
        };
        // After a symbolic link to a folder, `..` leads elsewhere than the text suggests. Keep such a path as it is.
        let is_same_file =
            normalized == spelled || file.canonicalize().ok() == self.folder.join(&normalized).canonicalize().ok();
        let name = if is_same_file { normalized } else { spelled.to_owned() };
        Ok((FrameId(name), file))
    }

    /// Path of an existing file that the data name relative to `base`.
    ///
    /// # Errors
    /// If the name is not a path, leads outside the folders, or the file does not exist. The error does not reveal
    /// whether a file outside the folders exists.
    pub fn file(&self, base: &Path, spelled: &Path) -> Result<PathBuf, String> {
        let path = self.path(base, spelled)?;
        if path.is_file() {
            return Ok(path);
        }
        let problem = format!("no such file: {}", path.display());
        let similar = spelled
            .to_str()
            .and_then(|spelled| self.similar.find(base, spelled))
            .filter(|similar| self.path(base, Path::new(similar)).is_ok());
        Err(match similar {
            Some(similar) => format!("{problem}; it is named {similar:?}: write this in the data"),
            None => problem,
        })
    }

    /// Path of a file that the data name relative to `base`. The file need not exist.
    ///
    /// # Errors
    /// If the name is not a path, or leads outside the folders.
    pub fn path(&self, base: &Path, spelled: &Path) -> Result<PathBuf, String> {
        check_name(spelled)?;
        let path = base.join(spelled);
        let unresolved = without_dots(&absolute(&path));
        let is_below_a_root = self.unresolved.iter().chain(&self.canonical).any(|root| unresolved.starts_with(root));
        if !is_below_a_root {
            return Err(self.outside_error(spelled, &unresolved));
        }
        match path.canonicalize() {
            Ok(canonical) if !self.contains(&canonical) => Err(self.outside_error(spelled, &canonical)),
            _ => Ok(path),
        }
    }

    /// Path of a file of the data set itself, such as `questions.jsonl`; `None` if the folder has none.
    ///
    /// # Errors
    /// If the file is a link out of the folders.
    pub fn own_file(&self, name: impl AsRef<Path>) -> Result<Option<PathBuf>> {
        let path = self.folder.join(name);
        match self.locate(&path) {
            Location::Inside => Ok(Some(path)),
            Location::Missing => Ok(None),
            Location::Outside => Err(self.link_out_error(&path)),
        }
    }

    /// Paths in a folder of the data, sorted by name. Links out of the folders are added to `links_out` instead; links
    /// to nothing are left out.
    ///
    /// # Errors
    /// If the folder cannot be read.
    pub fn entries(&self, folder: &Path, links_out: &mut Vec<PathBuf>) -> Result<Vec<PathBuf>> {
        let mut inside = Vec::new();
        for path in files::entries(folder)? {
            match self.locate(&path) {
                Location::Inside => inside.push(path),
                Location::Outside => links_out.push(path),
                Location::Missing => {}
            }
        }
        Ok(inside)
    }

    /// Checks that no link in the folder or its subfolders leads out of the folders.
    ///
    /// # Errors
    /// If one does, or if a folder cannot be read.
    pub fn refuse_links_out(&self) -> Result<()> {
        let mut waiting = vec![self.folder.clone()];
        while let Some(folder) = waiting.pop() {
            let error = |e| Error::file(&folder, "read", e);
            for entry in fs::read_dir(&folder).map_err(error)? {
                let entry = entry.map_err(error)?;
                let kind = entry.file_type().map_err(error)?;
                if kind.is_dir() {
                    waiting.push(entry.path());
                } else if kind.is_symlink() && self.locate(&entry.path()) == Location::Outside {
                    return Err(self.link_out_error(&entry.path()));
                }
            }
        }
        Ok(())
    }

    /// Location of a path, following links.
    pub fn locate(&self, path: &Path) -> Location {
        match path.canonicalize() {
            Ok(canonical) if self.contains(&canonical) => Location::Inside,
            Ok(_) => Location::Outside,
            Err(_) => Location::Missing,
        }
    }

    /// True if a canonical path is below one of the folders.
    fn contains(&self, canonical: &Path) -> bool {
        self.canonical.iter().any(|root| canonical.starts_with(root))
    }

    /// Warns of links that lead outside the folders; the warning names the first.
    pub fn warn_of_links_out(&self, links: &[PathBuf]) {
        let Some(first) = links.first() else {
            return;
        };
        let count = match links.len() {
            1 => "1 link leads out of the folder and is not followed".to_owned(),
            n => format!("{n} links lead out of the folder and are not followed"),
        };
        tracing::warn!(
            "{}: {count}: {}; {}",
            self.folder.display(),
            first.strip_prefix(&self.folder).unwrap_or(first).display(),
            allowing_flag(first)
        );
    }

    /// Error for a link out of the folders.
    pub fn link_out_error(&self, link: &Path) -> Error {
        let problem =
            format_args!("leads out of {}, the folder of the data; {}", self.folder.display(), allowing_flag(link));
        Error::data(link.display(), problem)
    }

    /// Error for a path in the data that leads to `target` outside the folders.
    fn outside_error(&self, spelled: &Path, target: &Path) -> String {
        let parent = target.parent().unwrap_or(target);
        let name = self.absolute.file_name().unwrap_or_default();
        format!(
            "{:?} lies outside {}/, the folder of the data; --data-root {} allows the folder that it names",
            spelled.to_string_lossy(),
            name.to_string_lossy(),
            shell_word(&parent.display().to_string())
        )
    }
}

/// Remedy for a link out of the folders: the flag that allows its target. The target of a link to a folder is that
/// folder.
fn allowing_flag(link: &Path) -> String {
    let real = link.canonicalize().unwrap_or_else(|_| link.to_owned());
    let folder = match real.parent() {
        Some(parent) if !real.is_dir() => parent,
        _ => &real,
    };
    format!("--data-root {} allows the folder that it leads to", shell_word(&folder.display().to_string()))
}

/// Checks that a name in the data is a path: not empty, not a URL, not a device.
fn check_name(spelled: &Path) -> Result<(), String> {
    let text = spelled.to_string_lossy();
    if text.trim().is_empty() {
        return Err("the path is empty".to_owned());
    }
    if text.contains('\0') {
        return Err("the path holds a zero byte".to_owned());
    }
    let lower = text.trim().to_ascii_lowercase();
    if SCHEMES.iter().any(|scheme| lower.starts_with(scheme)) {
        return Err(format!(
            "{text:?} is not a file on this machine; images are read from disk, so download them first"
        ));
    }
    let is_device = cfg!(windows)
        && spelled.components().any(|part| {
            let name = part.as_os_str().to_string_lossy().to_ascii_lowercase();
            let bare = name.split('.').next().unwrap_or_default();
            DEVICES.contains(&bare)
        });
    if is_device {
        return Err(format!("{text:?} holds the name of a device; rename it"));
    }
    Ok(())
}

fn absolute(path: &Path) -> PathBuf {
    path::absolute(path).unwrap_or_else(|_| path.to_owned())
}

/// Removes `.`, and `..` after a folder, without following links.
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

/// Path as text, with `/` as separator on every operating system.
fn with_slashes(path: &Path) -> String {
    path.to_string_lossy().replace(path::MAIN_SEPARATOR, "/")
}

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

    /// A folder with the data set `set`, which has an image `fr/a.png`, and `secret.png` outside it.
    fn test_folder() -> tempfile::TempDir {
        let outer = tempfile::tempdir().unwrap();
        fs::create_dir_all(outer.path().join("set/fr")).unwrap();
        for file in ["set/fr/a.png", "secret.png"] {
            fs::write(outer.path().join(file), "").unwrap();
        }
        outer
    }

    #[test]
    fn one_file_has_one_name() {
        let outer = test_folder();
        let set = outer.path().join("set");
        let root = Root::new(&set, &[]).unwrap();
        let inside = set.join("fr/a.png").display().to_string();
        for spelled in ["fr/a.png", "./fr//a.png", "fr/../fr/a.png", "../set/fr/a.png", &inside] {
            let (name, _) = root.image(&set, spelled).unwrap();
            assert_eq!(name.0, "fr/a.png", "{spelled}");
        }
        let (name, _) = root.image(&set.join("fr"), "a.png").unwrap();
        assert_eq!(name.0, "fr/a.png");
    }

    #[test]
    fn path_outside_is_refused_unless_allowed() {
        let outer = test_folder();
        let set = outer.path().join("set");
        let root = Root::new(&set, &[]).unwrap();
        let secret = outer.path().join("secret.png").display().to_string();
        let missing = outer.path().join("nothing.png").display().to_string();
        for spelled in ["../secret.png", "fr/../../secret.png", &secret, "../nothing.png", &missing, "/etc/passwd"] {
            let problem = root.image(&set, spelled).unwrap_err();
            assert!(problem.contains("lies outside set/") && problem.contains("--data-root "), "{problem}");
        }
        let allowed = Root::new(&set, &[outer.path().to_owned()]).unwrap();
        assert_eq!(allowed.image(&set, "../secret.png").unwrap().0.0, "../secret.png");
        assert!(allowed.image(&set, "/etc/passwd").is_err());
        let problem = Root::new(&set, &[outer.path().join("none")]).unwrap_err();
        assert!(problem.to_string().starts_with("--data-root: "), "{problem}");
    }

    #[test]
    fn invalid_paths_are_refused() {
        let outer = test_folder();
        let root = Root::new(outer.path(), &[]).unwrap();
        for (spelled, message) in [
            ("", "empty"),
            ("a\0b", "zero byte"),
            ("https://example.org/a.png", "download them first"),
            ("File:///etc/passwd", "download them first"),
            ("set/none.png", "no such file"),
            ("set", "no such file"),
        ] {
            let problem = root.image(outer.path(), spelled).unwrap_err();
            assert!(problem.contains(message), "{spelled:?}: {problem}");
        }
    }

    #[cfg(unix)]
    #[test]
    fn links_are_resolved_before_the_check() {
        let outer = test_folder();
        let (set, link) = (outer.path().join("set"), std::os::unix::fs::symlink::<PathBuf, PathBuf>);
        link(outer.path().join("secret.png"), set.join("out.png")).unwrap();
        link(set.join("fr"), set.join("inner")).unwrap();
        fs::create_dir_all(outer.path().join("far/deep")).unwrap();
        link(outer.path().join("far/deep"), set.join("far")).unwrap();
        fs::write(outer.path().join("far/b.png"), "").unwrap();
        let root = Root::new(&set, &[]).unwrap();
        assert!(root.image(&set, "out.png").unwrap_err().contains("lies outside"));
        assert!(root.image(&set, "far/../b.png").unwrap_err().contains("lies outside"));
        assert_eq!(root.image(&set, "inner/a.png").unwrap().0.0, "inner/a.png");
        // The folder of the data may itself be reached by a link.
        link(set.clone(), outer.path().join("alias")).unwrap();
        let alias = outer.path().join("alias");
        assert!(Root::new(&alias, &[]).unwrap().image(&alias, "fr/a.png").is_ok());
    }

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
