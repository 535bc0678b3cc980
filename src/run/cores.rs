//! The threads that images are made on: [`pool`].

use std::num::NonZeroUsize;

use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::error::{Error, Result};

/// So many threads; one a core where nothing is said.
///
/// # Errors
/// Where the system does not give them.
pub(super) fn pool(threads: Option<NonZeroUsize>) -> Result<ThreadPool> {
    let threads = threads.map_or(0, NonZeroUsize::get);
    let pool = ThreadPoolBuilder::new().num_threads(threads).build();
    pool.map_err(|e| unstarted(&e))
}

/// A thread that the system does not give.
pub(super) fn unstarted(problem: &dyn std::fmt::Display) -> Error {
    Error::usage("--threads", format_args!("cannot be started: {problem}"))
}
