//! The number of files that this process may have open, and the connections for which that leaves room.
//!
//! A connection is an open file. Without room for one more, a request fails, and so does each file that is opened for its reply.

/// Files that are opened for a moment beside connections: images, maps, caches and the manifest; chosen.
const OTHERS: usize = 16;

/// The same for each thread that makes images, up to a quarter of the limit; chosen: it seldom has two open.
const EACH_THREAD: usize = 2;

/// Connections for each request in flight: the client opens one while another, which the request takes, becomes free.
const EACH_REQUEST: usize = 2;

/// A soft limit that every system allows, if the hard one is refused: macOS states no hard limit, and allows no more.
#[cfg(unix)]
const ALLOWED: libc::rlim_t = 10_240;

/// The room for connections.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct ConnectionRoom {
    /// The number of files that this process may have open.
    pub(crate) limit: usize,
    /// The number of requests in flight for which the limit leaves room; at least one.
    pub(crate) requests: usize,
}

impl ConnectionRoom {
    /// The room beside the files that are open now and those that `threads` open; `None` without a limit.
    pub(crate) fn now(threads: usize) -> Option<Self> {
        let limit = raise_limit()?;
        Some(Self::beside(limit, open_now(), threads))
    }

    fn beside(limit: usize, open: usize, threads: usize) -> Self {
        let images = EACH_THREAD.saturating_mul(threads).min(limit / 4);
        let taken = open + OTHERS + images;
        let requests = limit.saturating_sub(taken) / EACH_REQUEST;
        Self {
            limit,
            requests: requests.max(1),
        }
    }
}

/// Raises the limit of open files to the highest that this process may set; returns it, `None` if there is none.
#[cfg(unix)]
#[expect(unsafe_code, reason = "a limit of the operating system")]
pub(crate) fn raise_limit() -> Option<usize> {
    let mut limit = libc::rlimit {
        rlim_cur: 0,
        rlim_max: 0,
    };
    // SAFETY: each call reads or writes the one structure that it is given.
    unsafe {
        if libc::getrlimit(libc::RLIMIT_NOFILE, &raw mut limit) != 0 {
            return None;
        }
        for highest in [limit.rlim_max, ALLOWED.min(limit.rlim_max)] {
            let raised = libc::rlimit {
                rlim_cur: highest,
                ..limit
            };
            if highest > limit.rlim_cur
                && libc::setrlimit(libc::RLIMIT_NOFILE, &raw const raised) == 0
            {
                limit = raised;
            }
        }
    }
    let is_limited = limit.rlim_cur != libc::RLIM_INFINITY;
    is_limited.then(|| usize::try_from(limit.rlim_cur).unwrap_or(usize::MAX))
}

/// Raises the limit of open files; this system has none.
#[cfg(not(unix))]
pub(crate) fn raise_limit() -> Option<usize> {
    None
}

/// The number of files that are open now, as far as the system lists them.
fn open_now() -> usize {
    std::fs::read_dir("/dev/fd").map_or(OTHERS, Iterator::count)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn requests_fit_beside_other_files() {
        for (limit, threads, requests) in [
            (0, 2, 1),
            (32, 2, 1),
            (64, 2, 15),
            (128, 2, 47),
            (256, 2, 111),
            (256, usize::MAX, 81),
            (1 << 20, 2, 524_271),
        ] {
            let room = ConnectionRoom::beside(limit, 14, threads);
            assert_eq!(room.requests, requests, "{limit}, {threads} threads");
        }
    }

    #[cfg(unix)]
    #[test]
    fn open_files_are_counted() {
        let before = open_now();
        let files: Vec<_> = (0..5).map(|_| tempfile::tempfile().unwrap()).collect();
        assert!(before > 2 && open_now() > before, "{}", files.len());
        assert_eq!(raise_limit(), raise_limit());
    }
}
