//! The threads that images are made on: [`Workers`].

use std::num::NonZeroUsize;

use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::error::{Error, Result};

/// The same threads twice: all of them for one source, and each for a source of its own.
pub(crate) struct Workers {
    pub(crate) all: ThreadPool,
    pub(crate) each: Vec<ThreadPool>,
}

impl Workers {
    /// This many threads; one a core if no number is given.
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

/// This many threads; one a core if no number is given.
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
