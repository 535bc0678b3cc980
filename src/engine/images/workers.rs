//! Threads that make images: `Workers`.

use std::num::NonZeroUsize;

use clap::Args;
use rayon::{ThreadPool, ThreadPoolBuilder};

use darkqa_base::error::{Error, Result};
use darkqa_base::types::Decides;
use darkqa_base::types::flags::threads;

/// The flag `--threads`.
#[derive(Debug, Clone, Copy, Default, Args)]
pub struct ThreadArgs {
    /// Threads for synthesis, enhancement and reading, 1024 at most; default: all cores, or as many as a control group
    /// allows (Slurm, containers)
    #[arg(long, value_name = "N", value_parser = threads, help_heading = "Scale", add = Decides::Nothing)]
    pub threads: Option<NonZeroUsize>,
}

impl ThreadArgs {
    /// Number of threads; by default one per core.
    pub fn count(self) -> usize {
        self.threads.or_else(|| std::thread::available_parallelism().ok()).map_or(1, NonZeroUsize::get)
    }
}

/// Thread pools: one of all threads, for work on one source together, and pools of one thread each, for one source per
/// worker.
pub struct Workers {
    pub shared: ThreadPool,
    pub single_threaded: Vec<ThreadPool>,
}

impl Workers {
    /// Starts this many threads; by default one per core.
    ///
    /// # Errors
    /// If the operating system refuses to start them.
    pub fn start(threads: Option<NonZeroUsize>) -> Result<Self> {
        let shared = pool(threads)?;
        let single_threaded =
            (0..shared.current_num_threads()).map(|_| pool(Some(NonZeroUsize::MIN))).collect::<Result<_>>()?;
        Ok(Self { shared, single_threaded })
    }
}

/// A pool of this many threads; by default one per core.
///
/// # Errors
/// If the operating system refuses to start them.
pub fn pool(threads: Option<NonZeroUsize>) -> Result<ThreadPool> {
    let threads = threads.map_or(0, NonZeroUsize::get);
    ThreadPoolBuilder::new().num_threads(threads).build().map_err(|e| thread_start_error(&e))
}

/// The error for a thread that the operating system refused to start.
pub fn thread_start_error(problem: &dyn std::fmt::Display) -> Error {
    Error::usage("--threads", format_args!("cannot be started: {problem}"))
}
