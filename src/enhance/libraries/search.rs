//! Search for the ONNX Runtime library on this machine: [`SearchFolders::candidates`].

use std::cmp::Reverse;
use std::collections::HashSet;
use std::env::{self, consts};
use std::fmt;
use std::path::{Path, PathBuf};

use super::library_file::{PINNED, is_library_name};

/// Folders of this process that are searched for a library, directly or in their subfolders.
#[derive(Debug, Clone, Default)]
pub(super) struct SearchFolders {
    /// Folder of the running program, with links resolved, so that its Python environment is found from a link
    /// elsewhere.
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

/// Place in which a library is searched, in the order of the search.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum LibraryPlace {
    /// The folder of the program.
    Program,
    /// The packages of the Python environment that the program is installed in.
    Environment,
    /// The user's cache, into which this program installs it.
    Cache,
    /// The packages of the active Python environment and of those on `PATH`.
    Python,
    /// The folders of the system.
    System,
}

impl LibraryPlace {
    /// All places, in the order of the search. The folders of the program come first, so that jobs on a cluster need no
    /// setting.
    pub(super) const ALL: [Self; 5] = [Self::Program, Self::Environment, Self::Cache, Self::Python, Self::System];
}

impl fmt::Display for LibraryPlace {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Program => "next to the program",
            Self::Environment => "in the Python environment of the program",
            Self::Cache => "in the user's cache folder",
            Self::Python => "in the Python environments on PATH",
            Self::System => "in the folders of the system",
        })
    }
}

impl SearchFolders {
    /// Search folders from the environment variables of this process.
    pub(super) fn from_this_process() -> Self {
        let home = folder_variable("HOME");
        let cache = match consts::OS {
            "windows" => folder_variable("LOCALAPPDATA"),
            "macos" => home.as_ref().map(|home| home.join("Library/Caches")),
            _ => folder_variable("XDG_CACHE_HOME").or_else(|| home.as_ref().map(|home| home.join(".cache"))),
        };
        let mut system = path_variable(match consts::OS {
            "macos" => "DYLD_LIBRARY_PATH",
            _ => "LD_LIBRARY_PATH",
        });
        system.extend(system_folders());
        Self {
            // On macOS, `current_exe` can return a link.
            program: env::current_exe()
                .and_then(|program| program.canonicalize())
                .ok()
                .and_then(|program| program.parent().map(Path::to_owned)),
            cache,
            virtual_env: folder_variable("VIRTUAL_ENV"),
            path: path_variable("PATH"),
            home,
            system,
        }
    }

    /// Folder for the library of the pinned version in the user's cache; `None` without a cache folder.
    pub(super) fn cached_library_folder(&self) -> Option<PathBuf> {
        let cache = self.cache.as_ref()?;
        Some(cache.join("darkqa-eval").join("onnxruntime").join(PINNED))
    }

    /// Files with the library's name, each with its place, in the order in which they are tried.
    pub(super) fn candidates(&self) -> Vec<(LibraryPlace, PathBuf)> {
        let mut seen = HashSet::new();
        LibraryPlace::ALL
            .into_iter()
            .flat_map(|place| {
                self.folders(place)
                    .into_iter()
                    .flat_map(move |folder| libraries_in(&folder).into_iter().map(move |path| (place, path)))
            })
            .filter(|(_, path)| {
                // One library often has several names, which are links.
                seen.insert(path.canonicalize().unwrap_or_else(|_| path.clone()))
            })
            .collect()
    }

    /// Folders of Python packages of ONNX Runtime without a separate library. Before version 1.19, the library is part
    /// of the Python module.
    pub(super) fn packages_without_library(&self) -> Vec<PathBuf> {
        let mut empty: Vec<PathBuf> = [LibraryPlace::Environment, LibraryPlace::Python]
            .into_iter()
            .flat_map(|place| self.folders(place))
            .filter(|folder| libraries_in(folder).is_empty())
            .collect();
        empty.dedup();
        empty
    }

    /// Folders that are searched in a place.
    fn folders(&self, place: LibraryPlace) -> Vec<PathBuf> {
        match place {
            LibraryPlace::Program => self.program.iter().cloned().collect(),
            LibraryPlace::Environment => self.program.as_deref().map_or_else(Vec::new, packages_of_program),
            LibraryPlace::Cache => self.cached_library_folder().into_iter().collect(),
            LibraryPlace::Python => self.python_packages(),
            LibraryPlace::System => self.system.clone(),
        }
    }

    /// The `onnxruntime/capi` folders of the active Python environment and of those on `PATH`, found without running
    /// Python.
    fn python_packages(&self) -> Vec<PathBuf> {
        let mut prefixes: Vec<PathBuf> = self.virtual_env.iter().cloned().collect();
        for folder in &self.path {
            for name in ["python3", "python", "python3.exe", "python.exe"] {
                let python = folder.join(name);
                if !python.is_file() {
                    continue;
                }
                // The Python of a virtual environment is a link to that of the base installation.
                let target = python.canonicalize().unwrap_or_else(|_| python.clone());
                for python in [python, target] {
                    // On Windows, Python is at the top of an installation, or in its `Scripts`.
                    prefixes.extend(python.ancestors().skip(1).take(2).map(Path::to_owned));
                }
            }
        }
        prefixes.extend(self.home.iter().map(|home| home.join(".local")));
        prefixes.iter().flat_map(|prefix| packages_in(prefix)).collect()
    }
}

/// Absolute folder in an environment variable; `None` if it is unset or relative.
fn folder_variable(name: &str) -> Option<PathBuf> {
    env::var_os(name).map(PathBuf::from).filter(|path| path.is_absolute())
}

/// Folders in an environment variable that lists several, such as `PATH`.
fn path_variable(name: &str) -> Vec<PathBuf> {
    env::var_os(name).map(|value| env::split_paths(&value).collect()).unwrap_or_default()
}

/// The `onnxruntime/capi` folders of the environment in which the program is installed, active or not. For the program
/// `P/bin/darkqa-eval`, packages are in `P/lib/python3.12/site-packages` (on Windows, `P\Scripts` and
/// `P\Lib\site-packages`), or in `P` after `pip install --target`.
fn packages_of_program(program: &Path) -> Vec<PathBuf> {
    let Some(prefix) = program.parent() else {
        return Vec::new();
    };
    let mut packages = packages_in(prefix);
    packages.extend(Some(prefix.join("onnxruntime").join("capi")).filter(|target| target.is_dir()));
    packages
}

/// The `onnxruntime/capi` folders under one installation prefix, for the newest version of Python first.
fn packages_in(prefix: &Path) -> Vec<PathBuf> {
    let mut roots = vec![prefix.join("Lib")];
    for lib in ["lib", "lib64", "local/lib"] {
        let mut versions: Vec<(Reverse<u32>, PathBuf)> = sorted_entries(&prefix.join(lib))
            .into_iter()
            .filter_map(|path| {
                let version = path.file_name()?.to_str()?.strip_prefix("python3")?;
                // Debian's folder for all versions, `python3`, counts as the oldest.
                let minor = version.trim_start_matches('.').parse().unwrap_or(0);
                Some((Reverse(minor), path))
            })
            .collect();
        versions.sort();
        roots.extend(versions.into_iter().map(|(_, path)| path));
    }
    roots
        .iter()
        .flat_map(|root| {
            ["site-packages", "dist-packages"].map(|name| root.join(name).join("onnxruntime").join("capi"))
        })
        .filter(|folder| folder.is_dir())
        .collect()
}

/// Libraries in one folder, sorted by the version in their names: newest first, without a version last.
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
    let mut paths: Vec<PathBuf> =
        std::fs::read_dir(folder).into_iter().flatten().filter_map(|e| Some(e.ok()?.path())).collect();
    paths.sort();
    paths
}

/// Library folders of this operating system.
///
/// None on Windows, because the library in `System32` is reserved for Windows itself.
fn system_folders() -> Vec<PathBuf> {
    let folders: Vec<String> = match consts::OS {
        "windows" => Vec::new(),
        "macos" => vec!["/usr/local/lib".into(), "/opt/homebrew/lib".into()],
        _ => ["/usr/local/lib", "/usr/lib", "/lib"]
            .iter()
            .flat_map(|folder| {
                let arch = consts::ARCH;
                [(*folder).to_owned(), format!("{folder}/{arch}-linux-gnu"), format!("{folder}64")]
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

    fn paths(folders: &SearchFolders) -> Vec<PathBuf> {
        folders.candidates().into_iter().map(|(_, path)| path).collect()
    }

    #[test]
    fn candidates_come_in_order() {
        let root = tempfile::tempdir().unwrap();
        let root = root.path().canonicalize().unwrap();
        let expected: Vec<PathBuf> = [
            "env/bin/libonnxruntime.so.1.20.0",
            "env/bin/libonnxruntime.so",
            "env/lib/python3.12/site-packages/onnxruntime/capi/libonnxruntime.so.1.22.1",
            "env/lib/python3.9/site-packages/onnxruntime/capi/libonnxruntime.so.1.31.1",
            "env/lib/python3/dist-packages/onnxruntime/capi/libonnxruntime.so.1.17.3",
            "env/onnxruntime/capi/libonnxruntime.so.1.21.0",
            "cache/darkqa-eval/onnxruntime/1.31.1/libonnxruntime.so.1.31.1",
            "venv/lib/python3.12/site-packages/onnxruntime/capi/libonnxruntime.so.1.22.0",
            "usr/lib/python3/dist-packages/onnxruntime/capi/libonnxruntime.so.1.18.0",
            "home/.local/lib/python3.11/site-packages/onnxruntime/capi/libonnxruntime.so.1.19.0",
            "system/libonnxruntime.so.1.17.0",
        ]
        .map(|name| root.join(name))
        .to_vec();
        for path in &expected {
            touch(path);
        }
        touch(&root.join("system/libonnxruntime_providers_shared.so"));
        touch(&root.join("usr/bin/python3"));
        let folders = SearchFolders {
            program: Some(root.join("env/bin")),
            cache: Some(root.join("cache")),
            virtual_env: Some(root.join("venv")),
            path: vec![root.join("missing"), root.join("usr/bin")],
            home: Some(root.join("home")),
            system: vec![root.join("system")],
        };
        assert_eq!(paths(&folders), expected);
    }

    #[test]
    fn virtual_environment_is_searched_before_its_base() {
        let root = tempfile::tempdir().unwrap();
        let root = root.path().canonicalize().unwrap();
        let capi = "lib/python3.12/site-packages/onnxruntime/capi/libonnxruntime.so.1.31.1";
        let expected = [root.join("venv").join(capi), root.join("base").join(capi)];
        for path in &expected {
            touch(path);
        }
        touch(&root.join("base/bin/python3.12"));
        std::fs::create_dir_all(root.join("venv/bin")).unwrap();
        std::os::unix::fs::symlink(root.join("base/bin/python3.12"), root.join("venv/bin/python")).unwrap();
        let folders = SearchFolders { path: vec![root.join("venv/bin")], ..SearchFolders::default() };
        assert_eq!(paths(&folders), expected);
    }

    #[test]
    fn packages_without_a_library_are_listed() {
        let root = tempfile::tempdir().unwrap();
        let capi = root.path().join("lib/python3.12/site-packages/onnxruntime/capi");
        touch(&capi.join("onnxruntime_pybind11_state.so"));
        let folders = SearchFolders { program: Some(root.path().join("bin")), ..SearchFolders::default() };
        assert_eq!(folders.packages_without_library(), std::slice::from_ref(&capi));
        touch(&capi.join("libonnxruntime.so.1.19.0"));
        assert!(folders.packages_without_library().is_empty());
    }

    #[test]
    fn library_with_two_names_is_tried_once() {
        let root = tempfile::tempdir().unwrap();
        let library = root.path().join("libonnxruntime.so.1.31.1");
        touch(&library);
        std::os::unix::fs::symlink(&library, root.path().join("libonnxruntime.so.1")).unwrap();
        let folders = SearchFolders { system: vec![root.path().to_owned()], ..SearchFolders::default() };
        assert_eq!(paths(&folders), [library]);
    }
}
