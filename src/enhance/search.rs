//! Search for ONNX Runtime's library on this machine: [`Surroundings::candidates`].

use std::cmp::Reverse;
use std::collections::HashSet;
use std::env::{self, consts};
use std::path::{Path, PathBuf};

use super::library::{PINNED, is_library_name};

/// Folders and variables of the process that decide where a library is searched.
#[derive(Debug, Clone, Default)]
pub(super) struct Surroundings {
    /// Folder of the running program.
    pub(super) program: Option<PathBuf>,
    /// Cache folder of the user.
    pub(super) cache: Option<PathBuf>,
    /// `VIRTUAL_ENV`: the active Python environment.
    pub(super) virtual_env: Option<PathBuf>,
    /// Folders of the variable `PATH`.
    pub(super) path: Vec<PathBuf>,
    /// Home folder of the user.
    pub(super) home: Option<PathBuf>,
    /// Library folders of the system.
    pub(super) system: Vec<PathBuf>,
}

impl Surroundings {
    /// The surroundings of this process.
    pub(super) fn of_this_process() -> Self {
        let folder = |name| {
            env::var_os(name)
                .map(PathBuf::from)
                .filter(|p| p.is_absolute())
        };
        let folders = |name| -> Vec<PathBuf> {
            env::var_os(name)
                .map(|value| env::split_paths(&value).collect())
                .unwrap_or_default()
        };
        let home = folder("HOME");
        let cache = match consts::OS {
            "windows" => folder("LOCALAPPDATA"),
            "macos" => home.as_ref().map(|home| home.join("Library/Caches")),
            _ => folder("XDG_CACHE_HOME").or_else(|| home.as_ref().map(|home| home.join(".cache"))),
        };
        let mut system = folders(match consts::OS {
            "macos" => "DYLD_LIBRARY_PATH",
            _ => "LD_LIBRARY_PATH",
        });
        system.extend(system_folders());
        Self {
            program: env::current_exe()
                .ok()
                .and_then(|program| program.parent().map(Path::to_owned)),
            cache,
            virtual_env: folder("VIRTUAL_ENV"),
            path: folders("PATH"),
            home,
            system,
        }
    }

    /// Folder of the cache for a library of the pinned version; `None` if there is no cache folder.
    pub(super) fn installed(&self) -> Option<PathBuf> {
        let cache = self.cache.as_ref()?;
        Some(cache.join("darkqa-eval").join("onnxruntime").join(PINNED))
    }

    /// Files with the library's name, in the order in which they are tried: beside the program, in the cache, in Python
    /// environments, in the system's folders.
    pub(super) fn candidates(&self) -> Vec<PathBuf> {
        let folders = self
            .program
            .iter()
            .cloned()
            .chain(self.installed())
            .chain(self.python_packages())
            .chain(self.system.iter().cloned());
        let mut seen = HashSet::new();
        folders
            .flat_map(|folder| libraries_in(&folder))
            .filter(|path| {
                // Several names often link to one library.
                seen.insert(path.canonicalize().unwrap_or_else(|_| path.clone()))
            })
            .collect()
    }

    /// The `onnxruntime/capi` folders of the Python environments on `PATH`; no Python is run.
    fn python_packages(&self) -> Vec<PathBuf> {
        let mut prefixes: Vec<PathBuf> = self.virtual_env.iter().cloned().collect();
        for folder in &self.path {
            for name in ["python3", "python", "python3.exe", "python.exe"] {
                let python = folder.join(name);
                if !python.is_file() {
                    continue;
                }
                // The Python of a virtual environment is a link to the one it was created from.
                let target = python.canonicalize().unwrap_or_else(|_| python.clone());
                for python in [python, target] {
                    // On Windows it is at the top of an installation, or in its `Scripts`.
                    prefixes.extend(python.ancestors().skip(1).take(2).map(Path::to_owned));
                }
            }
        }
        prefixes.extend(self.home.iter().map(|home| home.join(".local")));
        prefixes
            .iter()
            .flat_map(|prefix| packages_in(prefix))
            .collect()
    }
}

/// The `onnxruntime/capi` folders under one installation prefix of Python.
fn packages_in(prefix: &Path) -> Vec<PathBuf> {
    let mut roots = vec![prefix.join("Lib")];
    for lib in ["lib", "lib64", "local/lib"] {
        let versions = sorted_entries(&prefix.join(lib));
        roots.extend(versions.into_iter().filter(|path| {
            path.file_name()
                .is_some_and(|name| name.to_string_lossy().starts_with("python3"))
        }));
    }
    let packages = ["site-packages", "dist-packages"];
    roots
        .iter()
        .flat_map(|root| packages.map(|name| root.join(name).join("onnxruntime").join("capi")))
        .filter(|folder| folder.is_dir())
        .collect()
}

/// Libraries in one folder, by the version in their names, the newest first, one without a version last.
fn libraries_in(folder: &Path) -> Vec<PathBuf> {
    let mut found: Vec<(Reverse<Vec<u32>>, PathBuf)> = sorted_entries(folder)
        .into_iter()
        .filter_map(|path| {
            let name = path.file_name()?.to_str()?;
            is_library_name(consts::OS, name).then(|| {
                let numbers = name.split('.').filter_map(|part| part.parse().ok());
                (Reverse(numbers.collect()), path.clone())
            })
        })
        .collect();
    found.sort();
    found.into_iter().map(|(_, path)| path).collect()
}

/// Paths in a folder, sorted; empty if it cannot be read.
fn sorted_entries(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).into_iter().flatten();
    let mut paths: Vec<PathBuf> = entries.filter_map(|e| Some(e.ok()?.path())).collect();
    paths.sort();
    paths
}

/// Folders in which this operating system keeps its libraries.
///
/// On Windows there are none: the library in `System32` belongs to Windows, and Microsoft asks others not to use it.
fn system_folders() -> Vec<PathBuf> {
    let folders: Vec<String> = match consts::OS {
        "windows" => Vec::new(),
        "macos" => vec!["/usr/local/lib".into(), "/opt/homebrew/lib".into()],
        _ => ["/usr/local/lib", "/usr/lib", "/lib"]
            .iter()
            .flat_map(|folder| {
                let arch = consts::ARCH;
                [
                    (*folder).to_owned(),
                    format!("{folder}/{arch}-linux-gnu"),
                    format!("{folder}64"),
                ]
            })
            .collect(),
    };
    folders.into_iter().map(PathBuf::from).collect()
}

#[cfg(all(test, unix, not(target_os = "macos")))]
mod tests {
    use super::*;

    /// Creates an empty file and the folders above it.
    fn touch(path: &Path) {
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, "").unwrap();
    }

    #[test]
    fn candidates_come_in_order() {
        let root = tempfile::tempdir().unwrap();
        let root = root.path().canonicalize().unwrap();
        let at = |name: &str| root.join(name);
        let expected: Vec<PathBuf> = [
            "program/libonnxruntime.so.1.20.0",
            "program/libonnxruntime.so",
            "cache/darkqa-eval/onnxruntime/1.31.1/libonnxruntime.so.1.31.1",
            "venv/lib/python3.12/site-packages/onnxruntime/capi/libonnxruntime.so.1.22.0",
            "usr/lib/python3/dist-packages/onnxruntime/capi/libonnxruntime.so.1.18.0",
            "home/.local/lib/python3.11/site-packages/onnxruntime/capi/libonnxruntime.so.1.19.0",
            "system/libonnxruntime.so.1.17.0",
        ]
        .map(at)
        .to_vec();
        for path in &expected {
            touch(path);
        }
        touch(&at("system/libonnxruntime_providers_shared.so"));
        touch(&at("usr/bin/python3"));
        let surroundings = Surroundings {
            program: Some(at("program")),
            cache: Some(at("cache")),
            virtual_env: Some(at("venv")),
            path: vec![at("missing"), at("usr/bin")],
            home: Some(at("home")),
            system: vec![at("system")],
        };
        assert_eq!(surroundings.candidates(), expected);
    }

    #[test]
    fn a_virtual_environment_on_the_path_is_searched_before_its_base() {
        let root = tempfile::tempdir().unwrap();
        let root = root.path().canonicalize().unwrap();
        let capi = "lib/python3.12/site-packages/onnxruntime/capi/libonnxruntime.so.1.31.1";
        let expected = [root.join("venv").join(capi), root.join("base").join(capi)];
        for path in &expected {
            touch(path);
        }
        touch(&root.join("base/bin/python3.12"));
        std::fs::create_dir_all(root.join("venv/bin")).unwrap();
        std::os::unix::fs::symlink(
            root.join("base/bin/python3.12"),
            root.join("venv/bin/python"),
        )
        .unwrap();
        let surroundings = Surroundings {
            path: vec![root.join("venv/bin")],
            ..Surroundings::default()
        };
        assert_eq!(surroundings.candidates(), expected);
    }

    #[test]
    fn one_library_under_two_names_is_tried_once() {
        let root = tempfile::tempdir().unwrap();
        let library = root.path().join("libonnxruntime.so.1.31.1");
        touch(&library);
        std::os::unix::fs::symlink(&library, root.path().join("libonnxruntime.so.1")).unwrap();
        let surroundings = Surroundings {
            system: vec![root.path().to_owned()],
            ..Surroundings::default()
        };
        assert_eq!(surroundings.candidates(), [library]);
    }
}
