//! The rate that an endpoint takes, learned from what it turns away: [`LearnedRate`].

use std::collections::VecDeque;

use tokio::time::{Duration, Instant};

/// The distance to keep between requests, learned from pauses: guessed at the first, corrected while they come soon, and
/// measured once requests flowed for a while before one.
#[derive(Debug)]
pub(super) struct LearnedRate {
    /// The distance.
    spacing: Duration,
    /// How it became known.
    source: RateSource,
    /// The distance when the pause began that holds now.
    tried: Duration,
    /// When the last ones passed since the last pause.
    passed: VecDeque<Instant>,
    /// When the pause began that holds now; `None` while there is none.
    paused: Option<Instant>,
    /// How many were turned away in it.
    turned_away: usize,
    /// How many the endpoint took before its first pause: the size of its bucket.
    burst: Option<usize>,
    /// How many passed before the last pause that a longer spacing had delayed.
    sent_before_pause: usize,
    /// How many pauses since then a longer spacing has not delayed.
    unexplained_pauses: u32,
}

/// How the spacing that an endpoint wants became known.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum RateSource {
    Guessed,
    Corrected,
    Measured,
}

/// What a success leaves of a distance that was guessed, that was too short once, and that was measured: it is halved in 7,
/// in 69 and in 3,465 successes.
const EASING: [f64; 3] = [0.9, 0.99, 0.9998];

/// What a pause makes of a distance that was too short.
const SLOWER: f64 = 1.5;

/// A measured rate is used to this share: a little below it nothing is turned away.
const MARGIN: f64 = 0.97;

/// Below this distance there is none.
const NEGLIGIBLE: Duration = Duration::from_millis(1);

/// The longest distance, so that one long pause does not leave a run crawling.
pub(super) const WIDEST: Duration = Duration::from_secs(5);

/// The shortest time over which a rate is measured.
const MEASURED: Duration = Duration::from_secs(1);

/// Where nothing is known of the rate, so many at least pass in the length of the pause.
const PROBES: u32 = 32;

/// After this many pauses that a longer spacing did not delay, the rate limit is not the cause: some servers reject requests at
/// random.
const UNEXPLAINED_PAUSES: u32 = 8;

/// After this many of them the rate is learned again.
const RELEARN_AFTER: u32 = 48;

/// The maximum number of passes that are remembered.
const REMEMBERED: usize = 2048;

/// What is known of an endpoint's rate before anything is learned.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum StatedRate {
    /// Nothing.
    Unknown,
    /// The user has stated it: one that is turned away shows that something else has used it up.
    Known,
}

impl LearnedRate {
    pub(super) fn new() -> Self {
        Self {
            spacing: Duration::ZERO,
            source: RateSource::Guessed,
            tried: Duration::ZERO,
            passed: VecDeque::new(),
            paused: None,
            turned_away: 0,
            burst: None,
            sent_before_pause: 0,
            unexplained_pauses: 0,
        }
    }

    /// The distance to keep.
    pub(super) fn spacing(&self) -> Duration {
        self.spacing
    }

    /// Notes that a request passes, `paused_until` being when the last pause ends.
    pub(super) fn pass(&mut self, now: Instant, paused_until: Instant) {
        if let Some(paused) = self.paused.filter(|_| now >= paused_until) {
            if self.counted(paused) < MEASURED {
                self.burst = self.burst.max(Some(self.taken()));
            }
            self.paused = None;
            self.passed.clear();
            self.turned_away = 0;
        }
        self.passed.push_back(now);
        if self.passed.len() > REMEMBERED {
            self.passed.pop_front();
        }
    }

    /// Notes a success, after which the distance may be a little shorter.
    pub(super) fn ease(&mut self) {
        let eased = self.spacing.mul_f64(EASING[self.source as usize]);
        self.spacing = if eased < NEGLIGIBLE {
            Duration::ZERO
        } else {
            eased
        };
    }

    /// Notes that a request was turned away for so long.
    pub(super) fn turn_away(&mut self, now: Instant, wait: Duration, stated: StatedRate) {
        let paused = *self.paused.get_or_insert(now);
        self.turned_away += 1;
        if self.turned_away == 1 {
            self.tried = self.spacing;
            self.compare();
        }
        if self.unexplained_pauses >= UNEXPLAINED_PAUSES {
            (self.source, self.spacing) = (RateSource::Guessed, self.tried);
            return;
        }
        let (source, spacing) = match self.rate(paused) {
            Some(rate) => (
                RateSource::Measured,
                Duration::from_secs_f64(1.0 / (rate * MARGIN)),
            ),
            // Too fast, if not by much: it was right a moment ago.
            None if !self.tried.is_zero() => (RateSource::Corrected, self.tried.mul_f64(SLOWER)),
            None if stated == StatedRate::Known => (RateSource::Guessed, Duration::ZERO),
            None => {
                let time = self.counted(paused).saturating_add(wait);
                let taken = u32::try_from(self.taken()).unwrap_or(u32::MAX);
                (RateSource::Guessed, time / PROBES.max(taken))
            }
        };
        (self.source, self.spacing) = (source, spacing.min(WIDEST));
    }

    /// Whether the distance kept since the last pause has put this one off: a limit on the rate is met later the slower
    /// requests come.
    fn compare(&mut self) {
        let passed = self.passed.len();
        if self.tried.is_zero() {
            // No distance was kept that could have put it off.
        } else if passed >= 2 * self.sent_before_pause {
            (self.sent_before_pause, self.unexplained_pauses) = (passed, 0);
        } else {
            self.unexplained_pauses = (self.unexplained_pauses + 1) % RELEARN_AFTER;
        }
    }

    /// How many passed since the last pause and were not turned away.
    fn taken(&self) -> usize {
        self.passed.len().saturating_sub(self.turned_away)
    }

    /// How long they passed before this pause began.
    fn counted(&self, paused: Instant) -> Duration {
        let first = self.passed.front();
        first.map_or(Duration::ZERO, |first| paused - *first)
    }

    /// How many in a second the endpoint takes: it turned one away when, since some moment, more had passed than it held in
    /// store and was filled up with since (a token bucket). That moment is the one that asks for the highest rate.
    fn rate(&self, paused: Instant) -> Option<f64> {
        let burst = self.burst? + self.turned_away;
        let times = self.passed.iter().enumerate();
        let rates = times.filter_map(|(before, since)| {
            let flow = (self.passed.len() - before).checked_sub(burst)?;
            let lasted = paused - *since;
            (flow > 0 && lasted >= MEASURED).then(|| flow as f64 / lasted.as_secs_f64())
        });
        rates.reduce(f64::max)
    }
}
