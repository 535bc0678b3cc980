//! The rate that an endpoint accepts, learned from its rejections: [`LearnedRate`].

use std::collections::VecDeque;

use tokio::time::{Duration, Instant};

/// The spacing between requests, learned from pauses. It is guessed at the first pause, corrected at later ones, and measured
/// if requests passed for at least a second before a pause.
#[derive(Debug)]
pub(super) struct LearnedRate {
    /// The current spacing; zero for none.
    spacing: Duration,
    /// The way in which the spacing became known.
    source: RateSource,
    /// The spacing at the beginning of the current pause.
    spacing_before_pause: Duration,
    /// The times of the last requests that passed since the last pause, at most [`REMEMBERED`].
    pass_times: VecDeque<Instant>,
    /// The beginning of the current pause; `None` if there is none.
    pause_start: Option<Instant>,
    /// The number of rejections in the current pause.
    rejections: usize,
    /// The number of requests that the endpoint accepted in a burst: the size of its token bucket.
    burst: Option<usize>,
    /// The number of requests before the last pause that a longer spacing had delayed.
    sent_before_pause: usize,
    /// The number of pauses since then that a longer spacing did not delay.
    unexplained_pauses: u32,
}

/// The way in which the spacing became known.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum RateSource {
    Guessed,
    Corrected,
    Measured,
}

/// The factors by which a success shortens a spacing that was guessed, corrected or measured: they halve it in 7, 69 and 3,465
/// successes.
const EASING: [f64; 3] = [0.9, 0.99, 0.9998];

/// The factor that lengthens a spacing that was too short.
const SLOWER: f64 = 1.5;

/// The share of a measured rate that is used: slightly below the rate nothing is rejected.
const MARGIN: f64 = 0.97;

/// The minimum spacing; a shorter one is set to zero.
const NEGLIGIBLE: Duration = Duration::from_millis(1);

/// The maximum spacing, so that one long pause does not slow down the whole run.
pub(super) const WIDEST: Duration = Duration::from_secs(5);

/// The minimum time over which a rate is measured.
const MEASURED: Duration = Duration::from_secs(1);

/// The minimum number of requests in the length of a pause if the rate is unknown.
const PROBES: u32 = 32;

/// After this many pauses that a longer spacing did not delay, the rate limit is not the cause: some servers reject requests at
/// random.
const UNEXPLAINED_PAUSES: u32 = 8;

/// After this many such pauses the rate is learned again.
const RELEARN_AFTER: u32 = 48;

/// The maximum number of requests whose times are remembered.
const REMEMBERED: usize = 2048;

/// Whether the user stated a rate for the endpoint.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum StatedRate {
    Unknown,
    /// The user stated a quota: a rejection within it means that other programs use the same limit.
    Known,
}

impl LearnedRate {
    pub(super) fn new() -> Self {
        Self {
            spacing: Duration::ZERO,
            source: RateSource::Guessed,
            spacing_before_pause: Duration::ZERO,
            pass_times: VecDeque::new(),
            pause_start: None,
            rejections: 0,
            burst: None,
            sent_before_pause: 0,
            unexplained_pauses: 0,
        }
    }

    /// The spacing between requests; zero for none.
    pub(super) fn spacing(&self) -> Duration {
        self.spacing
    }

    /// Notes that a request passes; `paused_until` is the end of the last pause.
    pub(super) fn pass(&mut self, now: Instant, paused_until: Instant) {
        if let Some(pause_start) = self.pause_start.filter(|_| now >= paused_until) {
            if self.time_before(pause_start) < MEASURED {
                self.burst = self.burst.max(Some(self.accepted()));
            }
            self.pause_start = None;
            self.pass_times.clear();
            self.rejections = 0;
        }
        self.pass_times.push_back(now);
        if self.pass_times.len() > REMEMBERED {
            self.pass_times.pop_front();
        }
    }

    /// Shortens the spacing slightly after a success.
    pub(super) fn shorten(&mut self) {
        let shorter = self.spacing.mul_f64(EASING[self.source as usize]);
        self.spacing = if shorter < NEGLIGIBLE {
            Duration::ZERO
        } else {
            shorter
        };
    }

    /// Notes that a request was rejected and the server asked for this wait.
    pub(super) fn note_rejection(&mut self, now: Instant, wait: Duration, stated: StatedRate) {
        let pause_start = *self.pause_start.get_or_insert(now);
        self.rejections += 1;
        if self.rejections == 1 {
            self.spacing_before_pause = self.spacing;
            self.check_cause();
        }
        if self.unexplained_pauses >= UNEXPLAINED_PAUSES {
            (self.source, self.spacing) = (RateSource::Guessed, self.spacing_before_pause);
            return;
        }
        let (source, spacing) = match self.rate(pause_start) {
            Some(rate) => (
                RateSource::Measured,
                Duration::from_secs_f64(1.0 / (rate * MARGIN)),
            ),
            // The spacing worked until now, so it is only slightly too short.
            None if !self.spacing_before_pause.is_zero() => (
                RateSource::Corrected,
                self.spacing_before_pause.mul_f64(SLOWER),
            ),
            None if stated == StatedRate::Known => (RateSource::Guessed, Duration::ZERO),
            None => {
                let time = self.time_before(pause_start).saturating_add(wait);
                let accepted = u32::try_from(self.accepted()).unwrap_or(u32::MAX);
                (RateSource::Guessed, time / PROBES.max(accepted))
            }
        };
        (self.source, self.spacing) = (source, spacing.min(WIDEST));
    }

    /// Notes whether the spacing delayed this pause: a rate limit is reached later if requests are slower.
    fn check_cause(&mut self) {
        let passed = self.pass_times.len();
        if self.spacing_before_pause.is_zero() {
            // Without a spacing nothing could delay the pause.
        } else if passed >= 2 * self.sent_before_pause {
            (self.sent_before_pause, self.unexplained_pauses) = (passed, 0);
        } else {
            self.unexplained_pauses = (self.unexplained_pauses + 1) % RELEARN_AFTER;
        }
    }

    /// The number of requests since the last pause that were not rejected.
    fn accepted(&self) -> usize {
        self.pass_times.len().saturating_sub(self.rejections)
    }

    /// The time from the first remembered request to the beginning of a pause.
    fn time_before(&self, pause_start: Instant) -> Duration {
        let first = self.pass_times.front();
        first.map_or(Duration::ZERO, |first| pause_start - *first)
    }

    /// The number of requests per second that the endpoint accepts, if it is a token bucket. It rejects a request when more
    /// passed since some moment than the bucket's size and its refill since then. The moment with the highest rate counts.
    fn rate(&self, pause_start: Instant) -> Option<f64> {
        let burst = self.burst? + self.rejections;
        let times = self.pass_times.iter().enumerate();
        let rates = times.filter_map(|(before, since)| {
            let refilled = (self.pass_times.len() - before).checked_sub(burst)?;
            let time = pause_start - *since;
            (refilled > 0 && time >= MEASURED).then(|| refilled as f64 / time.as_secs_f64())
        });
        rates.reduce(f64::max)
    }
}
