//! The folders in which the files that data name may lie: [`Root`].
//!
//! A data set of a stranger must not have files of the user sent to an endpoint. So every path that data name is resolved here, links
//! followed, and must lie below the folder of the data, or below one that the user names with `--data-root`.

use std::path::{self, Component, Path, PathBuf};

use clap::Args;

use crate::error::{Error, Result};
use crate::types::{Decides, FrameId, shell_word};

/// The flag for folders beside that of the data.
#[derive(Debug, Clone, Default, Args)]
pub struct RootArgs {
    /// A further folder in which files that the data name may lie; repeatable; default: the folder of the data alone
    #[arg(long, value_name = "DIR", add = Decides::Reply)]
    pub data_root: Vec<PathBuf>,
}

/// Names that are no paths of this machine.
const SCHEMES: [&str; 6] = ["http:", "https:", "ftp:", "file:", "s3:", "gs:"];

/// Names of devices on Windows, with or without an ending. Other systems have files of these names.
const DEVICES: [&str; 22] = [
    "con", "prn", "aux", "nul", "com1", "com2", "com3", "com4", "com5", "com6", "com7", "com8",
    "com9", "lpt1", "lpt2", "lpt3", "lpt4", "lpt5", "lpt6", "lpt7", "lpt8", "lpt9",
];

/// The folder of some data, and the further folders that the user allows.
#[derive(Debug, Clone)]
pub(crate) struct Root {
    folder: PathBuf,
    /// The folder as an absolute path without `.` and `..`.
    absolute: PathBuf,
    /// The real paths of all folders.
    real: Vec<PathBuf>,
    /// The same folders as they are written, absolute.
    written: Vec<PathBuf>,
}

/// Where a path leads, links followed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum LeadsTo {
    /// Below one of the folders.
    Within,
    /// Out of the folders.
    Outside,
    /// To nothing that is there.
    Nowhere,
}

impl Root {
    /// The folder of some data with further folders, all of which must exist.
    ///
    /// # Errors
    /// If one does not.
    pub(crate) fn new(folder: &Path, further: &[PathBuf]) -> Result<Self> {
        let folder = if folder.as_os_str().is_empty() {
            Path::new(".")
        } else {
            folder
        };
        let (mut real, mut written) = (Vec::new(), Vec::new());
        let all = std::iter::once(folder).chain(further.iter().map(PathBuf::as_path));
        for (number, folder) in all.enumerate() {
            let place = folder.canonicalize().map_err(|e| match number {
                0 => Error::file(folder, "read", e),
                _ => Error::usage("--data-root", format_args!("{}: {e}", folder.display())),
            })?;
            real.push(place);
            written.push(without_dots(&absolute(folder)));
        }
        Ok(Self {
            absolute: written[0].clone(),
            folder: folder.to_owned(),
            real,
            written,
        })
    }

    /// The folder of the data, as it was given.
    pub(crate) fn folder(&self) -> &Path {
        &self.folder
    }

    /// The name and the path of an image, as data spell it relative to a folder.
    ///
    /// The name of a frame is the normalised path of its image: relative to the folder of the data, with `/`, without `.` and
    /// without `..` after a folder; of an image outside it, the path as it is spelled, without `.`. So one file is one frame with one
    /// noise, however the data spell its path.
    ///
    /// # Errors
    /// As [`Self::file`].
    pub(crate) fn image(&self, base: &Path, spelled: &str) -> Result<(FrameId, PathBuf), String> {
        let file = self.file(base, Path::new(spelled))?;
        let absolute = without_dots(&absolute(&base.join(spelled)));
        let normalized = match absolute.strip_prefix(&self.absolute) {
            Ok(within) => with_slashes(within),
            Err(_) => with_slashes(&without_dots(Path::new(spelled))),
        };
        // After a symbolic link to a folder, `..` leads to another place than the text states. Such a path stays as it is.
        let same = normalized == spelled
            || file.canonicalize().ok() == self.folder.join(&normalized).canonicalize().ok();
        let name = if same { normalized } else { spelled.to_owned() };
        Ok((FrameId(name), file))
    }

    /// The path of a file that data name relative to a folder.
    ///
    /// # Errors
    /// If the name is no path of this machine, leads out of the folders, or no file is there. Whether a file exists outside them is
    /// not told.
    pub(crate) fn file(&self, base: &Path, spelled: &Path) -> Result<PathBuf, String> {
        let path = self.place(base, spelled)?;
        if !path.is_file() {
            return Err(format!("no such file: {}", path.display()));
        }
        Ok(path)
    }

    /// The path of a file that data name relative to a folder, whether or not it exists.
    ///
    /// # Errors
    /// If the name is no path of this machine, or leads out of the folders.
    pub(crate) fn place(&self, base: &Path, spelled: &Path) -> Result<PathBuf, String> {
        check_name(spelled)?;
        let path = base.join(spelled);
        let written = without_dots(&absolute(&path));
        let is_below = |root: &PathBuf| written.starts_with(root);
        if !self.written.iter().chain(&self.real).any(is_below) {
            return Err(self.outside(spelled, &written));
        }
        match path.canonicalize() {
            Ok(real) if !self.holds(&real) => Err(self.outside(spelled, &real)),
            _ => Ok(path),
        }
    }

    /// Where a path that was found in the folder leads, links followed.
    pub(crate) fn leads_to(&self, path: &Path) -> LeadsTo {
        match path.canonicalize() {
            Ok(real) if self.holds(&real) => LeadsTo::Within,
            Ok(_) => LeadsTo::Outside,
            Err(_) => LeadsTo::Nowhere,
        }
    }

    /// Whether a real path lies below one of the folders.
    fn holds(&self, real: &Path) -> bool {
        self.real.iter().any(|root| real.starts_with(root))
    }

    /// Warns of links that lead out of the folders, by the first of them.
    pub(crate) fn warn_of_links_out(&self, links: &[PathBuf]) {
        let Some(first) = links.first() else {
            return;
        };
        let count = match links.len() {
            1 => "1 link leads out of the folder and is not followed".to_owned(),
            n => format!("{n} links lead out of the folder and are not followed"),
        };
        let real = first.canonicalize().unwrap_or_else(|_| first.clone());
        tracing::warn!(
            "{}: {count}: {}; --data-root {} allows the folder that it leads to",
            self.folder.display(),
            first.strip_prefix(&self.folder).unwrap_or(first).display(),
            real.parent().unwrap_or(&real).display()
        );
    }

    fn outside(&self, spelled: &Path, written: &Path) -> String {
        let parent = written.parent().unwrap_or(written);
        let name = self.absolute.file_name().unwrap_or_default();
        format!(
            "{:?} lies outside {}/, the folder of the data; --data-root {} allows the folder that it names",
            spelled.to_string_lossy(),
            name.to_string_lossy(),
            shell_word(&parent.display().to_string())
        )
    }
}

/// Refuses names that are no paths of files.
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

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    /// A folder `set` with an image in a folder and a file beside the set.
    fn scene() -> tempfile::TempDir {
        let scene = tempfile::tempdir().unwrap();
        fs::create_dir_all(scene.path().join("set/fr")).unwrap();
        for file in ["set/fr/a.png", "secret.png"] {
            fs::write(scene.path().join(file), "").unwrap();
        }
        scene
    }

    #[test]
    fn one_file_has_one_name_however_it_is_spelled() {
        let scene = scene();
        let set = scene.path().join("set");
        let root = Root::new(&set, &[]).unwrap();
        let inside = set.join("fr/a.png").display().to_string();
        for spelled in [
            "fr/a.png",
            "./fr//a.png",
            "fr/../fr/a.png",
            "../set/fr/a.png",
            &inside,
        ] {
            let (name, _) = root.image(&set, spelled).unwrap();
            assert_eq!(name.0, "fr/a.png", "{spelled}");
        }
        let (name, _) = root.image(&set.join("fr"), "a.png").unwrap();
        assert_eq!(name.0, "fr/a.png");
    }

    #[test]
    fn what_lies_outside_is_refused_unless_the_user_names_its_folder() {
        let scene = scene();
        let set = scene.path().join("set");
        let root = Root::new(&set, &[]).unwrap();
        let secret = scene.path().join("secret.png").display().to_string();
        let missing = scene.path().join("nothing.png").display().to_string();
        for spelled in [
            "../secret.png",
            "fr/../../secret.png",
            &secret,
            "../nothing.png",
            &missing,
            "/etc/passwd",
        ] {
            let problem = root.image(&set, spelled).unwrap_err();
            assert!(
                problem.contains("lies outside set/") && problem.contains("--data-root "),
                "{problem}"
            );
        }
        let allowed = Root::new(&set, &[scene.path().to_owned()]).unwrap();
        assert_eq!(
            allowed.image(&set, "../secret.png").unwrap().0.0,
            "../secret.png"
        );
        assert!(allowed.image(&set, "/etc/passwd").is_err());
        let problem = Root::new(&set, &[scene.path().join("none")]).unwrap_err();
        assert!(
            problem.to_string().starts_with("--data-root: "),
            "{problem}"
        );
    }

    #[test]
    fn names_that_are_no_paths_are_refused() {
        let scene = scene();
        let root = Root::new(scene.path(), &[]).unwrap();
        for (spelled, says) in [
            ("", "empty"),
            ("a\0b", "zero byte"),
            ("https://example.org/a.png", "download them first"),
            ("File:///etc/passwd", "download them first"),
            ("set/none.png", "no such file"),
            ("set", "no such file"),
        ] {
            let problem = root.image(scene.path(), spelled).unwrap_err();
            assert!(problem.contains(says), "{spelled:?}: {problem}");
        }
    }

    #[cfg(unix)]
    #[test]
    fn links_are_followed_before_a_path_is_judged() {
        let scene = scene();
        let (set, link) = (
            scene.path().join("set"),
            std::os::unix::fs::symlink::<PathBuf, PathBuf>,
        );
        link(scene.path().join("secret.png"), set.join("out.png")).unwrap();
        link(set.join("fr"), set.join("inner")).unwrap();
        fs::create_dir_all(scene.path().join("far/deep")).unwrap();
        link(scene.path().join("far/deep"), set.join("far")).unwrap();
        fs::write(scene.path().join("far/b.png"), "").unwrap();
        let root = Root::new(&set, &[]).unwrap();
        assert!(
            root.image(&set, "out.png")
                .unwrap_err()
                .contains("lies outside")
        );
        assert!(
            root.image(&set, "far/../b.png")
                .unwrap_err()
                .contains("lies outside")
        );
        assert_eq!(root.image(&set, "inner/a.png").unwrap().0.0, "inner/a.png");
        // The folder of the data may itself be reached by a link.
        link(set.clone(), scene.path().join("alias")).unwrap();
        let alias = scene.path().join("alias");
        assert!(
            Root::new(&alias, &[])
                .unwrap()
                .image(&alias, "fr/a.png")
                .is_ok()
        );
    }
}
