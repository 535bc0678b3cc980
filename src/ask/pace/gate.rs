//! Rate limiter of an endpoint: [`Gate`] decides when the next request may be sent.

use crate::types::Decides;
use std::num::NonZeroU32;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use clap::Args;
use tokio::time::{Instant, sleep_until};

use super::allowance::{Allowance, Asks};
use super::learned::{LearnedRate, StatedRate, WIDEST};

/// What the user allows in a minute; `None` for any number.
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

/// How much of a quota's time may be used in advance, at twice its rate: servers that enforce a minute's limit do so by the
/// second, and hold no more than that in store.
const ADVANCE: Duration = Duration::from_millis(250);

/// How many tokens a request is taken for until a reply says how many it was charged: an image and a letter.
const FIRST_TOKENS: f64 = 1200.0;

/// No request has more: what a server says beyond it is no number to wait by.
const MOST_TOKENS: f64 = 1e7;

/// What a reply's tokens count in the mean.
const NEWEST: f64 = 0.1;

/// The gate of an endpoint. It stands open until the endpoint asks for a pause; then nobody passes until the pause is over,
/// and after it requests pass one by one, at the rate that the endpoint has shown it takes. Each success lets them pass a
/// little faster. A quota, and what the endpoint says is left, keep a distance of their own; the longest of all holds.
#[derive(Debug)]
pub(in crate::ask) struct Gate {
    quota: Quota,
    state: Mutex<State>,
}

#[derive(Debug)]
struct State {
    /// Nobody passes before.
    shut_until: Instant,
    /// When the next one would pass if all kept their distance.
    next: Instant,
    /// When the next one may pass at the earliest.
    earliest: Instant,
    learned: LearnedRate,
    /// The distance that the endpoint's own figures ask for.
    asked: Duration,
    /// Tokens of a request, on the mean.
    tokens: f64,
}

impl Gate {
    pub(in crate::ask) fn new(quota: Quota) -> Self {
        let now = Instant::now();
        Self {
            quota,
            state: Mutex::new(State {
                shut_until: now,
                next: now,
                earliest: now,
                learned: LearnedRate::new(),
                asked: Duration::ZERO,
                tokens: FIRST_TOKENS,
            }),
        }
    }

    /// Waits until the gate is open and it is one's turn.
    pub(in crate::ask) async fn pass(&self) {
        loop {
            let turn = self.state().reserve(Instant::now(), self.quota);
            sleep_until(turn).await;
            let mut state = self.state();
            // Shut again while waiting: that turn is void.
            if state.shut_until <= turn {
                let until = state.shut_until;
                state.learned.pass(Instant::now(), until);
                return;
            }
        }
    }

    /// Shuts the gate, as the endpoint has no room for so long; that says nothing about a rate.
    pub(in crate::ask) fn hold(&self, wait: Duration) {
        let (now, mut state) = (Instant::now(), self.state());
        state.shut(now.checked_add(wait).unwrap_or(now));
    }

    /// Shuts the gate, as the endpoint turned a request away for so long because of its rate.
    pub(in crate::ask) fn shut(&self, wait: Duration) {
        let stated = if self.quota == Quota::default() {
            StatedRate::Unknown
        } else {
            StatedRate::Known
        };
        let (now, mut state) = (Instant::now(), self.state());
        state.learned.turn_away(now, wait, stated);
        state.shut(now.checked_add(wait).unwrap_or(now));
    }

    /// Notes that a request succeeded, what it was charged, and what is left; pauses beyond `longest` are not kept.
    pub(in crate::ask) fn ease(&self, tokens: Option<u64>, left: Allowance, longest: Duration) {
        let mut state = self.state();
        if let Some(tokens) = tokens {
            let tokens = (tokens as f64).min(MOST_TOKENS);
            state.tokens += NEWEST * (tokens - state.tokens);
        }
        // What succeeds during a pause was sent before it, and says nothing about what comes after.
        if Instant::now() >= state.shut_until {
            state.learned.ease();
        }
        state.asked = match left.asks(state.tokens) {
            Asks::Nothing => Duration::ZERO,
            Asks::Spacing(spacing) => spacing.min(WIDEST),
            Asks::Pause(wait) => {
                let until = Instant::now().checked_add(wait);
                if let Some(until) = until.filter(|_| wait <= longest) {
                    state.shut(until);
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
    fn reserve(&mut self, now: Instant, quota: Quota) -> Instant {
        let minute = |share: f64| Duration::from_secs_f64(60.0 * share);
        let requests = quota
            .requests
            .map(|most| minute(1.0 / f64::from(most.get())));
        let tokens = quota
            .tokens
            .map(|most| minute(self.tokens / f64::from(most.get())));
        let quota = requests.max(tokens).unwrap_or_default();
        let own = self.learned.spacing().max(self.asked);
        // The user's own quota lets a few pass early; what the endpoint has shown does not.
        let advance = if quota > own { ADVANCE } else { Duration::ZERO };
        let due = self.next.max(now).max(self.shut_until);
        let early = due.checked_sub(advance).unwrap_or(now);
        let turn = early.max(self.earliest).max(now).max(self.shut_until);
        self.next = due + quota.max(own);
        self.earliest = turn + quota.max(own) / 2;
        turn
    }

    fn shut(&mut self, until: Instant) {
        if until > self.shut_until {
            // Turns given out before are void; those waiting queue anew from here.
            self.shut_until = until;
            (self.next, self.earliest) = (until, until);
        }
    }
}

#[cfg(test)]
mod tests;
