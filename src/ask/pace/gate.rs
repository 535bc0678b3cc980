//! Rate limiter of an endpoint: [`Gate`] decides when the next request may be sent.

use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use tokio::time::{Instant, sleep_until};

use super::allowance::{PaceAdvice, RateLimits};
use super::learned::LearnedRate;
use super::quota::{Quota, QuotaWindow};

/// The maximum spacing that follows from the limits that a server reports, so that one report does not slow down the whole run.
const WIDEST: Duration = Duration::from_secs(5);

/// The assumed number of tokens of a request until a reply states one: an image and a letter.
const FIRST_TOKENS: f64 = 1200.0;

/// The maximum number of tokens of a request; a larger number from a server is wrong and is cut to this one.
const MOST_TOKENS: f64 = 1e7;

/// The weight of the newest reply in the mean number of tokens.
const NEWEST: f64 = 0.1;

/// The rate limiter of an endpoint, the last thing before a request is sent. Requests pass one by one, in the order in which they came.
/// Each waits for the user's quota, for the pauses that the endpoint asks for, for the rate that it was seen to accept, and for the
/// limits that it reports.
#[derive(Debug)]
pub(in crate::ask) struct Gate {
    state: Mutex<State>,
    /// Held by the request whose turn is next.
    turnstile: tokio::sync::Mutex<()>,
}

#[derive(Debug)]
struct State {
    quota: QuotaWindow,
    learned: LearnedRate,
    /// No request passes before this time: the endpoint has no capacity.
    paused_until: Instant,
    /// The time of the next request by the limits that the endpoint reports.
    next: Instant,
    /// The spacing that follows from these limits.
    reported_spacing: Duration,
    /// The mean number of tokens of a request.
    tokens: f64,
    /// The first of the refusals since the last success; `None` if there was none.
    refused_since: Option<Instant>,
}

impl Gate {
    pub(in crate::ask) fn new(quota: Quota) -> Self {
        let now = Instant::now();
        Self {
            state: Mutex::new(State {
                quota: QuotaWindow::new(quota, now),
                learned: LearnedRate::new(now, QuotaWindow::half_rate(quota)),
                paused_until: now,
                next: now,
                reported_spacing: Duration::ZERO,
                tokens: FIRST_TOKENS,
                refused_since: None,
            }),
            turnstile: tokio::sync::Mutex::new(()),
        }
    }

    /// Waits until the request may be sent; the time at which it is.
    pub(in crate::ask) async fn pass(&self) -> Instant {
        let _turn = self.turnstile.lock().await;
        loop {
            let turn = {
                let (now, mut state) = (Instant::now(), self.state());
                let turn = state.turn(now);
                if turn <= now {
                    state.sends(now);
                    return now;
                }
                turn
            };
            // What comes meanwhile may move the turn: it is computed again.
            sleep_until(turn).await;
        }
    }

    /// The time at which a request could be sent if none waited.
    pub(in crate::ask) fn ready_at(&self) -> Instant {
        let (now, mut state) = (Instant::now(), self.state());
        state.turn(now).max(now)
    }

    /// Pauses all requests, because the endpoint has no capacity; no rate is learned from it.
    pub(in crate::ask) fn pause(&self, wait: Duration) {
        let (now, mut state) = (Instant::now(), self.state());
        state.refused_since.get_or_insert(now);
        state.pause_until(now.checked_add(wait).unwrap_or(now));
    }

    /// Notes that a request that was sent at a time was turned away for its rate; `wait` is what the endpoint asks for.
    pub(in crate::ask) fn rate_limited(&self, sent: Instant, wait: Option<Duration>) {
        let (now, mut state) = (Instant::now(), self.state());
        state.refused_since.get_or_insert(now);
        state.learned.refused(now, sent, wait);
    }

    /// The time for which requests have been turned away without a success.
    pub(in crate::ask) fn refused_for(&self) -> Duration {
        let since = self.state().refused_since;
        since.map_or(Duration::ZERO, |since| since.elapsed())
    }

    /// Notes a success of a request that was sent at a time, its tokens and the remaining limits. Pauses of more than `max_wait` are
    /// ignored.
    pub(in crate::ask) fn succeeded(
        &self,
        sent: Instant,
        tokens: Option<u64>,
        allowance: RateLimits,
        max_wait: Duration,
    ) {
        let (now, mut state) = (Instant::now(), self.state());
        state.refused_since = None;
        if let Some(tokens) = tokens {
            state.quota.used(sent, tokens);
            let tokens = (tokens as f64).min(MOST_TOKENS);
            state.tokens += NEWEST * (tokens - state.tokens);
        }
        state.learned.took(now, sent);
        state.reported_spacing = match allowance.asks(state.tokens) {
            PaceAdvice::Nothing => Duration::ZERO,
            PaceAdvice::Spacing(spacing) => spacing.min(WIDEST),
            PaceAdvice::Pause(wait) => {
                let until = now.checked_add(wait);
                if let Some(until) = until.filter(|_| wait <= max_wait) {
                    state.pause_until(until);
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
    /// The time from which the next request may be sent.
    fn turn(&mut self, now: Instant) -> Instant {
        let limits = self.quota.turn(now).max(self.learned.turn());
        limits.max(self.paused_until).max(self.next)
    }

    fn sends(&mut self, now: Instant) {
        self.quota.sends(now);
        self.learned.sends(now);
        self.next = now + self.reported_spacing;
    }

    fn pause_until(&mut self, until: Instant) {
        self.paused_until = self.paused_until.max(until);
    }
}

#[cfg(test)]
mod tests;
