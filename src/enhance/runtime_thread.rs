//! The thread on which ONNX Runtime works, and the wait for it: [`RuntimeThread`].
//!
//! Sessions are created and run there because the setting that treats subnormal numbers as zero belongs to the calling
//! thread, and only the first session sets it. So it holds for every model, but for no other thread of the program, whose
//! results thus do not depend on whether a model was loaded before.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::Duration;

use super::time_limit::PATIENCE;
use crate::error::{Error, Result};

/// The thread of a runtime, which carries out one job after another.
pub(super) struct RuntimeThread {
    jobs: Sender<Job>,
    /// Whether a job was told to end and has not.
    stuck: AtomicBool,
}

type Job = Box<dyn FnOnce() + Send>;

/// End of a job with a time limit.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Ended<T> {
    InTime(T),
    /// It took longer, and ended when it was told to.
    Late,
}

/// Message of a job to its caller.
enum Event<T> {
    Started,
    Ended(T),
}

/// Time between two looks at whether the thread is stuck in the job of another caller; chosen.
const LOOK: Duration = Duration::from_millis(500);

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
    pub(super) fn run<T: Send + 'static>(
        &self,
        job: impl FnOnce() -> T + Send + 'static,
    ) -> Result<T> {
        match self.run_within(None, || {}, job)? {
            Ended::InTime(result) => Ok(result),
            Ended::Late => Err(thread_ended()),
        }
    }

    /// Runs a job. If it takes longer than `limit` from its start, `stop` is called and must make it end.
    ///
    /// # Errors
    /// If the job does not end within [`PATIENCE`] times the limit: the thread is then stuck in it, and every later job is
    /// refused.
    pub(super) fn run_within<T: Send + 'static>(
        &self,
        limit: Option<Duration>,
        stop: impl FnOnce(),
        job: impl FnOnce() -> T + Send + 'static,
    ) -> Result<Ended<T>> {
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
        let result = match limit {
            None => events.recv().map_err(|_| RecvTimeoutError::Disconnected),
            Some(limit) => events.recv_timeout(limit),
        };
        match result {
            Ok(Event::Ended(result)) => return Ok(Ended::InTime(result)),
            Err(RecvTimeoutError::Timeout) => stop(),
            Ok(Event::Started) | Err(RecvTimeoutError::Disconnected) => return Err(thread_ended()),
        }
        let patience = limit.unwrap_or_default().saturating_mul(PATIENCE - 1);
        match events.recv_timeout(patience.max(LOOK)) {
            Ok(_) => Ok(Ended::Late),
            Err(RecvTimeoutError::Disconnected) => Err(thread_ended()),
            Err(RecvTimeoutError::Timeout) => {
                self.stuck.store(true, Ordering::SeqCst);
                Err(stuck())
            }
        }
    }

    /// Waits until a job starts, which earlier jobs may delay.
    fn wait_for_start<T>(&self, events: &Receiver<Event<T>>) -> Result<()> {
        loop {
            match events.recv_timeout(LOOK) {
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

fn thread_ended() -> Error {
    Error::Runtime("its thread ended, which is a bug of this program".into())
}

fn stuck() -> Error {
    Error::Runtime(format!(
        "an enhancer did not end within {PATIENCE} times --llie-timeout, although it was told to, because one of its operators takes that long; no image is enhanced any more, and what was done is saved. Allow more time with --llie-timeout, or enhance smaller images"
    ))
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;

    #[test]
    fn jobs_that_end_when_they_are_told_to_leave_the_thread_free() {
        let thread = RuntimeThread::start().unwrap();
        let limit = Some(Duration::from_millis(20));
        let told = Arc::new(AtomicBool::new(false));
        let seen = Arc::clone(&told);
        let ended = thread.run_within(
            limit,
            || told.store(true, Ordering::SeqCst),
            move || while !seen.load(Ordering::SeqCst) {},
        );
        assert_eq!(ended.unwrap(), Ended::Late);
        let quick = thread.run_within(Some(Duration::from_mins(1)), || {}, || 7);
        assert_eq!(quick.unwrap(), Ended::InTime(7));
        assert_eq!(thread.run(|| 8).unwrap(), 8);
    }

    #[test]
    fn a_job_that_never_ends_is_given_up_and_every_later_one_refused() {
        let thread = Arc::new(RuntimeThread::start().unwrap());
        let (release, blocked) = channel::<()>();
        let job = move || {
            let _ended = blocked.recv();
        };
        let stuck = thread.run_within(Some(Duration::from_millis(1)), || {}, job);
        let message = stuck.unwrap_err().to_string();
        assert!(message.contains("--llie-timeout"), "{message}");
        assert!(thread.run(|| 1).is_err());
        drop(release);
    }
}
