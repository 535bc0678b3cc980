//! ONNX Runtime's library, found or installed, and open: [`RuntimeSearch::open`], [`Runtime`].
//!
//! A process has one ONNX Runtime, so the first one that is opened is every later one's too.
//!
//! Released builds send telemetry to Microsoft unless they are told not to. The C API can say so only after the library
//! has reported the start of the process and left an identifier in the user's cache folder (seen with 1.31.1 on Linux);
//! the environment variable [`TELEMETRY_SWITCH`] comes before that. A program calls [`forbid_telemetry`] first of all.

use std::path::{Path, PathBuf};
use std::sync::mpsc::{Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};

use ort::environment::Environment;
use ort::logging::LogLevel;

use crate::error::{Error, Result};

use super::install::{Pin, install};
use super::library::{OLDEST, PINNED, probe};
use super::search::Surroundings;

/// Whether a library that was found nowhere may be installed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Install {
    /// With pip, into the user's cache folder, once.
    Allowed,
    /// Not at all (`--offline`).
    Offline,
}

/// Where ONNX Runtime is to come from.
#[derive(Debug, Clone)]
pub struct RuntimeSearch {
    /// The library that was named (`--ort-lib`, `ORT_DYLIB_PATH`), which is then the only one tried.
    pub library: Option<PathBuf>,
    /// What to do where none is found.
    pub install: Install,
}

/// ONNX Runtime, open. Clones are the same one.
#[derive(Clone)]
pub struct Runtime(Arc<OpenRuntime>);

struct OpenRuntime {
    path: PathBuf,
    version: String,
    environment: Environment,
    jobs: Sender<Job>,
}

type Job = Box<dyn FnOnce() + Send>;

/// The environment variable that keeps ONNX Runtime's telemetry off from the start, where it is `1`.
pub(crate) const TELEMETRY_SWITCH: &str = "ORT_DISABLE_TELEMETRY";

/// Sets [`TELEMETRY_SWITCH`] for this process, so that ONNX Runtime sends nothing and leaves no identifier behind.
///
/// # Safety
/// No other thread of the process may be running: the environment is not to be changed while C code may read it.
#[expect(
    unsafe_code,
    reason = "ONNX Runtime can be told in no other way before it starts"
)]
pub unsafe fn forbid_telemetry() {
    // SAFETY: the caller vouches that there is no other thread that could read the environment meanwhile.
    unsafe { std::env::set_var(TELEMETRY_SWITCH, "1") };
}

/// The runtime of this process, once it is open.
static OPEN: Mutex<Option<Runtime>> = Mutex::new(None);

impl RuntimeSearch {
    /// Opens the library that was named; else the first that fits beside the program, in the user's cache, in the Python
    /// environments on `PATH` or in the system's folders; else, where that is allowed, installs version 1.31.1 with pip.
    ///
    /// # Errors
    /// Where the named library does not fit, or none was found and none could be installed. The message says what was
    /// tried and the ways out.
    pub fn open(&self) -> Result<Runtime> {
        // Held throughout: a second thread waits for the first one's installation.
        let mut open = OPEN.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(runtime) = open.as_ref() {
            return self.check_same(runtime);
        }
        let (path, version) = match &self.library {
            Some(path) => {
                let version = probe(path).map_err(|e| named_wrongly(path, &e))?;
                (path.clone(), version)
            }
            None => find(&Surroundings::of_this_process(), self.install)?,
        };
        let runtime = Runtime::start(path, version)?;
        Ok(open.insert(runtime).clone())
    }

    /// Gives the runtime that is open already, unless another was named.
    fn check_same(&self, runtime: &Runtime) -> Result<Runtime> {
        let real = |path: &Path| path.canonicalize().unwrap_or_else(|_| path.to_owned());
        match &self.library {
            Some(path) if real(path) != real(runtime.path()) => Err(named_wrongly(
                path,
                &format!(
                    "cannot be loaded beside {}, which this process has loaded",
                    runtime.path().display()
                ),
            )),
            _ => Ok(runtime.clone()),
        }
    }
}

/// The first library that fits, or one that is installed now; with its version.
fn find(surroundings: &Surroundings, allowed: Install) -> Result<(PathBuf, String)> {
    let mut rejected = Vec::new();
    for path in surroundings.candidates() {
        match probe(&path) {
            Ok(version) => return Ok((path, version)),
            Err(problem) => {
                tracing::debug!("{} {problem}", path.display());
                rejected.push(format!("{} {problem}", path.display()));
            }
        }
    }
    let installed = match allowed {
        Install::Offline => Err("--offline forbids its installation".to_owned()),
        Install::Allowed => install_here(surroundings),
    };
    installed.map_err(|problem| Error::Runtime(nowhere(&problem, &rejected)))
}

/// Installs the pinned library into the cache.
fn install_here(surroundings: &Surroundings) -> Result<(PathBuf, String), String> {
    let pin = Pin::of_this_platform().ok_or_else(|| {
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
        "ONNX Runtime was not found; installing version {PINNED} with pip, once, into {}",
        folder.display()
    );
    let path = install(pin, &folder)?;
    let version = probe(&path).map_err(|e| format!("{} {e}", path.display()))?;
    Ok((path, version))
}

/// What to say where there is no library.
fn nowhere(problem: &str, rejected: &[String]) -> String {
    let rejected = match rejected {
        [] => String::new(),
        some => format!(" (passed over: {})", some.join("; ")),
    };
    format!(
        "no library was found{rejected}, and {problem}. Three ways out: install the Python package into the environment on PATH (`pip install onnxruntime=={PINNED}`); or name the library of any release from 1.{OLDEST} on with --ort-lib FILE or ORT_DYLIB_PATH; or let it be installed: without --offline, with pip on PATH and a package index within reach"
    )
}

fn named_wrongly(path: &Path, problem: &str) -> Error {
    Error::Runtime(format!(
        "{} {problem}; name the library of ONNX Runtime 1.{OLDEST} or later with --ort-lib FILE or ORT_DYLIB_PATH, or leave both out to have it found",
        path.display()
    ))
}

impl Runtime {
    /// Loads a library that was probed, and starts its thread.
    fn start(path: PathBuf, version: String) -> Result<Self> {
        let fault = |e: &dyn std::error::Error| Error::Runtime(format!("{}: {e}", path.display()));
        if std::env::var_os(TELEMETRY_SWITCH).is_none_or(|value| value != "1") {
            tracing::warn!(
                "ONNX Runtime may report its use to Microsoft; {TELEMETRY_SWITCH}=1 in the environment forbids that"
            );
        }
        // What it has to say of errors comes back as errors too; the rest is for those who look for it.
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
        let jobs = start_thread().map_err(|e| fault(&e))?;
        tracing::debug!("ONNX Runtime {version} from {}", path.display());
        Ok(Self(Arc::new(OpenRuntime {
            path,
            version,
            environment,
            jobs,
        })))
    }

    /// The library's file.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.0.path
    }

    /// The library's version, such as `1.31.1`.
    #[must_use]
    pub fn version(&self) -> &str {
        &self.0.version
    }

    pub(super) fn environment(&self) -> &Environment {
        &self.0.environment
    }

    /// Runs a job on the runtime's own thread and waits for it.
    ///
    /// Sessions are made and run there because the switch that treats subnormal numbers as zero is one of the calling
    /// thread's, and is thrown by the first session alone. So every model has it, and no other thread of the program does:
    /// what that computes cannot depend on whether a model was loaded before.
    pub(super) fn run<T: Send + 'static>(
        &self,
        job: impl FnOnce() -> T + Send + 'static,
    ) -> Result<T> {
        let ended = || Error::Runtime("its thread ended; this is a fault of the program".into());
        let (sender, result) = channel();
        let job = Box::new(move || {
            // Nobody waits for the result only where the waiting thread is gone.
            drop(sender.send(job()));
        });
        self.0.jobs.send(job).map_err(|_| ended())?;
        result.recv().map_err(|_| ended())
    }
}

fn start_thread() -> std::io::Result<Sender<Job>> {
    let (sender, jobs) = channel::<Job>();
    std::thread::Builder::new()
        .name("onnxruntime".to_owned())
        .spawn(move || jobs.into_iter().for_each(|job| job()))?;
    Ok(sender)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_a_library_offline_the_ways_out_are_told() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("libonnxruntime.so"), "text").unwrap();
        let surroundings = Surroundings {
            system: vec![folder.path().to_owned()],
            ..Surroundings::default()
        };
        let message = find(&surroundings, Install::Offline)
            .unwrap_err()
            .to_string();
        for part in ["--offline", "--ort-lib", "pip install onnxruntime==1.31.1"] {
            assert!(message.contains(part), "{message}");
        }
        if cfg!(target_os = "linux") {
            assert!(message.contains("passed over"), "{message}");
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
        assert!(message.contains("--ort-lib"), "{message}");
    }
}
