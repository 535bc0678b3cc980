//! A time limit that counts only the time in which the process ran: [`TimeLimit`].
//!
//! A stopped process (Ctrl-Z, `scontrol suspend`, a closed laptop) reads nothing, while the clock goes on. The replies that arrive in
//! the pause are paid for: they must be read before a timeout is judged.

use std::pin::pin;
use std::time::Duration;

use tokio::time::{Instant, timeout};

/// The number of steps in which a limit is counted, and the shortest and longest step; chosen. A pause counts as one step.
const STEPS: u32 = 20;
const SHORTEST: Duration = Duration::from_millis(10);
const LONGEST: Duration = Duration::from_secs(1);

/// A step that ends this much too late contains a pause; chosen: a busy machine delays a timer less.
const PAUSE: Duration = Duration::from_millis(100);

/// A limit of the time in which the process runs, for one future or for several in turn.
#[derive(Debug)]
pub(super) struct TimeLimit {
    step: Duration,
    left: Duration,
    paused: Duration,
}

impl TimeLimit {
    /// A limit of which nothing is used.
    pub(super) fn new(limit: Duration) -> Self {
        Self {
            step: (limit / STEPS).clamp(SHORTEST, LONGEST),
            left: limit,
            paused: Duration::ZERO,
        }
    }

    /// The output of a future, or `None` if the limit is reached first.
    pub(super) async fn run<T>(&mut self, future: impl Future<Output = T>) -> Option<T> {
        let mut future = pin!(future);
        loop {
            // With no time left, what has arrived is read.
            let step = self.step.min(self.left);
            let started = Instant::now();
            let output = timeout(step, future.as_mut()).await;
            let took = started.elapsed();
            self.left = self.left.saturating_sub(took.min(step));
            let late = took.saturating_sub(step);
            if late > self.step.max(PAUSE) {
                self.paused += late;
                // One more step reads what arrived during the pause.
                self.left = self.left.max(self.step);
            }
            match output {
                Ok(output) => return Some(output),
                Err(_) if self.left.is_zero() => return None,
                Err(_) => {}
            }
        }
    }

    /// The time in which the process did not run, as far as it was noticed.
    pub(super) fn paused(&self) -> Duration {
        self.paused
    }
}

/// Sleeps for a time in which the process runs.
pub(crate) async fn sleep_running(time: Duration) {
    let _ = TimeLimit::new(time).run(std::future::pending::<()>()).await;
}

#[cfg(test)]
mod tests {
    use std::future::pending;
    use std::thread;

    use tokio::time::sleep;

    use super::*;

    const LIMIT: Duration = Duration::from_millis(400);

    /// A pause of the process, as far as its only thread is concerned.
    const STOPPED: Duration = Duration::from_millis(900);

    #[tokio::test(start_paused = true)]
    async fn limit_is_exact_without_pause() {
        for limit in [1, 7, 400, 120_000].map(Duration::from_millis) {
            let started = Instant::now();
            assert!(TimeLimit::new(limit).run(pending::<()>()).await.is_none());
            let took = started.elapsed();
            assert!(took >= limit && took < limit + SHORTEST, "{took:?}");
        }
    }

    #[tokio::test(start_paused = true)]
    async fn futures_share_the_limit() {
        let mut limit = TimeLimit::new(LIMIT);
        assert!(limit.run(sleep(LIMIT * 3 / 4)).await.is_some());
        assert!(limit.run(sleep(LIMIT / 2)).await.is_none());
        assert_eq!(limit.paused(), Duration::ZERO);
    }

    /// The pieces of a reply that arrive one by one.
    #[tokio::test(start_paused = true)]
    async fn short_futures_do_not_outlast_the_limit() {
        let mut limit = TimeLimit::new(LIMIT);
        let piece = Duration::from_millis(5);
        let mut read = 0;
        while limit.run(sleep(piece)).await.is_some() {
            read += 1;
            assert!(read <= LIMIT.as_millis() / piece.as_millis(), "{read}");
        }
        assert!(limit.run(async {}).await.is_some(), "what is there is read");
    }

    #[tokio::test]
    async fn pause_does_not_count() {
        let mut limit = TimeLimit::new(LIMIT);
        let done = limit.run(async {
            sleep(LIMIT / 4).await;
            thread::sleep(STOPPED);
            sleep(LIMIT / 4).await;
        });
        assert!(done.await.is_some());
        assert!(limit.paused() > STOPPED / 2, "{:?}", limit.paused());
    }

    #[tokio::test]
    async fn output_after_pause_comes_before_the_limit() {
        // A pause in the last step: the future is ready only some polls later, as a socket that another task reads.
        let mut limit = TimeLimit::new(LIMIT);
        limit.left = SHORTEST;
        let stop = tokio::spawn(async { thread::sleep(STOPPED) });
        let ready = async {
            stop.await.unwrap();
            for _ in 0..5 {
                tokio::task::yield_now().await;
            }
        };
        assert!(limit.run(ready).await.is_some());
    }
}
