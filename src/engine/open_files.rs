//! The limit of open files of this process, and the number of requests in flight that it allows: [`RequestLimit`].
//!
//! Each connection counts as an open file. At the limit, new requests fail, and so does opening a file for a reply.

/// Files reserved for short use besides connections: images, maps, caches and the manifest; chosen.
const RESERVED_FILES: usize = 16;

/// Files reserved for each thread that makes images, up to a quarter of the limit in total. Chosen: a thread seldom has
/// two open.
const FILES_PER_THREAD: usize = 2;

/// Connections per request in flight: the client may open a new connection for a request that then takes one that
/// became free.
const CONNECTIONS_PER_REQUEST: usize = 2;

/// Soft limit to try if the system refuses the hard limit. macOS reports no hard limit, but allows no more than this.
#[cfg(unix)]
const FALLBACK_LIMIT: libc::rlim_t = 10_240;

/// How many requests can be in flight within the limit of open files.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RequestLimit {
    /// Maximum number of open files of this process.
    pub limit: usize,
    /// Number of requests in flight that fit within the limit; at least one.
    pub requests: usize,
}

impl RequestLimit {
    /// Raises the limit, and subtracts the files that are open now and those reserved for `threads` image threads.
    /// `None` if the limit is unknown or infinite.
    pub fn now(threads: usize) -> Option<Self> {
        let limit = raise_limit()?;
        Some(Self::within(limit, open_files(), threads))
    }

    fn within(limit: usize, open: usize, threads: usize) -> Self {
        let for_threads = FILES_PER_THREAD.saturating_mul(threads).min(limit / 4);
        let taken = open + RESERVED_FILES + for_threads;
        let requests = limit.saturating_sub(taken) / CONNECTIONS_PER_REQUEST;
        Self { limit, requests: requests.max(1) }
    }
}

/// Raises the soft limit of open files as far as the system allows, and returns it. `None` if it is unknown or
/// infinite.
#[cfg(unix)]
#[expect(unsafe_code, reason = "a limit of the operating system")]
pub fn raise_limit() -> Option<usize> {
    let mut limit = libc::rlimit { rlim_cur: 0, rlim_max: 0 };
    // SAFETY: each call only reads or writes the `rlimit` structure passed to it.
    unsafe {
        if libc::getrlimit(libc::RLIMIT_NOFILE, &raw mut limit) != 0 {
            return None;
        }
        for target in [limit.rlim_max, FALLBACK_LIMIT.min(limit.rlim_max)] {
            let raised = libc::rlimit { rlim_cur: target, ..limit };
            if target > limit.rlim_cur && libc::setrlimit(libc::RLIMIT_NOFILE, &raw const raised) == 0 {
                limit = raised;
            }
        }
    }
    let is_limited = limit.rlim_cur != libc::RLIM_INFINITY;
    is_limited.then(|| usize::try_from(limit.rlim_cur).unwrap_or(usize::MAX))
}

/// `None`: this system sets no limit of open files.
#[cfg(not(unix))]
pub fn raise_limit() -> Option<usize> {
    None
}

/// Number of files that are open now; [`RESERVED_FILES`] on systems that do not list them.
fn open_files() -> usize {
    std::fs::read_dir("/dev/fd").map_or(RESERVED_FILES, Iterator::count)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn requests_fit_within_the_limit() {
        for (limit, threads, requests) in [
            (0, 2, 1),
            (32, 2, 1),
            (64, 2, 15),
            (128, 2, 47),
            (256, 2, 111),
            (256, usize::MAX, 81),
            (1 << 20, 2, 524_271),
        ] {
            let room = RequestLimit::within(limit, 14, threads);
            assert_eq!(room.requests, requests, "{limit}, {threads} threads");
        }
    }

    #[cfg(unix)]
    #[test]
    fn open_files_are_counted() {
        let before = open_files();
        let files: Vec<_> = (0..5).map(|_| tempfile::tempfile().unwrap()).collect();
        assert!(before > 2 && open_files() > before, "{}", files.len());
        assert_eq!(raise_limit(), raise_limit());
    }
}
