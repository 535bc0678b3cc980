//! The rate that an endpoint takes, learned from what it turns away: [`Learned`].

use std::collections::VecDeque;

use tokio::time::{Duration, Instant};

/// The distance to keep between requests, learned from pauses: guessed at the first, corrected while they come soon, and
/// measured once requests flowed for a while before one.
#[derive(Debug)]
pub(super) struct Learned {
    /// The distance.
    spacing: Duration,
    /// How well it is known.
    knowledge: Knowledge,
    /// The distance when the pause began that holds now.
    tried: Duration,
    /// When the last ones passed since the last pause.
    passed: VecDeque<Instant>,
    /// When the pause began that holds now; `None` while there is none.
    paused: Option<Instant>,
    /// How many were turned away in it.
    turned_away: usize,
    /// How many the endpoint took before its first pause: what it holds in store.
    store: Option<usize>,
    /// How many passed before the last pause that a longer distance had put off.
    lasted: usize,
    /// How many pauses since then have come no later for a longer distance.
    vain: u32,
}

/// How well the distance is known that an endpoint wants.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Knowledge {
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

/// So many pauses that no distance puts off are not about the rate: some servers turn requests away at random.
const VAIN: u32 = 8;

/// So many of them, and the rate is looked for anew.
const ANEW: u32 = 48;

/// So many passes are remembered.
const REMEMBERED: usize = 2048;

/// What is known of an endpoint's rate before anything is learned.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Beforehand {
    /// Nothing.
    Unknown,
    /// The user has stated it: one that is turned away shows that something else has used it up.
    Stated,
}

impl Learned {
    pub(super) fn new() -> Self {
        Self {
            spacing: Duration::ZERO,
            knowledge: Knowledge::Guessed,
            tried: Duration::ZERO,
            passed: VecDeque::new(),
            paused: None,
            turned_away: 0,
            store: None,
            lasted: 0,
            vain: 0,
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
                self.store = self.store.max(Some(self.taken()));
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
        let eased = self.spacing.mul_f64(EASING[self.knowledge as usize]);
        self.spacing = if eased < NEGLIGIBLE {
            Duration::ZERO
        } else {
            eased
        };
    }

    /// Notes that a request was turned away for so long.
    pub(super) fn turn_away(&mut self, now: Instant, wait: Duration, beforehand: Beforehand) {
        let paused = *self.paused.get_or_insert(now);
        self.turned_away += 1;
        if self.turned_away == 1 {
            self.tried = self.spacing;
            self.compare();
        }
        if self.vain >= VAIN {
            (self.knowledge, self.spacing) = (Knowledge::Guessed, self.tried);
            return;
        }
        let (knowledge, spacing) = match self.rate(paused) {
            Some(rate) => (
                Knowledge::Measured,
                Duration::from_secs_f64(1.0 / (rate * MARGIN)),
            ),
            // Too fast, if not by much: it was right a moment ago.
            None if !self.tried.is_zero() => (Knowledge::Corrected, self.tried.mul_f64(SLOWER)),
            None if beforehand == Beforehand::Stated => (Knowledge::Guessed, Duration::ZERO),
            None => {
                let time = self.counted(paused).saturating_add(wait);
                let taken = u32::try_from(self.taken()).unwrap_or(u32::MAX);
                (Knowledge::Guessed, time / PROBES.max(taken))
            }
        };
        (self.knowledge, self.spacing) = (knowledge, spacing.min(WIDEST));
    }

    /// Whether the distance kept since the last pause has put this one off: a limit on the rate is met later the slower
    /// requests come.
    fn compare(&mut self) {
        let passed = self.passed.len();
        if self.tried.is_zero() {
            // No distance was kept that could have put it off.
        } else if passed >= 2 * self.lasted {
            (self.lasted, self.vain) = (passed, 0);
        } else {
            self.vain = (self.vain + 1) % ANEW;
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
        let store = self.store? + self.turned_away;
        let times = self.passed.iter().enumerate();
        let rates = times.filter_map(|(before, since)| {
            let flow = (self.passed.len() - before).checked_sub(store)?;
            let lasted = paused - *since;
            (flow > 0 && lasted >= MEASURED).then(|| flow as f64 / lasted.as_secs_f64())
        });
        rates.reduce(f64::max)
    }
}
