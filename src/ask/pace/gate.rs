//! Rate limiter of an endpoint: [`Gate`] decides when the next request may be sent.
//!
//! Request rate that an endpoint accepts, learned from its refusals: [`LearnedRate`].
//!
//! There is no rate before the first refusal. A refusal with a stated wait, or six refusals among the last ten answers,
//! starts a pause of all requests. The time between two pauses is a phase. Its rate is measured when the following
//! pause ends, not when it starts, because replies that were in flight then count too. The rate grows with time, not
//! with successes: fast while it is a guess and far below the ceiling, slowly near the ceiling. A single refusal
//! without a stated wait starts no pause: only its own trial is delayed. All constants were chosen by simulations of
//! token buckets, fixed and sliding minutes, and random refusals.
//!
//! Time for which requests had to wait before they were sent: [`HeldBack`].

#[cfg(test)]
mod tests;

use std::collections::VecDeque;
use std::fmt;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use tokio::time::{Instant, sleep_until};

use super::rate_limits::{INITIAL_TOKENS, MAX_TOKENS, PaceAdvice, Quota, QuotaWindow, RateLimits};

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

/// Minimum rate in requests per second, so that one long pause does not slow down the whole run.
const MIN_RATE: f64 = 0.2;

/// Factor from the measured to the used rate: slightly below the measured rate, nothing is refused.
const MARGIN: f64 = 0.97;

/// Minimum length of a phase, in seconds, and minimum number of accepted requests in it, to measure a rate.
const MEASURED_SECONDS: f64 = 3.0;
const MEASURED_REQUESTS: usize = 10;

/// Minimum length of the first phase and its pause, in seconds, for its rate to be reliable.
const RELIABLE_SECONDS: f64 = 10.0;

/// Factors that slow down after a phase too short to measure: for a reliable rate, and for a guessed one.
const SLOWDOWN_RELIABLE: f64 = 0.95;
const SLOWDOWN_GUESSED: f64 = 0.6;

/// Growth of the rate per second: for a guessed rate below [`FAR`] of the ceiling; for any rate below [`NEAR`] of it;
/// above.
const GROWTH: [f64; 3] = [0.6, 0.03, 0.003];
const FAR: f64 = 0.8;
const NEAR: f64 = 0.95;

/// Factor of the rate while requests use the credit that accumulated at the server during a pause.
const CATCH_UP: f64 = 3.0;

/// Number of recent answers to inspect, and number of refusals among them that starts a pause without a stated wait. A
/// server that refuses 5 % at random reaches it once in 300,000 answers.
const RECENT_ANSWERS: usize = 10;
const MIN_REFUSALS: usize = 6;

/// First and longest pause if the server states no wait.
const FIRST_PAUSE: Duration = Duration::from_millis(250);
const MAX_PAUSE: Duration = Duration::from_secs(30);

/// After this many pauses that a slower rate did not delay, the rate is not the cause: some servers refuse at random.
const MAX_INEFFECTIVE_PAUSES: u32 = 4;

/// Minimum number of accepted requests to assume for the first phase.
const MIN_ACCEPTED: usize = 8;

/// Learned rate, and the state from which it is learned.
#[derive(Debug)]
pub(super) struct LearnedRate {
    /// Requests per second; `None` if nothing limits them.
    rate: Option<f64>,
    /// Minimum rate, in requests per second.
    floor: f64,
    /// Estimate of the highest rate, in requests per second, that the server accepts.
    ceiling: Option<f64>,
    /// True if the rate comes from a long enough phase; false if it is a guess.
    is_reliable: bool,
    /// Start of the current phase: the end of the last pause.
    phase_start: Instant,
    /// Number of requests of this phase that were accepted.
    accepted: usize,
    /// Sending times of the accepted requests of the last `2 *` [`MEASURED_SECONDS`].
    recently_accepted: VecDeque<Instant>,
    pause: Option<Pause>,
    /// End of the pause in which no request passes.
    paused_until: Instant,
    /// Earliest time of the next request at this rate.
    next_at: Instant,
    /// Maximum number of requests that accumulate at the server while none are sent, as in a token bucket.
    burst: f64,
    /// Number of these requests that can still be used.
    credit: f64,
    credit_used_at: Option<Instant>,
    /// True for each recent answer that was a refusal.
    recent_answers: VecDeque<bool>,
    /// Number of pauses without an accepted request in between.
    consecutive_pauses: u32,
    /// Number of consecutive pauses that a slower rate did not delay.
    ineffective_pauses: u32,
    /// Number of requests accepted in the phase before the last pause.
    accepted_before_pause: Option<usize>,
    /// Time of the last growth of the rate.
    grown_at: Instant,
}

/// A pause that has not ended.
#[derive(Debug, Clone, Copy)]
struct Pause {
    /// Start of the phase before it.
    phase_start: Instant,
    start: Instant,
    length: Duration,
    /// Rate of that phase, in requests per second; `None` if it was unlimited.
    rate: Option<f64>,
}

impl LearnedRate {
    /// No limit yet. A rate learned later never falls below `min_rate`, in requests per second.
    pub(super) fn new(now: Instant, min_rate: f64) -> Self {
        Self {
            rate: None,
            floor: min_rate.max(MIN_RATE),
            ceiling: None,
            is_reliable: false,
            phase_start: now,
            accepted: 0,
            recently_accepted: VecDeque::new(),
            pause: None,
            paused_until: now,
            next_at: now,
            burst: 0.0,
            credit: 0.0,
            credit_used_at: None,
            recent_answers: VecDeque::new(),
            consecutive_pauses: 0,
            ineffective_pauses: 0,
            accepted_before_pause: None,
            grown_at: now,
        }
    }

    /// Earliest time at which the next request may be sent.
    pub(super) fn next_turn(&self) -> Instant {
        self.paused_until.max(self.next_at)
    }

    /// Records that a request is sent.
    pub(super) fn record_sent(&mut self, now: Instant) {
        if let Some(pause) = self.pause.filter(|_| now >= self.paused_until) {
            self.resume(pause, now);
        }
        let Some(rate) = self.rate else {
            self.next_at = now;
            return;
        };
        let mut gap = 1.0 / rate;
        if self.credit >= 1.0 {
            self.credit -= 1.0;
            self.credit_used_at = Some(now);
            gap /= CATCH_UP;
        }
        self.next_at = now + Duration::from_secs_f64(gap);
    }

    /// Ends a pause and starts a phase: computes the rate from the requests accepted before the pause.
    fn resume(&mut self, pause: Pause, now: Instant) {
        self.pause = None;
        let phase = (pause.start - pause.phase_start).as_secs_f64();
        let wait = pause.length.as_secs_f64();
        let rate = match pause.rate {
            None => {
                let span = (phase + wait).max(1.0);
                self.is_reliable = span >= RELIABLE_SECONDS;
                self.burst = self.accepted as f64;
                self.accepted.max(MIN_ACCEPTED) as f64 / span
            }
            Some(rate) if phase >= MEASURED_SECONDS && self.accepted >= MEASURED_REQUESTS => {
                // A phase that started slowly was faster at its end than on average.
                let average = self.accepted as f64 / phase;
                let ceiling = rate.min(average.max(self.late_rate(pause.start)));
                self.ceiling = Some(ceiling);
                self.is_reliable = true;
                MARGIN * ceiling
            }
            // Less credit had accumulated than assumed; the rate is not the cause.
            Some(rate) if self.used_credit_before(pause.start) => {
                self.burst = 0.0;
                rate
            }
            // A wait as short as one or two requests means that the rate is nearly right. A short phase reveals no
            // ceiling.
            Some(rate) if wait * rate < 2.0 => {
                if phase >= 1.0 {
                    self.is_reliable = true;
                    self.ceiling = Some(rate);
                }
                SLOWDOWN_RELIABLE * rate
            }
            Some(rate) => {
                let slower = if self.is_reliable { SLOWDOWN_RELIABLE } else { SLOWDOWN_GUESSED };
                self.ceiling = Some(rate);
                self.is_reliable |= phase >= 1.0;
                rate * slower
            }
        };
        let rate = rate.max(self.floor);
        self.credit = match pause.rate {
            None => 0.0,
            Some(_) => self.burst.min(rate * wait),
        };
        self.rate = Some(rate);
        self.phase_start = now;
        self.accepted = 0;
        self.recently_accepted.clear();
    }

    /// Accepted requests per second in the last [`MEASURED_SECONDS`] before a pause.
    fn late_rate(&self, pause_start: Instant) -> f64 {
        let window = Duration::from_secs_f64(MEASURED_SECONDS);
        self.recently_accepted.iter().filter(|sent| pause_start.saturating_duration_since(**sent) < window).count()
            as f64
            / MEASURED_SECONDS
    }

    /// True if a pause started less than a second after accumulated credit was used.
    fn used_credit_before(&self, pause_start: Instant) -> bool {
        self.credit_used_at
            .is_some_and(|used_at| pause_start.saturating_duration_since(used_at) < Duration::from_secs(1))
    }

    /// Records that the request sent at `sent` was accepted.
    pub(super) fn record_accepted(&mut self, now: Instant, sent: Instant) {
        if sent >= self.phase_start {
            self.accepted += 1;
            self.recently_accepted.push_back(sent);
            // Twice the measured time, because a pause may have started before the last of these requests.
            let max_age = Duration::from_secs_f64(2.0 * MEASURED_SECONDS);
            while let Some(first) = self.recently_accepted.front()
                && now.saturating_duration_since(*first) > max_age
            {
                self.recently_accepted.pop_front();
            }
        }
        self.remember(false);
        self.consecutive_pauses = 0;
        if let Some(rate) = self.rate.filter(|_| self.pause.is_none()) {
            let growth = if !self.is_reliable && self.ceiling.is_none_or(|ceiling| rate < FAR * ceiling) {
                GROWTH[0]
            } else if self.ceiling.is_none_or(|ceiling| rate < NEAR * ceiling) {
                GROWTH[1]
            } else {
                GROWTH[2]
            };
            let seconds = (now - self.grown_at).as_secs_f64().min(1.0);
            self.rate = Some(rate * libm::pow(1.0 + growth, seconds));
        }
        self.grown_at = now;
    }

    /// Records that the request sent at `sent` was refused; `wait` is the wait that the server asked for.
    pub(super) fn record_refused(&mut self, now: Instant, sent: Instant, wait: Option<Duration>) {
        self.remember(true);
        if self.pause.is_some() || sent < self.phase_start {
            // Already covered by the current pause.
            if let Some(until) = wait.and_then(|wait| now.checked_add(wait)) {
                self.paused_until = self.paused_until.max(until);
            }
            return;
        }
        let refusals = self.recent_answers.iter().filter(|refused| **refused).count();
        if wait.is_none() && refusals < MIN_REFUSALS {
            if let Some(rate) = self.rate {
                self.ceiling = Some(rate);
                self.is_reliable = true;
                self.rate = Some((SLOWDOWN_RELIABLE * rate).max(self.floor));
            }
            return;
        }
        let doublings = self.consecutive_pauses.min(16);
        self.consecutive_pauses += 1;
        let default = FIRST_PAUSE.saturating_mul(1 << doublings).min(MAX_PAUSE);
        let length = wait.unwrap_or(default);
        self.check_cause(wait);
        let Some(until) = now.checked_add(length) else {
            return;
        };
        self.paused_until = self.paused_until.max(until);
        self.pause = Some(Pause { phase_start: self.phase_start, start: now, length, rate: self.rate });
    }

    /// Removes the limit if slower rates did not delay the last pauses: then the rate is not the cause of the refusals.
    fn check_cause(&mut self, wait: Option<Duration>) {
        let is_ineffective = self.rate.is_some()
            && wait.is_none()
            && self.accepted_before_pause.is_some_and(|before| self.accepted < 2 * before);
        self.ineffective_pauses = if is_ineffective { self.ineffective_pauses + 1 } else { 0 };
        self.accepted_before_pause = Some(self.accepted);
        if self.ineffective_pauses >= MAX_INEFFECTIVE_PAUSES {
            self.rate = None;
            self.ceiling = None;
            self.is_reliable = false;
            self.ineffective_pauses = 0;
        }
    }

    fn remember(&mut self, refused: bool) {
        if self.recent_answers.len() == RECENT_ANSWERS {
            self.recent_answers.pop_front();
        }
        self.recent_answers.push_back(refused);
    }
}

/// Cause of a wait before a request.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PaceCause {
    /// The user's limits.
    Quota,
    /// Requests that the endpoint refused.
    Refusals,
    /// Limits that the endpoint reports in its headers.
    ReportedLimits,
}

/// As a remark on what limits the speed.
impl fmt::Display for PaceCause {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Quota => "--rpm or --tpm limits the speed",
            Self::Refusals => {
                "the endpoint turns requests away (status 429 or 503), which limits the speed: a higher limit of the account, or a server \
                 with more capacity, would help"
            }
            Self::ReportedLimits => {
                "the limits per minute that the endpoint states limit the speed: a higher limit of the account would help"
            }
        })
    }
}

/// Time for which the first request of the queue had to wait, by cause.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct HeldBack([Duration; 3]);

impl HeldBack {
    const CAUSES: [PaceCause; 3] = [PaceCause::Quota, PaceCause::Refusals, PaceCause::ReportedLimits];

    /// Adds a wait.
    pub fn add(&mut self, cause: PaceCause, time: Duration) {
        self.0[cause as usize] += time;
    }

    /// The longer wait for each cause, of two queues that waited at the same time.
    #[must_use]
    pub fn longest(self, other: Self) -> Self {
        Self(std::array::from_fn(|cause| self.0[cause].max(other.0[cause])))
    }

    /// The cause of the longest wait, with its time.
    #[must_use]
    pub fn main_cause(self) -> (PaceCause, Duration) {
        let waits = Self::CAUSES.into_iter().zip(self.0);
        waits.max_by_key(|(_, time)| *time).unwrap_or((PaceCause::Quota, Duration::ZERO))
    }
}
