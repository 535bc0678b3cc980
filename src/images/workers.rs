//! The threads that images are made on: `Workers`.

use std::num::NonZeroUsize;

use clap::Args;
use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::error::{Error, Result};
use crate::types::Decides;
use crate::types::flags::threads;

/// Flag of the number of threads that make images.
#[derive(Debug, Clone, Copy, Default, Args)]
pub(crate) struct ThreadArgs {
    /// Threads for synthesis, enhancement and reading, 1024 at most; default: all cores, or as many as a control group allows (Slurm, containers)
    #[arg(long, value_name = "N", value_parser = threads, help_heading = "Scale", add = Decides::Nothing)]
    pub threads: Option<NonZeroUsize>,
}

impl ThreadArgs {
    /// The number of threads.
    pub(crate) fn number(self) -> usize {
        let one_per_core = || std::thread::available_parallelism().unwrap_or(NonZeroUsize::MIN);
        self.threads.unwrap_or_else(one_per_core).get()
    }
}

/// The threads, twice: one pool of all for a shared source, and one pool of a single thread for each source of its own.
pub(crate) struct Workers {
    pub(crate) all: ThreadPool,
    pub(crate) each: Vec<ThreadPool>,
}

impl Workers {
    /// Workers with this many threads; one per core if it is `None`.
    ///
    /// # Errors
    /// If the operating system refuses to start them.
    pub(crate) fn start(threads: Option<NonZeroUsize>) -> Result<Self> {
        let all = pool(threads)?;
        let each = (0..all.current_num_threads()).map(|_| pool(Some(NonZeroUsize::MIN)));
        Ok(Self {
            each: each.collect::<Result<_>>()?,
            all,
        })
    }
}

/// A pool of this many threads; one per core if it is `None`.
///
/// # Errors
/// If the operating system refuses to start them.
pub(crate) fn pool(threads: Option<NonZeroUsize>) -> Result<ThreadPool> {
    let threads = threads.map_or(0, NonZeroUsize::get);
    let pool = ThreadPoolBuilder::new().num_threads(threads).build();
    pool.map_err(|e| unstarted(&e))
}

/// The error for a thread that the operating system refused to start.
pub(crate) fn unstarted(problem: &dyn std::fmt::Display) -> Error {
    Error::usage("--threads", format_args!("cannot be started: {problem}"))
}
