//! Rate limiter of an endpoint: [`Gate`] decides when the next request may be sent.

use crate::types::Decides;
use std::num::NonZeroU32;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use clap::Args;
use tokio::time::{Instant, sleep_until};

use super::allowance::{Allowance, Asks};
use super::learned::{LearnedRate, StatedRate, WIDEST};

/// The user's limits per minute; `None` for no limit.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Args)]
#[command(next_help_heading = "Sending")]
pub struct Quota {
    /// The most requests in a minute; default: as many as the server takes
    #[arg(id = "rpm", long, value_name = "N", add = Decides::Nothing)]
    pub requests: Option<NonZeroU32>,
    /// The most tokens in a minute, of prompts and replies; default: as many as the server takes
    #[arg(id = "tpm", long, value_name = "N", add = Decides::Nothing)]
    pub tokens: Option<NonZeroU32>,
}

/// The part of a quota's time that may be used in advance, at twice its rate. Servers that enforce a limit per minute do so by
/// the second and allow no larger burst.
const ADVANCE: Duration = Duration::from_millis(250);

/// The assumed number of tokens of a request until a reply states one: an image and a letter.
const FIRST_TOKENS: f64 = 1200.0;

/// The maximum number of tokens of a request; a larger number from a server is wrong and is cut to this one.
const MOST_TOKENS: f64 = 1e7;

/// The weight of the newest reply in the mean number of tokens.
const NEWEST: f64 = 0.1;

/// The rate limiter of an endpoint. It is open until the endpoint asks for a pause; then no request passes until the pause is
/// over. After it requests pass one by one, at the rate that the endpoint accepted before, and slightly faster after each
/// success. The quota and the limits that the endpoint reports give a spacing too; the longest spacing applies.
#[derive(Debug)]
pub(in crate::ask) struct Gate {
    quota: Quota,
    state: Mutex<State>,
}

#[derive(Debug)]
struct State {
    /// No request passes before this time.
    paused_until: Instant,
    /// The time of the next request if none is sent in advance.
    next: Instant,
    /// The earliest time of the next request.
    earliest: Instant,
    learned: LearnedRate,
    /// The spacing that follows from the endpoint's rate limit headers.
    reported_spacing: Duration,
    /// The mean number of tokens of a request.
    tokens: f64,
}

impl Gate {
    pub(in crate::ask) fn new(quota: Quota) -> Self {
        let now = Instant::now();
        Self {
            quota,
            state: Mutex::new(State {
                paused_until: now,
                next: now,
                earliest: now,
                learned: LearnedRate::new(),
                reported_spacing: Duration::ZERO,
                tokens: FIRST_TOKENS,
            }),
        }
    }

    /// Waits until the request may be sent.
    pub(in crate::ask) async fn pass(&self) {
        loop {
            let turn = self.state().reserve(Instant::now(), self.quota);
            sleep_until(turn).await;
            let mut state = self.state();
            // After a further pause during the wait, the turn is not valid any more.
            if state.paused_until <= turn {
                let until = state.paused_until;
                state.learned.pass(Instant::now(), until);
                return;
            }
        }
    }

    /// Pauses all requests, because the endpoint has no capacity; no rate is learned from it.
    pub(in crate::ask) fn pause(&self, wait: Duration) {
        let (now, mut state) = (Instant::now(), self.state());
        state.pause_until(now.checked_add(wait).unwrap_or(now));
    }

    /// Pauses all requests, because the endpoint rejected one for its rate limit; the rate is learned from it.
    pub(in crate::ask) fn rate_limited(&self, wait: Duration) {
        let stated = if self.quota == Quota::default() {
            StatedRate::Unknown
        } else {
            StatedRate::Known
        };
        let (now, mut state) = (Instant::now(), self.state());
        state.learned.note_rejection(now, wait, stated);
        state.pause_until(now.checked_add(wait).unwrap_or(now));
    }

    /// Notes a success, its tokens and the remaining limits. Pauses of more than `max_wait` are ignored.
    pub(in crate::ask) fn succeeded(
        &self,
        tokens: Option<u64>,
        allowance: Allowance,
        max_wait: Duration,
    ) {
        let mut state = self.state();
        if let Some(tokens) = tokens {
            let tokens = (tokens as f64).min(MOST_TOKENS);
            state.tokens += NEWEST * (tokens - state.tokens);
        }
        // A request that succeeds during a pause was sent before it, so it says nothing about the rate after it.
        if Instant::now() >= state.paused_until {
            state.learned.shorten();
        }
        state.reported_spacing = match allowance.asks(state.tokens) {
            Asks::Nothing => Duration::ZERO,
            Asks::Spacing(spacing) => spacing.min(WIDEST),
            Asks::Pause(wait) => {
                let until = Instant::now().checked_add(wait);
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
    /// The time at which the next request may be sent; the one after it comes later.
    fn reserve(&mut self, now: Instant, quota: Quota) -> Instant {
        let minute = |share: f64| Duration::from_secs_f64(60.0 * share);
        let requests = quota
            .requests
            .map(|most| minute(1.0 / f64::from(most.get())));
        let tokens = quota
            .tokens
            .map(|most| minute(self.tokens / f64::from(most.get())));
        let quota = requests.max(tokens).unwrap_or_default();
        let learned = self.learned.spacing().max(self.reported_spacing);
        // The user's quota lets a few requests pass in advance; the endpoint's limits do not.
        let advance = if quota > learned {
            ADVANCE
        } else {
            Duration::ZERO
        };
        let scheduled = self.next.max(now).max(self.paused_until);
        let early = scheduled.checked_sub(advance).unwrap_or(now);
        let turn = early.max(self.earliest).max(now).max(self.paused_until);
        self.next = scheduled + quota.max(learned);
        self.earliest = turn + quota.max(learned) / 2;
        turn
    }

    fn pause_until(&mut self, until: Instant) {
        if until > self.paused_until {
            // Earlier turns are not valid any more; waiting requests get new ones from here.
            self.paused_until = until;
            (self.next, self.earliest) = (until, until);
        }
    }
}

#[cfg(test)]
mod tests;
