//! The thread on which ONNX Runtime works, and the wait for it: [`RuntimeThread`].
//!
//! Sessions are created and run there because the setting that treats subnormal numbers as zero belongs to the calling
//! thread, and only the first session sets it. So it holds for every model, but for no other thread of the program, whose
//! results thus do not depend on whether a model was loaded before.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::{Duration, Instant};

use crate::limits::{MemoryLimit, PATIENCE};
use darkqa_ground::error::{Error, Result};

/// The thread of a runtime, which carries out one job after another.
pub(crate) struct RuntimeThread {
    jobs: Sender<Job>,
    /// Whether a job was told to end and has not.
    stuck: AtomicBool,
}

type Job = Box<dyn FnOnce() + Send>;

/// End of a job with a time limit.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum JobEnd<T> {
    Finished(T),
    /// It took longer, and ended when it was told to.
    TimedOut,
    /// It took more memory, and ended when it was told to.
    MemoryExceeded,
}

/// Limits of a job.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct JobLimits {
    /// Time from its start; `None` for any.
    pub(crate) time: Option<Duration>,
    /// Memory of the process.
    pub(crate) memory: MemoryLimit,
}

/// Message of a job to its caller.
enum Event<T> {
    Started,
    Ended(T),
}

/// Time in which a job must end that was told to because of its memory; chosen.
const GRACE: Duration = Duration::from_secs(10);

/// Time between two looks at whether the thread is stuck in the job of another caller, and longest step in which a limit of time is counted;
/// chosen.
const POLL_INTERVAL: Duration = Duration::from_millis(500);

impl RuntimeThread {
    /// Starts the thread; it ends when this is dropped and all jobs are done.
    pub(super) fn start() -> std::io::Result<Self> {
        let (jobs, waiting) = channel::<Job>();
        std::thread::Builder::new()
            .name("onnxruntime".to_owned())
            .spawn(move || waiting.into_iter().for_each(|job| job()))?;
        Ok(Self {
            jobs,
            stuck: AtomicBool::new(false),
        })
    }

    /// Runs a job, waits for it and returns its result.
    pub(crate) fn run<T: Send + 'static>(
        &self,
        job: impl FnOnce() -> T + Send + 'static,
    ) -> Result<T> {
        match self.run_within(JobLimits::default(), || {}, job)? {
            JobEnd::Finished(result) => Ok(result),
            JobEnd::TimedOut | JobEnd::MemoryExceeded => Err(thread_ended()),
        }
    }

    /// Runs a job. If it takes more than its `limits`, `stop` is called and must make it end.
    ///
    /// # Errors
    /// If the job does not end within [`PATIENCE`] times the limit of time, or 10 s after it took too much memory: the thread is
    /// then stuck in it, and every later job is refused.
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
                (
                    JobEnd::TimedOut,
                    time.saturating_mul(PATIENCE - 1).max(POLL_INTERVAL),
                )
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

    /// Runs a job that nothing can end. If it takes more than its `limits`, it is left alone with the thread, and every later job is
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

    /// Hands a job to the thread, and waits for its start.
    fn start_job<T: Send + 'static>(
        &self,
        job: impl FnOnce() -> T + Send + 'static,
    ) -> Result<Receiver<Event<T>>> {
        let (sender, events) = channel();
        let job = Box::new(move || {
            // Sending fails only if the waiting thread has ended.
            drop(sender.send(Event::Started));
            drop(sender.send(Event::Ended(job())));
        });
        if self.stuck.load(Ordering::SeqCst) {
            return Err(stuck());
        }
        self.jobs.send(job).map_err(|_| thread_ended())?;
        self.wait_for_start(&events)?;
        Ok(events)
    }

    /// Waits until a job starts, which earlier jobs may delay.
    fn wait_for_start<T>(&self, events: &Receiver<Event<T>>) -> Result<()> {
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

/// Waits until a job ends or takes more than its limits. A pause of the process (Ctrl-Z, `scontrol suspend`) counts as one step of the time.
fn wait_for_end<T>(events: &Receiver<Event<T>>, limits: JobLimits) -> Result<JobEnd<T>> {
    let mut left = limits.time;
    loop {
        let step = left.map(|left| left.min(POLL_INTERVAL));
        let step = [step, limits.memory.poll_interval()]
            .into_iter()
            .flatten()
            .min();
        let start = Instant::now();
        let event = match step {
            None => events.recv().map_err(|_| RecvTimeoutError::Disconnected),
            Some(step) => events.recv_timeout(step),
        };
        match event {
            Ok(Event::Ended(result)) => return Ok(JobEnd::Finished(result)),
            Ok(Event::Started) | Err(RecvTimeoutError::Disconnected) => return Err(thread_ended()),
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

/// The part of a wait in which the process ran: a wait that took longer than its step was paused.
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

    /// Limits of time alone.
    fn within(time: Duration) -> JobLimits {
        JobLimits {
            time: Some(time),
            memory: MemoryLimit::NONE,
        }
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_job_that_takes_too_much_memory_is_told_to_end() {
        let thread = RuntimeThread::start().unwrap();
        let limits = |gigabytes: &str| JobLimits {
            time: None,
            memory: gigabytes.parse().unwrap(),
        };
        let told = Arc::new(AtomicBool::new(false));
        let seen = Arc::clone(&told);
        let ended = thread.run_within(
            limits("0.001"),
            || told.store(true, Ordering::SeqCst),
            move || while !seen.load(Ordering::SeqCst) {},
        );
        assert_eq!(ended.unwrap(), JobEnd::MemoryExceeded);
        let slow = || std::thread::sleep(Duration::from_millis(250));
        let small = thread.run_within(limits("1000000"), || {}, slow);
        assert_eq!(small.unwrap(), JobEnd::Finished(()));
    }

    #[test]
    fn a_pause_of_the_process_costs_one_step() {
        let (hour, step) = (Duration::from_hours(1), Duration::from_millis(500));
        assert_eq!(running_time(hour, Some(step)), step);
        assert_eq!(running_time(step / 5, Some(step)), step / 5);
        assert_eq!(running_time(hour, None), hour);
    }

    #[test]
    fn a_job_that_nothing_can_end_is_left_alone() {
        let thread = RuntimeThread::start().unwrap();
        let quick = thread.run_or_leave(within(Duration::from_mins(1)), || 7);
        assert_eq!(quick.unwrap(), JobEnd::Finished(7));
        let slow = || std::thread::sleep(Duration::from_secs(2));
        let start = Instant::now();
        let left = thread.run_or_leave(within(Duration::from_millis(20)), slow);
        assert_eq!(left.unwrap(), JobEnd::TimedOut);
        assert!(start.elapsed() < Duration::from_secs(2));
        let message = thread.run(|| 8).unwrap_err().to_string();
        assert!(message.contains("--llie-options timeout"), "{message}");
    }

    #[test]
    fn jobs_that_end_when_they_are_told_to_leave_the_thread_free() {
        let thread = RuntimeThread::start().unwrap();
        let limit = within(Duration::from_millis(20));
        let told = Arc::new(AtomicBool::new(false));
        let seen = Arc::clone(&told);
        let ended = thread.run_within(
            limit,
            || told.store(true, Ordering::SeqCst),
            move || while !seen.load(Ordering::SeqCst) {},
        );
        assert_eq!(ended.unwrap(), JobEnd::TimedOut);
        let quick = thread.run_within(within(Duration::from_mins(1)), || {}, || 7);
        assert_eq!(quick.unwrap(), JobEnd::Finished(7));
        assert_eq!(thread.run(|| 8).unwrap(), 8);
    }

    #[test]
    fn a_job_that_never_ends_is_given_up_and_every_later_one_refused() {
        let thread = Arc::new(RuntimeThread::start().unwrap());
        let (release, blocked) = channel::<()>();
        let job = move || {
            let _ended = blocked.recv();
        };
        let stuck = thread.run_within(within(Duration::from_millis(1)), || {}, job);
        let message = stuck.unwrap_err().to_string();
        assert!(message.contains("--llie-options timeout"), "{message}");
        assert!(thread.run(|| 1).is_err());
        drop(release);
    }
}
