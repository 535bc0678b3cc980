//! ONNX Runtime's library, found or installed, and opened: [`RuntimeSearch::open`], [`Runtime`].
//!
//! A process has one ONNX Runtime, so every later call of `open` returns the first one.
//!
//! Released builds send telemetry to Microsoft by default. The C API can switch it off only after the library has reported
//! the start of the process and left an identifier in the user's cache folder (seen with 1.31.1 on Linux). The environment
//! variable [`TELEMETRY_SWITCH`] acts before that, so programs must call [`forbid_telemetry`] first.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use ort::environment::Environment;
use ort::logging::LogLevel;

use darkqa_ground::error::{Error, Result};

use super::install::{Pin, check_installed, install};
use super::library::{OLDEST, PINNED, probe};
use super::runtime_thread::RuntimeThread;
use super::search::{LibraryPlace, Surroundings};

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

/// The opened ONNX Runtime. Clones share it.
#[derive(Clone)]
pub struct Runtime(Arc<OpenRuntime>);

struct OpenRuntime {
    path: PathBuf,
    version: String,
    /// Where it was found, as `beside the program`.
    place: String,
    environment: Environment,
    thread: RuntimeThread,
}

/// Environment variable that switches off ONNX Runtime's telemetry from the start if it is `1`.
const TELEMETRY_SWITCH: &str = "ORT_DISABLE_TELEMETRY";

/// Sets [`TELEMETRY_SWITCH`] for this process, so that ONNX Runtime sends nothing and leaves no identifier behind.
///
/// # Safety
/// No other thread of the process may be running, because the environment must not change while C code may read it.
#[expect(
    unsafe_code,
    reason = "there is no other way to switch off telemetry before ONNX Runtime starts"
)]
pub unsafe fn forbid_telemetry() {
    // SAFETY: the caller guarantees that no other thread could read the environment meanwhile.
    unsafe { std::env::set_var(TELEMETRY_SWITCH, "1") };
}

/// The runtime of this process; `None` until it is opened.
static OPEN: Mutex<Option<Runtime>> = Mutex::new(None);

impl RuntimeSearch {
    /// Opens the named library. Without a name, it opens the first usable one in the places of [`LibraryPlace`]; if there is none, it
    /// installs version 1.31.1 with pip, if allowed.
    ///
    /// # Errors
    /// If the named library is not usable, or none was found and none could be installed. The message lists the places tried and the
    /// remedy.
    pub fn open(&self) -> Result<Runtime> {
        // The lock is held to the end, so that a second thread waits for the first one's installation.
        let mut open = OPEN.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(runtime) = open.as_ref() {
            return self.check_same(runtime);
        }
        let found = match &self.library {
            Some(named) => {
                // The system's loader would search a bare name in its own folders.
                let path = std::path::absolute(named).unwrap_or_else(|_| named.clone());
                let version = probe(&path).map_err(|e| unusable_library(&path, &e))?;
                let place = "named by --llie-options ort-lib or ORT_DYLIB_PATH".to_owned();
                FoundLibrary {
                    path,
                    version,
                    place,
                }
            }
            None => find(&Surroundings::from_this_process(), self.install)?,
        };
        let runtime = Runtime::start(found)?;
        Ok(open.insert(runtime).clone())
    }

    /// Returns the runtime that is already open; an error if another library is named.
    fn check_same(&self, runtime: &Runtime) -> Result<Runtime> {
        let real = |path: &Path| path.canonicalize().unwrap_or_else(|_| path.to_owned());
        match &self.library {
            Some(path) if real(path) != real(runtime.path()) => Err(unusable_library(
                path,
                &format!(
                    "cannot be loaded, because this process has already loaded {}",
                    runtime.path().display()
                ),
            )),
            _ => Ok(runtime.clone()),
        }
    }
}

/// A usable library.
#[derive(Debug)]
struct FoundLibrary {
    path: PathBuf,
    version: String,
    /// Where it was found, as `beside the program`.
    place: String,
}

/// The first usable library, or one that is installed now.
fn find(surroundings: &Surroundings, allowed: Install) -> Result<FoundLibrary> {
    let mut rejected = Vec::new();
    for (place, path) in surroundings.candidates() {
        match check(place, &path) {
            Ok(version) => {
                let place = place.to_string();
                return Ok(FoundLibrary {
                    path,
                    version,
                    place,
                });
            }
            Err(problem) if place == LibraryPlace::Cache && allowed == Install::Allowed => {
                rejected.push(format!("{} {problem}", path.display()));
                // A broken library that this program installed is replaced, rather than another version used.
                match install_here(surroundings, &rejected) {
                    Ok(found) => return Ok(found),
                    Err(problem) => tracing::warn!("it cannot be installed again: {problem}"),
                }
            }
            Err(problem) => {
                tracing::debug!("{} {problem}", path.display());
                rejected.push(format!("{} {problem}", path.display()));
            }
        }
    }
    rejected.extend(
        surroundings
            .packages_without_library()
            .iter()
            .map(|folder| {
                let folder = folder.display();
                format!("{folder} holds no library; the packages from version 1.19 on do")
            }),
    );
    let installed = match allowed {
        Install::Offline => Err("--llie-options offline forbids its installation".to_owned()),
        Install::Allowed => install_here(surroundings, &rejected),
    };
    installed.map_err(|problem| Error::Runtime(not_found_message(&problem, &rejected)))
}

/// Checks a candidate, one of the cache against its receipt too; returns its version.
fn check(place: LibraryPlace, path: &Path) -> Result<String, String> {
    if place == LibraryPlace::Cache
        && let Some(pin) = Pin::for_this_platform()
        && pin.is_for(path)
    {
        check_installed(path, pin)?;
    }
    probe(path)
}

/// Installs the pinned library into the cache.
fn install_here(surroundings: &Surroundings, rejected: &[String]) -> Result<FoundLibrary, String> {
    let pin = Pin::for_this_platform().ok_or_else(|| {
        format!(
            "no library is known for {} {}",
            std::env::consts::OS,
            std::env::consts::ARCH
        )
    })?;
    let folder = surroundings.installed().ok_or_else(|| {
        let variables = match std::env::consts::OS {
            "windows" => "LOCALAPPDATA is not set",
            "macos" => "HOME is not set",
            _ => "neither XDG_CACHE_HOME nor HOME is set",
        };
        format!("{variables}, so there is no cache folder to install it into")
    })?;
    tracing::warn!(
        "no usable ONNX Runtime was found{}; installing version {PINNED} with pip, once, into {}",
        skipped(rejected),
        folder.display()
    );
    let path = install(pin, &folder)?;
    let version = probe(&path).map_err(|e| format!("{} {e}", path.display()))?;
    let place = LibraryPlace::Cache.to_string();
    Ok(FoundLibrary {
        path,
        version,
        place,
    })
}

/// The libraries and packages that cannot be used, each with its problem.
fn skipped(rejected: &[String]) -> String {
    match rejected {
        [] => String::new(),
        rejected => format!(" (skipped: {})", rejected.join("; ")),
    }
}

/// Message for a missing library: the places tried, and how to provide one.
fn not_found_message(problem: &str, rejected: &[String]) -> String {
    let rejected = skipped(rejected);
    let places = LibraryPlace::ALL.map(|place| place.to_string()).join(", ");
    format!(
        "no library was found ({places}){rejected}, and {problem}. Three ways out: install the Python package into the environment of this program or one on PATH (`pip install onnxruntime=={PINNED}`); or name the library of any release from 1.{OLDEST} on with --llie-options ort-lib=FILE or ORT_DYLIB_PATH; or let it be installed: without --llie-options offline, with pip on PATH and a reachable package index"
    )
}

fn unusable_library(path: &Path, problem: &str) -> Error {
    Error::Runtime(format!(
        "{} {problem}; name the library of ONNX Runtime 1.{OLDEST} or later with --llie-options ort-lib=FILE or ORT_DYLIB_PATH, or leave both out to have it found",
        path.display()
    ))
}

impl Runtime {
    /// Loads a library that [`probe`] accepted, and starts its thread.
    fn start(found: FoundLibrary) -> Result<Self> {
        let FoundLibrary {
            path,
            version,
            place,
        } = found;
        let fault = |e: &dyn std::error::Error| Error::Runtime(format!("{}: {e}", path.display()));
        if std::env::var_os(TELEMETRY_SWITCH).is_none_or(|value| value != "1") {
            tracing::warn!(
                "ONNX Runtime may report its use to Microsoft; {TELEMETRY_SWITCH}=1 in the environment forbids that"
            );
        }
        // Errors are also returned to the caller, so log messages are shown only at debug level.
        let logger = Arc::new(|level, _: &str, _: &str, place: &str, message: &str| {
            if matches!(level, LogLevel::Warning | LogLevel::Error | LogLevel::Fatal) {
                tracing::debug!("ONNX Runtime, {place}: {message}");
            }
        });
        let environment = ort::init_from(&path)
            .map_err(|e| fault(&e))?
            .with_telemetry(false)
            .with_logger(logger)
            .build()
            .map_err(|e| fault(&e))?;
        environment.set_log_level(LogLevel::Warning);
        let thread = RuntimeThread::start().map_err(|e| fault(&e))?;
        tracing::debug!("ONNX Runtime {version} from {}", path.display());
        Ok(Self(Arc::new(OpenRuntime {
            path,
            version,
            place,
            environment,
            thread,
        })))
    }

    /// The same library with another thread, on which other sessions work at the same time.
    ///
    /// The thread is started by the first one: on Linux it inherits the setting that treats subnormal numbers as zero. Elsewhere they may
    /// be slower there, which changes no byte.
    pub(crate) fn beside(&self) -> Result<Self> {
        let thread = self.0.thread.run(RuntimeThread::start)?;
        let thread = thread.map_err(|e| Error::Runtime(e.to_string()))?;
        Ok(Self(Arc::new(OpenRuntime {
            path: self.0.path.clone(),
            version: self.0.version.clone(),
            place: self.0.place.clone(),
            environment: self.0.environment.clone(),
            thread,
        })))
    }

    /// Path of the library's file.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.0.path
    }

    /// Version of the library, such as `1.31.1`.
    #[must_use]
    pub fn version(&self) -> &str {
        &self.0.version
    }

    /// Where the library was found, as `beside the program`.
    pub(crate) fn place(&self) -> &str {
        &self.0.place
    }

    pub(crate) fn environment(&self) -> &Environment {
        &self.0.environment
    }

    /// The thread that sessions are created and run on.
    pub(crate) fn thread(&self) -> &RuntimeThread {
        &self.0.thread
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_a_library_offline_the_message_says_how_to_provide_one() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("libonnxruntime.so"), "text").unwrap();
        let surroundings = Surroundings {
            system: vec![folder.path().to_owned()],
            ..Surroundings::default()
        };
        let message = find(&surroundings, Install::Offline)
            .unwrap_err()
            .to_string();
        for part in [
            "--llie-options offline",
            "--llie-options ort-lib",
            "pip install onnxruntime==1.31.1",
        ] {
            assert!(message.contains(part), "{message}");
        }
        if cfg!(target_os = "linux") {
            assert!(message.contains("skipped"), "{message}");
        }
    }

    #[test]
    fn without_a_cache_folder_the_variables_are_named() {
        let error = find(&Surroundings::default(), Install::Allowed).unwrap_err();
        let message = error.to_string();
        assert!(message.contains("no cache folder"), "{message}");
    }

    #[test]
    fn a_wrong_library_that_was_named_is_an_error() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("missing.so");
        let search = RuntimeSearch {
            library: Some(path.clone()),
            install: Install::Allowed,
        };
        let message = search.open().err().unwrap().to_string();
        assert!(message.contains(&path.display().to_string()), "{message}");
        assert!(message.contains("--llie-options ort-lib"), "{message}");
    }
}
