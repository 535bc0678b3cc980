//! Finds or installs the library of ONNX Runtime, and opens it: [`RuntimeSearch::open`], [`Runtime`].
//!
//! A process can load only one ONNX Runtime, so later calls of `open` return the first one.
//!
//! Released builds send telemetry to Microsoft by default. The C API can disable telemetry only after the library has
//! reported the start of the process and written an identifier to the user's cache folder (seen with 1.31.1 on Linux).
//! The environment variable [`TELEMETRY_SWITCH`] takes effect earlier, so programs must call [`disable_telemetry`]
//! first.

use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use ort::environment::Environment;
use ort::logging::LogLevel;

use darkqa_base::error::{Error, Result};

use super::install::{Pin, check_installed, install};
use super::library::{OLDEST, PINNED, probe};
use super::runtime_thread::RuntimeThread;
use super::search::{LibraryPlace, SearchFolders};

/// Whether the library may be installed if it is not found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Install {
    /// Install it with pip into the user's cache folder, once.
    Allowed,
    /// Do not install it (`--llie-options offline`).
    Offline,
}

/// Search for the library of ONNX Runtime.
#[derive(Debug, Clone)]
pub struct RuntimeSearch {
    /// Library to use (`--llie-options ort-lib`, `ORT_DYLIB_PATH`); if set, no other is tried.
    pub library: Option<PathBuf>,
    /// Whether the library may be installed if it is not found.
    pub install: Install,
}

/// The open ONNX Runtime. Clones share the library and the thread.
#[derive(Clone)]
pub struct Runtime(Arc<OpenRuntime>);

struct OpenRuntime {
    path: PathBuf,
    version: String,
    /// Where the library was found, such as `beside the program`.
    place: String,
    environment: Environment,
    thread: RuntimeThread,
}

/// Environment variable that disables ONNX Runtime's telemetry from the start if its value is `1`.
const TELEMETRY_SWITCH: &str = "ORT_DISABLE_TELEMETRY";

/// Sets [`TELEMETRY_SWITCH`] for this process, so that ONNX Runtime sends no telemetry and writes no identifier.
///
/// # Safety
/// No other thread of the process may be running: C code in another thread could read the environment while it changes.
#[expect(unsafe_code, reason = "there is no other way to switch off telemetry before ONNX Runtime starts")]
pub unsafe fn disable_telemetry() {
    // SAFETY: the caller guarantees that no other thread is running, so none can read the environment during the
    // change.
    unsafe { std::env::set_var(TELEMETRY_SWITCH, "1") };
}

/// The runtime of this process; `None` until it is opened.
static OPEN: Mutex<Option<Runtime>> = Mutex::new(None);

impl RuntimeSearch {
    /// Opens the library at `self.library`. If no library is named, opens the first usable one in the places of
    /// [`LibraryPlace`]. If no place has one, installs version 1.31.1 with pip, unless [`Install::Offline`] forbids it.
    ///
    /// # Errors
    /// If the named library is not usable, or if no library was found and none could be installed. The message lists
    /// the places tried and the remedies.
    pub fn open(&self) -> Result<Runtime> {
        // The lock is kept until the function returns, so that a second thread waits while the first one installs the
        // library.
        let mut open = OPEN.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(runtime) = open.as_ref() {
            return self.check_same(runtime);
        }
        let found = match &self.library {
            Some(named) => {
                // An absolute path, because the system's loader would search for a bare file name in its own folders.
                let path = std::path::absolute(named).unwrap_or_else(|_| named.clone());
                let version = probe(&path).map_err(|e| unusable_library(&path, &e))?;
                let place = "named by --llie-options ort-lib or ORT_DYLIB_PATH".to_owned();
                FoundLibrary { path, version, place }
            }
            None => find(&SearchFolders::from_this_process(), self.install)?,
        };
        let runtime = Runtime::start(found)?;
        Ok(open.insert(runtime).clone())
    }

    /// Returns the open runtime.
    ///
    /// # Errors
    /// If `self.library` is another library than the open one.
    fn check_same(&self, runtime: &Runtime) -> Result<Runtime> {
        match &self.library {
            Some(path) if resolve(path) != resolve(runtime.path()) => Err(unusable_library(
                path,
                &format!("cannot be loaded, because this process has already loaded {}", runtime.path().display()),
            )),
            _ => Ok(runtime.clone()),
        }
    }
}

/// The path without links; unchanged if the file does not exist.
fn resolve(path: &Path) -> PathBuf {
    path.canonicalize().unwrap_or_else(|_| path.to_owned())
}

/// A usable library that is not open yet.
#[derive(Debug)]
struct FoundLibrary {
    path: PathBuf,
    version: String,
    /// Where the library was found, such as `beside the program`.
    place: String,
}

/// Returns the first usable library of the candidates; otherwise installs one if allowed.
fn find(folders: &SearchFolders, policy: Install) -> Result<FoundLibrary> {
    let mut rejected = Vec::new();
    for (place, path) in folders.candidates() {
        match check(place, &path) {
            Ok(version) => {
                let place = place.to_string();
                return Ok(FoundLibrary { path, version, place });
            }
            Err(problem) if place == LibraryPlace::Cache && policy == Install::Allowed => {
                rejected.push(format!("{} {problem}", path.display()));
                // Reinstall a broken library in the cache: a later candidate may have another version.
                match install_into_cache(folders, &rejected) {
                    Ok(found) => return Ok(found),
                    Err(problem) => tracing::warn!("ONNX Runtime cannot be reinstalled: {problem}"),
                }
            }
            Err(problem) => {
                tracing::debug!("{} {problem}", path.display());
                rejected.push(format!("{} {problem}", path.display()));
            }
        }
    }
    rejected.extend(folders.packages_without_library().iter().map(|folder| {
        let folder = folder.display();
        format!("{folder} has no library; packages since version 1.19 have one")
    }));
    let installed = match policy {
        Install::Offline => Err("--llie-options offline forbids installing it".to_owned()),
        Install::Allowed => install_into_cache(folders, &rejected),
    };
    installed.map_err(|problem| Error::Runtime(not_found_message(&problem, &rejected)))
}

/// Checks a candidate and returns its version. The pinned library in the cache must also match its installation
/// receipt.
fn check(place: LibraryPlace, path: &Path) -> Result<String, String> {
    if place == LibraryPlace::Cache
        && let Some(pin) = Pin::for_this_platform()
        && pin.matches_name(path)
    {
        check_installed(path, pin)?;
    }
    probe(path)
}

/// Installs the pinned library into the cache.
fn install_into_cache(folders: &SearchFolders, rejected: &[String]) -> Result<FoundLibrary, String> {
    let pin = Pin::for_this_platform()
        .ok_or_else(|| format!("no library is known for {} {}", std::env::consts::OS, std::env::consts::ARCH))?;
    let folder = folders.cached_library_folder().ok_or_else(|| {
        let variables = match std::env::consts::OS {
            "windows" => "LOCALAPPDATA is not set",
            "macos" => "HOME is not set",
            _ => "neither XDG_CACHE_HOME nor HOME is set",
        };
        format!("{variables}, so there is no cache folder to install it into")
    })?;
    tracing::warn!(
        "no usable ONNX Runtime was found{}; installing version {PINNED} with pip, once, into {}",
        skipped_note(rejected),
        folder.display()
    );
    let path = install(pin, &folder)?;
    let version = probe(&path).map_err(|e| format!("{} {e}", path.display()))?;
    let place = LibraryPlace::Cache.to_string();
    Ok(FoundLibrary { path, version, place })
}

/// Note in brackets with the rejected libraries and packages and their problems; empty if none was rejected.
fn skipped_note(rejected: &[String]) -> String {
    match rejected {
        [] => String::new(),
        rejected => format!(" (skipped: {})", rejected.join("; ")),
    }
}

/// Error message for a missing library, with the places tried and the remedies.
fn not_found_message(problem: &str, rejected: &[String]) -> String {
    let skipped = skipped_note(rejected);
    let places = LibraryPlace::ALL.map(|place| place.to_string()).join(", ");
    format!(
        "no library was found{skipped}, and {problem}. Run `pip install onnxruntime=={PINNED}`, or name a library of 1.{OLDEST} or later with --llie-options ort-lib=FILE or ORT_DYLIB_PATH, or allow its installation (pip on PATH, a package index, no --llie-options offline). Searched: {places}"
    )
}

fn unusable_library(path: &Path, problem: &str) -> Error {
    Error::Runtime(format!(
        "{} {problem}; name a library of 1.{OLDEST} or later with --llie-options ort-lib=FILE or ORT_DYLIB_PATH, or leave both out to search for one",
        path.display()
    ))
}

fn start_error(path: &Path, error: impl fmt::Display) -> Error {
    Error::Runtime(format!("{}: {error}", path.display()))
}

impl Runtime {
    /// Loads a library that [`probe`] accepted, and starts its thread.
    fn start(found: FoundLibrary) -> Result<Self> {
        let FoundLibrary { path, version, place } = found;
        if std::env::var_os(TELEMETRY_SWITCH).is_none_or(|value| value != "1") {
            tracing::warn!(
                "ONNX Runtime may report its use to Microsoft; set {TELEMETRY_SWITCH}=1 in the environment to forbid it"
            );
        }
        // Logged at debug level only, because ONNX Runtime also returns its errors to the caller.
        let logger = Arc::new(|level, _: &str, _: &str, place: &str, message: &str| {
            if matches!(level, LogLevel::Warning | LogLevel::Error | LogLevel::Fatal) {
                tracing::debug!("ONNX Runtime, {place}: {message}");
            }
        });
        let environment = ort::init_from(&path)
            .map_err(|e| start_error(&path, e))?
            .with_telemetry(false)
            .with_logger(logger)
            .build()
            .map_err(|e| start_error(&path, e))?;
        environment.set_log_level(LogLevel::Warning);
        let thread = RuntimeThread::start().map_err(|e| start_error(&path, e))?;
        tracing::debug!("ONNX Runtime {version} from {}", path.display());
        Ok(Self(Arc::new(OpenRuntime { path, version, place, environment, thread })))
    }

    /// The same library with a second thread, so that the sessions of both threads run in parallel.
    ///
    /// The first thread starts the second one, which on Linux then inherits the CPU setting that treats subnormal
    /// numbers as zero. On other systems, subnormal numbers may slow the second thread down, but its results have the
    /// same bytes.
    pub(crate) fn with_new_thread(&self) -> Result<Self> {
        let thread = self.0.thread.run(RuntimeThread::start)?.map_err(|e| Error::Runtime(e.to_string()))?;
        Ok(Self(Arc::new(OpenRuntime {
            path: self.0.path.clone(),
            version: self.0.version.clone(),
            place: self.0.place.clone(),
            environment: self.0.environment.clone(),
            thread,
        })))
    }

    /// Path of the library file.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.0.path
    }

    /// Version of the library, such as `1.31.1`.
    #[must_use]
    pub fn version(&self) -> &str {
        &self.0.version
    }

    /// Where the library was found, such as `beside the program`.
    pub(crate) fn place(&self) -> &str {
        &self.0.place
    }

    pub(crate) fn environment(&self) -> &Environment {
        &self.0.environment
    }

    /// The thread that creates and runs the sessions.
    pub(crate) fn thread(&self) -> &RuntimeThread {
        &self.0.thread
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn missing_library_message_lists_remedies() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("libonnxruntime.so"), "text").unwrap();
        let folders = SearchFolders { system: vec![folder.path().to_owned()], ..SearchFolders::default() };
        let message = find(&folders, Install::Offline).unwrap_err().to_string();
        for part in ["--llie-options offline", "--llie-options ort-lib", "pip install onnxruntime==1.31.1"] {
            assert!(message.contains(part), "{message}");
        }
        if cfg!(target_os = "linux") {
            assert!(message.contains("skipped"), "{message}");
        }
    }

    #[test]
    fn missing_cache_folder_is_an_error() {
        let error = find(&SearchFolders::default(), Install::Allowed).unwrap_err();
        let message = error.to_string();
        assert!(message.contains("no cache folder"), "{message}");
    }

    #[test]
    fn unusable_named_library_is_an_error() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("missing.so");
        let search = RuntimeSearch { library: Some(path.clone()), install: Install::Allowed };
        let message = search.open().err().unwrap().to_string();
        assert!(message.contains(&path.display().to_string()), "{message}");
        assert!(message.contains("--llie-options ort-lib"), "{message}");
    }
}
