//! Rate limiter of an endpoint: [`Gate`] decides when the next request may be sent.

use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use tokio::time::{Instant, sleep_until};

use super::held_back::{HeldBack, PaceCause};
use super::learned_rate::LearnedRate;
use super::quota::{INITIAL_TOKENS, MAX_TOKENS, Quota, QuotaWindow};
use super::rate_limits::{PaceAdvice, RateLimits};

/// Maximum spacing derived from reported limits. It keeps a single extreme report from slowing down the whole run.
const MAX_SPACING: Duration = Duration::from_secs(5);

/// Weight of the newest reply in the moving average of tokens per request.
const NEWEST_WEIGHT: f64 = 0.1;

/// Rate limiter of an endpoint, the last step before a request is sent. Requests pass one by one, in arrival order.
///
/// Each request waits for the user's quota, the endpoint's pauses, the learned rate and the reported limits.
#[derive(Debug)]
pub(crate) struct Gate {
    state: Mutex<State>,
    /// Locked by the request whose turn is next; the others queue for the lock.
    queue: tokio::sync::Mutex<()>,
}

#[derive(Debug)]
struct State {
    quota: QuotaWindow,
    learned: LearnedRate,
    /// End of the current pause, because the endpoint has no capacity.
    paused_until: Instant,
    /// Earliest time of the next request under the limits that the endpoint reports.
    reported_until: Instant,
    /// Time between requests, derived from the limits that the endpoint reports.
    reported_spacing: Duration,
    /// Moving average of tokens per request.
    mean_tokens: f64,
    /// Time for which requests had to wait so far.
    held_back: HeldBack,
    /// Time of the first refusal since the last success; `None` without one.
    refused_since: Option<Instant>,
}

impl Gate {
    pub(crate) fn new(quota: Quota) -> Self {
        let now = Instant::now();
        Self {
            state: Mutex::new(State {
                quota: QuotaWindow::new(quota, now),
                learned: LearnedRate::new(now, QuotaWindow::half_rate(quota)),
                paused_until: now,
                reported_until: now,
                reported_spacing: Duration::ZERO,
                mean_tokens: INITIAL_TOKENS,
                held_back: HeldBack::default(),
                refused_since: None,
            }),
            queue: tokio::sync::Mutex::new(()),
        }
    }

    /// Waits until the request may be sent; returns the send time.
    pub(crate) async fn pass(&self) -> Instant {
        let _turn = self.queue.lock().await;
        loop {
            let now = Instant::now();
            let (turn, cause) = {
                let mut state = self.state();
                let (turn, cause) = state.next_turn(now);
                if turn <= now {
                    state.record_sent(now);
                    return now;
                }
                (turn, cause)
            };
            // Recompute the turn after the sleep: a reply that arrives in the meantime may move it.
            sleep_until(turn).await;
            self.state().held_back.add(cause, now.elapsed());
        }
    }

    /// Earliest send time of a new request, ignoring the requests in the queue.
    pub(crate) fn ready_at(&self) -> Instant {
        let now = Instant::now();
        let mut state = self.state();
        state.next_turn(now).0.max(now)
    }

    /// Time for which the first request of the queue had to wait so far.
    pub(crate) fn held_back(&self) -> HeldBack {
        self.state().held_back
    }

    /// Pauses all requests, because the endpoint has no capacity. The learned rate does not change.
    pub(crate) fn pause(&self, wait: Duration) {
        let now = Instant::now();
        let mut state = self.state();
        state.refused_since.get_or_insert(now);
        state.pause_until(now.checked_add(wait).unwrap_or(now));
    }

    /// Records that the request sent at `sent` was rate limited; `wait` is the wait that the endpoint asked for.
    pub(crate) fn record_rate_limited(&self, sent: Instant, wait: Option<Duration>) {
        let now = Instant::now();
        let mut state = self.state();
        state.refused_since.get_or_insert(now);
        state.learned.record_refused(now, sent, wait);
    }

    /// Time since the first refusal after the last success; zero without a refusal.
    pub(crate) fn refused_for(&self) -> Duration {
        let since = self.state().refused_since;
        since.map_or(Duration::ZERO, |since| since.elapsed())
    }

    /// Records the success of the request sent at `sent`: its tokens, and the limits that the response reports.
    ///
    /// A reported pause longer than `max_wait` is ignored.
    pub(crate) fn record_success(&self, sent: Instant, tokens: Option<u64>, limits: RateLimits, max_wait: Duration) {
        let now = Instant::now();
        let mut state = self.state();
        state.refused_since = None;
        if let Some(tokens) = tokens {
            state.quota.record_tokens(sent, tokens);
            let tokens = (tokens as f64).min(MAX_TOKENS);
            state.mean_tokens += NEWEST_WEIGHT * (tokens - state.mean_tokens);
        }
        state.learned.record_accepted(now, sent);
        state.reported_spacing = match limits.advice(state.mean_tokens) {
            PaceAdvice::Nothing => Duration::ZERO,
            PaceAdvice::Spacing(spacing) => spacing.min(MAX_SPACING),
            PaceAdvice::Pause(wait) => {
                let until = now.checked_add(wait);
                if let Some(until) = until.filter(|_| wait <= max_wait) {
                    state.reported_until = state.reported_until.max(until);
                }
                Duration::ZERO
            }
        };
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl State {
    /// Earliest time at which the next request may be sent, and the cause of the wait until then.
    fn next_turn(&mut self, now: Instant) -> (Instant, PaceCause) {
        let refused_until = self.learned.next_turn().max(self.paused_until);
        let turns = [
            (self.quota.next_turn(now), PaceCause::Quota),
            (refused_until, PaceCause::Refusals),
            (self.reported_until, PaceCause::ReportedLimits),
        ];
        turns
            .into_iter()
            .reduce(|latest, next| if next.0 > latest.0 { next } else { latest })
            .unwrap_or((now, PaceCause::Quota))
    }

    fn record_sent(&mut self, now: Instant) {
        self.quota.record_sent(now);
        self.learned.record_sent(now);
        self.reported_until = now + self.reported_spacing;
    }

    fn pause_until(&mut self, until: Instant) {
        self.paused_until = self.paused_until.max(until);
    }
}

#[cfg(test)]
mod tests;
