//! Time limit that excludes suspensions of the process: [`TimeLimit`].
//!
//! A suspended process (Ctrl-Z, `scontrol suspend`, a closed laptop) reads nothing, but the clock runs on. Replies that
//! arrive during the suspension are paid for, so they must be read before a timeout is declared.

use std::pin::pin;
use std::time::Duration;

use tokio::time::{Instant, timeout};

/// Number of steps into which a limit is divided (chosen). A suspension uses up at most one step of the limit.
const STEPS: u32 = 20;
/// Shortest step (chosen).
const MIN_STEP: Duration = Duration::from_millis(10);
/// Longest step (chosen).
const MAX_STEP: Duration = Duration::from_secs(1);

/// Minimum timer delay of a suspension (chosen): a busy machine delays a timer less. The delay must also exceed one
/// step.
const MIN_SUSPENSION: Duration = Duration::from_millis(100);

/// Limit on the running time of one future, or of several futures one after another. Suspensions of the process do not
/// count.
#[derive(Debug)]
pub(super) struct TimeLimit {
    step: Duration,
    /// Running time left.
    left: Duration,
    /// Total time of the detected suspensions.
    suspended: Duration,
}

impl TimeLimit {
    pub(super) fn new(limit: Duration) -> Self {
        Self { step: (limit / STEPS).clamp(MIN_STEP, MAX_STEP), left: limit, suspended: Duration::ZERO }
    }

    /// Runs a future; `None` if the limit is reached before the future is ready.
    pub(super) async fn run<T>(&mut self, future: impl Future<Output = T>) -> Option<T> {
        let mut future = pin!(future);
        loop {
            // With no time left, a step of zero still reads data that has arrived.
            let step = self.step.min(self.left);
            let started = Instant::now();
            let output = timeout(step, future.as_mut()).await;
            let elapsed = started.elapsed();
            self.left = self.left.saturating_sub(elapsed.min(step));
            let delay = elapsed.saturating_sub(step);
            if delay > self.step.max(MIN_SUSPENSION) {
                self.suspended += delay;
                // One more step reads data that arrived during the suspension.
                self.left = self.left.max(self.step);
            }
            match output {
                Ok(output) => return Some(output),
                Err(_) if self.left.is_zero() => return None,
                Err(_) => {}
            }
        }
    }

    /// Total time of the detected suspensions of the process.
    pub(super) fn suspended(&self) -> Duration {
        self.suspended
    }
}

/// Sleeps for a running time; suspensions of the process do not count.
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

    /// Length of a simulated suspension: the only thread of the test runtime sleeps.
    const SUSPENSION: Duration = Duration::from_millis(900);

    #[tokio::test(start_paused = true)]
    async fn limit_is_exact_without_suspension() {
        for limit in [1, 7, 400, 120_000].map(Duration::from_millis) {
            let started = Instant::now();
            assert!(TimeLimit::new(limit).run(pending::<()>()).await.is_none());
            let took = started.elapsed();
            assert!(took >= limit && took < limit + MIN_STEP, "{took:?}");
        }
    }

    #[tokio::test(start_paused = true)]
    async fn futures_share_the_limit() {
        let mut limit = TimeLimit::new(LIMIT);
        assert!(limit.run(sleep(LIMIT * 3 / 4)).await.is_some());
        assert!(limit.run(sleep(LIMIT / 2)).await.is_none());
        assert_eq!(limit.suspended(), Duration::ZERO);
    }

    /// Each future represents one chunk of a streamed reply.
    #[tokio::test(start_paused = true)]
    async fn short_futures_do_not_outlast_the_limit() {
        let mut limit = TimeLimit::new(LIMIT);
        let interval = Duration::from_millis(5);
        let mut chunks = 0;
        while limit.run(sleep(interval)).await.is_some() {
            chunks += 1;
            assert!(chunks <= LIMIT.as_millis() / interval.as_millis(), "{chunks}");
        }
        assert!(limit.run(async {}).await.is_some(), "data that has arrived is read");
    }

    #[tokio::test]
    async fn suspension_does_not_count() {
        let mut limit = TimeLimit::new(LIMIT);
        let done = limit.run(async {
            sleep(LIMIT / 4).await;
            thread::sleep(SUSPENSION);
            sleep(LIMIT / 4).await;
        });
        assert!(done.await.is_some());
        assert!(limit.suspended() > SUSPENSION / 2, "{:?}", limit.suspended());
    }

    #[tokio::test]
    async fn late_output_is_read_after_suspension() {
        // The suspension is in the last step. The future is ready some polls later, like a socket that another task
        // reads.
        let mut limit = TimeLimit::new(LIMIT);
        limit.left = MIN_STEP;
        let suspension = tokio::spawn(async { thread::sleep(SUSPENSION) });
        let ready = async {
            suspension.await.unwrap();
            for _ in 0..5 {
                tokio::task::yield_now().await;
            }
        };
        assert!(limit.run(ready).await.is_some());
    }
}
