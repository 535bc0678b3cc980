//! Thread on which ONNX Runtime creates and runs sessions: [`RuntimeThread`].
//!
//! ONNX Runtime sets the CPU flag that treats subnormal numbers as zero when the first session is created, and only in
//! the calling thread. With one thread for all sessions, the flag applies to every model. Results of other threads do
//! not depend on whether a model was loaded.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::{Duration, Instant};

use crate::limits::{MemoryLimit, PATIENCE};
use darkqa_base::error::{Error, Result};

/// Thread that runs one job after another.
pub(crate) struct RuntimeThread {
    jobs: Sender<Job>,
    /// True if a job exceeded its limits and could not be stopped.
    stuck: AtomicBool,
}

type Job = Box<dyn FnOnce() + Send>;

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
enum Event<T> {
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
        let (jobs, waiting) = channel::<Job>();
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
    fn start_job<T: Send + 'static>(&self, job: impl FnOnce() -> T + Send + 'static) -> Result<Receiver<Event<T>>> {
        let (sender, events) = channel();
        let job = Box::new(move || {
            // Sending fails only if the caller no longer waits.
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

    /// Waits until a job starts, that is, until earlier jobs are done.
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

/// Waits until a job ends or exceeds its limits. A pause of the process (Ctrl-Z, `scontrol suspend`) counts as one
/// polling interval only.
fn wait_for_end<T>(events: &Receiver<Event<T>>, limits: JobLimits) -> Result<JobEnd<T>> {
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
