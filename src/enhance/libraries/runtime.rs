//! Finds or installs the library of ONNX Runtime, and opens it: [`RuntimeSearch::open`], [`Runtime`].
//!
//! A process can load only one ONNX Runtime, so later calls of `open` return the first one.
//!
//! Released builds send telemetry to Microsoft by default. The C API can disable telemetry only after the library has
//! reported the start of the process and written an identifier to the user's cache folder (seen with 1.31.1 on Linux).
//! The environment variable [`TELEMETRY_SWITCH`] takes effect earlier, so programs must call [`disable_telemetry`]
//! first.
//!
//! Thread on which ONNX Runtime creates and runs sessions: [`RuntimeThread`].
//!
//! ONNX Runtime sets the CPU flag that treats subnormal numbers as zero when the first session is created, and only in
//! the calling thread. With one thread for all sessions, the flag applies to every model. Results of other threads do
//! not depend on whether a model was loaded.

use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use ort::environment::Environment;
use ort::logging::LogLevel;

use super::install::{Pin, check_installed, install};
use super::library_file::{OLDEST, PINNED, probe};
use super::search::{LibraryPlace, SearchFolders};
use crate::limits::{MemoryLimit, PATIENCE};
use darkqa_base::error::{Error, Result};

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

/// Thread that runs one job after another.
pub(crate) struct RuntimeThread {
    jobs: Sender<RuntimeJob>,
    /// True if a job exceeded its limits and could not be stopped.
    stuck: AtomicBool,
}

type RuntimeJob = Box<dyn FnOnce() + Send>;

/// Outcome of a job with limits.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum JobEnd<T> {
    Finished(T),
    /// The job exceeded the time limit.
    TimedOut,
    /// The job exceeded the memory limit.
    MemoryExceeded,
}

/// Limits of a job.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct JobLimits {
    /// Limit of the time since the start of the job; `None` for no limit.
    pub(crate) time: Option<Duration>,
    /// Limit of the process's memory.
    pub(crate) memory: MemoryLimit,
}

/// Message from a job to its caller.
enum RuntimeEvent<T> {
    Started,
    Ended(T),
}

/// Time within which a job must end after it was stopped because of its memory; chosen.
const GRACE: Duration = Duration::from_secs(10);

/// Interval between checks whether the thread is stuck in another caller's job, and longest step in which elapsed time
/// is counted; chosen.
const POLL_INTERVAL: Duration = Duration::from_millis(500);

impl RuntimeThread {
    /// Starts the thread. It ends when the value is dropped and all jobs are done.
    pub(super) fn start() -> std::io::Result<Self> {
        let (jobs, waiting) = channel::<RuntimeJob>();
        std::thread::Builder::new()
            .name("onnxruntime".to_owned())
            .spawn(move || waiting.into_iter().for_each(|job| job()))?;
        Ok(Self { jobs, stuck: AtomicBool::new(false) })
    }

    /// Runs a job, waits for it and returns its result.
    pub(crate) fn run<T: Send + 'static>(&self, job: impl FnOnce() -> T + Send + 'static) -> Result<T> {
        match self.run_within(JobLimits::default(), || {}, job)? {
            JobEnd::Finished(result) => Ok(result),
            JobEnd::TimedOut | JobEnd::MemoryExceeded => Err(thread_ended()),
        }
    }

    /// Runs a job. If it exceeds its `limits`, `stop` is called and must make it end.
    ///
    /// # Errors
    /// If the job does not end within [`PATIENCE`] times the time limit, or within 10 s after it exceeded the memory
    /// limit. The thread is then stuck, and every later job is refused.
    pub(crate) fn run_within<T: Send + 'static>(
        &self,
        limits: JobLimits,
        stop: impl FnOnce(),
        job: impl FnOnce() -> T + Send + 'static,
    ) -> Result<JobEnd<T>> {
        let events = self.start_job(job)?;
        let (ended, patience) = match wait_for_end(&events, limits)? {
            JobEnd::TimedOut => {
                let time = limits.time.unwrap_or_default();
                (JobEnd::TimedOut, time.saturating_mul(PATIENCE - 1).max(POLL_INTERVAL))
            }
            JobEnd::MemoryExceeded => (JobEnd::MemoryExceeded, GRACE),
            finished @ JobEnd::Finished(_) => return Ok(finished),
        };
        stop();
        match events.recv_timeout(patience) {
            Ok(_) => Ok(ended),
            Err(RecvTimeoutError::Disconnected) => Err(thread_ended()),
            Err(RecvTimeoutError::Timeout) => {
                self.stuck.store(true, Ordering::SeqCst);
                Err(match ended {
                    JobEnd::MemoryExceeded => Error::Runtime(format!(
                        "an enhancer exceeded --llie-options max-memory and could not be stopped within {} s; no more images are enhanced, finished trials are saved. Set a higher limit, or use a smaller model",
                        GRACE.as_secs()
                    )),
                    _ => stuck(),
                })
            }
        }
    }

    /// Runs a job that cannot be stopped. If it exceeds its `limits`, the thread is abandoned, and every later job is
    /// refused.
    pub(crate) fn run_or_leave<T: Send + 'static>(
        &self,
        limits: JobLimits,
        job: impl FnOnce() -> T + Send + 'static,
    ) -> Result<JobEnd<T>> {
        let events = self.start_job(job)?;
        let ended = wait_for_end(&events, limits)?;
        if !matches!(ended, JobEnd::Finished(_)) {
            self.stuck.store(true, Ordering::SeqCst);
        }
        Ok(ended)
    }

    /// Sends a job to the thread, and waits until it starts.
    fn start_job<T: Send + 'static>(
        &self,
        job: impl FnOnce() -> T + Send + 'static,
    ) -> Result<Receiver<RuntimeEvent<T>>> {
        let (sender, events) = channel();
        let job = Box::new(move || {
            // Sending fails only if the caller no longer waits.
            drop(sender.send(RuntimeEvent::Started));
            drop(sender.send(RuntimeEvent::Ended(job())));
        });
        if self.stuck.load(Ordering::SeqCst) {
            return Err(stuck());
        }
        self.jobs.send(job).map_err(|_| thread_ended())?;
        self.wait_for_start(&events)?;
        Ok(events)
    }

    /// Waits until a job starts, that is, until earlier jobs are done.
    fn wait_for_start<T>(&self, events: &Receiver<RuntimeEvent<T>>) -> Result<()> {
        loop {
            match events.recv_timeout(POLL_INTERVAL) {
                Ok(_) => return Ok(()),
                Err(RecvTimeoutError::Disconnected) => return Err(thread_ended()),
                Err(RecvTimeoutError::Timeout) if self.stuck.load(Ordering::SeqCst) => {
                    return Err(stuck());
                }
                Err(RecvTimeoutError::Timeout) => {}
            }
        }
    }
}

/// Waits until a job ends or exceeds its limits. A pause of the process (Ctrl-Z, `scontrol suspend`) counts as one
/// polling interval only.
fn wait_for_end<T>(events: &Receiver<RuntimeEvent<T>>, limits: JobLimits) -> Result<JobEnd<T>> {
    let mut left = limits.time;
    loop {
        let step = left.map(|left| left.min(POLL_INTERVAL));
        let step = [step, limits.memory.poll_interval()].into_iter().flatten().min();
        let start = Instant::now();
        let event = match step {
            None => events.recv().map_err(|_| RecvTimeoutError::Disconnected),
            Some(step) => events.recv_timeout(step),
        };
        match event {
            Ok(RuntimeEvent::Ended(result)) => return Ok(JobEnd::Finished(result)),
            Ok(RuntimeEvent::Started) | Err(RecvTimeoutError::Disconnected) => return Err(thread_ended()),
            Err(RecvTimeoutError::Timeout) => {}
        }
        left = left.map(|left| left.saturating_sub(running_time(start.elapsed(), step)));
        if left.is_some_and(|left| left.is_zero()) {
            return Ok(JobEnd::TimedOut);
        }
        if limits.memory.is_exceeded() {
            return Ok(JobEnd::MemoryExceeded);
        }
    }
}

/// Time during a wait in which the process was running: at most `step`, because a longer wait means that the process
/// was paused.
fn running_time(waited: Duration, step: Option<Duration>) -> Duration {
    step.map_or(waited, |step| waited.min(step))
}

fn thread_ended() -> Error {
    Error::Runtime("its thread ended, which is a bug of this program".into())
}

fn stuck() -> Error {
    Error::Runtime(format!(
        "an enhancer could not be stopped within {PATIENCE} times its time limit; no more images are enhanced, finished trials are saved. \
         Set a higher --llie-options timeout=SECONDS, or enhance smaller images"
    ))
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

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

    /// A time limit without a memory limit.
    fn within(time: Duration) -> JobLimits {
        JobLimits { time: Some(time), memory: MemoryLimit::NONE }
    }

    /// Runs a job that ends when it is stopped.
    fn run_until_stopped(thread: &RuntimeThread, limits: JobLimits) -> JobEnd<()> {
        let stopped = Arc::new(AtomicBool::new(false));
        let is_stopped = Arc::clone(&stopped);
        thread
            .run_within(
                limits,
                || stopped.store(true, Ordering::SeqCst),
                move || while !is_stopped.load(Ordering::SeqCst) {},
            )
            .unwrap()
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn job_with_too_much_memory_is_stopped() {
        let thread = RuntimeThread::start().unwrap();
        let [small, large] =
            ["0.001", "1000000"].map(|gigabytes| JobLimits { time: None, memory: gigabytes.parse().unwrap() });
        assert_eq!(run_until_stopped(&thread, small), JobEnd::MemoryExceeded);
        let end = thread.run_within(large, || {}, || std::thread::sleep(Duration::from_millis(250)));
        assert_eq!(end.unwrap(), JobEnd::Finished(()));
    }

    #[test]
    fn pause_of_the_process_counts_as_one_step() {
        let (hour, step) = (Duration::from_hours(1), Duration::from_millis(500));
        assert_eq!(running_time(hour, Some(step)), step);
        assert_eq!(running_time(step / 5, Some(step)), step / 5);
        assert_eq!(running_time(hour, None), hour);
    }

    #[test]
    fn job_that_cannot_be_stopped_is_abandoned() {
        let thread = RuntimeThread::start().unwrap();
        let quick = thread.run_or_leave(within(Duration::from_mins(1)), || 7);
        assert_eq!(quick.unwrap(), JobEnd::Finished(7));
        let start = Instant::now();
        let slow = thread.run_or_leave(within(Duration::from_millis(20)), || {
            std::thread::sleep(Duration::from_secs(2));
        });
        assert_eq!(slow.unwrap(), JobEnd::TimedOut);
        assert!(start.elapsed() < Duration::from_secs(2));
        let message = thread.run(|| 8).unwrap_err().to_string();
        assert!(message.contains("--llie-options timeout"), "{message}");
    }

    #[test]
    fn thread_is_free_after_a_stopped_job() {
        let thread = RuntimeThread::start().unwrap();
        let limits = within(Duration::from_millis(20));
        assert_eq!(run_until_stopped(&thread, limits), JobEnd::TimedOut);
        let quick = thread.run_within(within(Duration::from_mins(1)), || {}, || 7);
        assert_eq!(quick.unwrap(), JobEnd::Finished(7));
        assert_eq!(thread.run(|| 8).unwrap(), 8);
    }

    #[test]
    fn jobs_after_a_stuck_one_are_refused() {
        let thread = RuntimeThread::start().unwrap();
        let (release, blocked) = channel::<()>();
        let stuck = thread.run_within(
            within(Duration::from_millis(1)),
            || {},
            move || {
                let _ended = blocked.recv();
            },
        );
        let message = stuck.unwrap_err().to_string();
        assert!(message.contains("--llie-options timeout"), "{message}");
        assert!(thread.run(|| 1).is_err());
        drop(release);
    }
}
