//! The rate that an endpoint accepts, learned from the requests that it turns away: [`LearnedRate`].
//!
//! Before the first refusal there is no rate. A refusal that states a wait, or six among the last ten answers, begins a pause for
//! all. The rate is measured when a pause ends, not when it begins, because the replies that were in flight then count too. It grows
//! by time, not by success: fast while it is guessed and well below what was accepted, slowly near it. A lone refusal without a
//! stated wait delays its own trial alone. All constants are chosen, by simulations of token buckets, fixed and sliding minutes
//! and random refusals.

use std::collections::VecDeque;

use tokio::time::{Duration, Instant};

/// The least rate in requests per second, so that one long pause does not slow down the whole run.
const SLOWEST: f64 = 0.2;

/// The rate that is used, as a share of a measured one: slightly below it nothing is refused.
const MARGIN: f64 = 0.97;

/// The least duration in seconds, and the least number of accepted requests, of a run between pauses that measures a rate.
const MEASURED_SECONDS: f64 = 3.0;
const MEASURED_REQUESTS: usize = 10;

/// The time of the first run and its pause, in seconds, from which its rate is called known.
const KNOWN_SECONDS: f64 = 10.0;

/// The factors of a rate that was refused too early to measure it: once it was known, and while it was guessed.
const SLOWER_KNOWN: f64 = 0.95;
const SLOWER_GUESSED: f64 = 0.6;

/// The growth of the rate per second: while guessed and below [`FAR`] of the ceiling, below [`NEAR`] of it, and above.
const GROWTH: [f64; 3] = [0.6, 0.03, 0.003];
const FAR: f64 = 0.8;
const NEAR: f64 = 0.95;

/// The factor of the rate at which requests use what the server has saved up during a pause.
const CATCHING_UP: f64 = 3.0;

/// The number of last answers that are looked at, and of refusals among them that begin a pause without a stated wait. A server that
/// turns 5 % away at random reaches it once in 300,000 answers.
const RECENT: usize = 10;
const MANY_REFUSALS: usize = 6;

/// The first and the longest pause if the server states none.
const FIRST_PAUSE: Duration = Duration::from_millis(250);
const LONGEST_PAUSE: Duration = Duration::from_secs(30);

/// The number of pauses that a slower rate did not delay, after which refusals are not about the rate.
const IN_VAIN: u32 = 4;

/// The least number of requests that the first run is taken to have had accepted.
const FIRST_TAKEN: usize = 8;

/// The learned rate, with the pauses that it was learned from.
#[derive(Debug)]
pub(super) struct LearnedRate {
    /// Requests per second; `None` if nothing limits them.
    rate: Option<f64>,
    /// The least rate.
    floor: f64,
    /// The highest rate that was seen to be accepted.
    ceiling: Option<f64>,
    /// Whether the rate was measured, not guessed.
    known: bool,
    /// The beginning of the run of requests since the last pause.
    run_began: Instant,
    /// The number of requests of this run that were accepted.
    taken: usize,
    /// The times at which those of the last [`MEASURED_SECONDS`] were sent.
    taken_lately: VecDeque<Instant>,
    pause: Option<Pause>,
    /// No request passes before this time.
    hold: Instant,
    /// The time of the next request by the rate.
    next: Instant,
    /// The number of requests that the server saves up while none are sent.
    store: f64,
    /// The number of them that are left to use.
    credit: f64,
    credit_used: Option<Instant>,
    /// Whether each of the last answers was a refusal.
    recent: VecDeque<bool>,
    /// The number of pauses without an accepted request between them.
    pauses_in_a_row: u32,
    /// The number of pauses that a slower rate did not delay.
    in_vain: u32,
    taken_before_pause: Option<usize>,
    grown: Instant,
}

/// A pause that is not over.
#[derive(Debug, Clone, Copy)]
struct Pause {
    /// The beginning of the run of requests before it.
    run_began: Instant,
    began: Instant,
    length: Duration,
    /// The rate of that run.
    rate: Option<f64>,
}

impl LearnedRate {
    /// Nothing is known. `least` is a rate in requests per second below which it never falls.
    pub(super) fn new(now: Instant, least: f64) -> Self {
        Self {
            rate: None,
            floor: least.max(SLOWEST),
            ceiling: None,
            known: false,
            run_began: now,
            taken: 0,
            taken_lately: VecDeque::new(),
            pause: None,
            hold: now,
            next: now,
            store: 0.0,
            credit: 0.0,
            credit_used: None,
            recent: VecDeque::new(),
            pauses_in_a_row: 0,
            in_vain: 0,
            taken_before_pause: None,
            grown: now,
        }
    }

    /// The time from which the next request may be sent.
    pub(super) fn turn(&self) -> Instant {
        self.hold.max(self.next)
    }

    /// Notes that a request is sent.
    pub(super) fn sends(&mut self, now: Instant) {
        if let Some(pause) = self.pause.filter(|_| now >= self.hold) {
            self.resume(pause, now);
        }
        let Some(rate) = self.rate else {
            self.next = now;
            return;
        };
        let mut gap = 1.0 / rate;
        if self.credit >= 1.0 {
            (self.credit, self.credit_used) = (self.credit - 1.0, Some(now));
            gap /= CATCHING_UP;
        }
        self.next = now + Duration::from_secs_f64(gap);
    }

    /// A pause is over; by now it is known what was accepted before it.
    fn resume(&mut self, pause: Pause, now: Instant) {
        self.pause = None;
        let (run, wait) = (
            (pause.began - pause.run_began).as_secs_f64(),
            pause.length.as_secs_f64(),
        );
        let rate = match pause.rate {
            None => {
                let span = (run + wait).max(1.0);
                (self.known, self.store) = (span >= KNOWN_SECONDS, self.taken as f64);
                self.taken.max(FIRST_TAKEN) as f64 / span
            }
            Some(rate) if run >= MEASURED_SECONDS && self.taken >= MEASURED_REQUESTS => {
                // A run that began slowly was faster in the end than on average.
                let average = self.taken as f64 / run;
                let ceiling = rate.min(average.max(self.late_rate(pause.began)));
                (self.ceiling, self.known) = (Some(ceiling), true);
                MARGIN * ceiling
            }
            // Less was saved up than thought; the rate is not to blame.
            Some(rate) if self.used_credit_before(pause.began) => {
                self.store = 0.0;
                rate
            }
            // A wait of one request or two shows that the rate is nearly right; after a short run it reveals nothing about a ceiling.
            Some(rate) if wait * rate < 2.0 => {
                if run >= 1.0 {
                    (self.known, self.ceiling) = (true, Some(rate));
                }
                SLOWER_KNOWN * rate
            }
            Some(rate) => {
                let slower = if self.known {
                    SLOWER_KNOWN
                } else {
                    SLOWER_GUESSED
                };
                self.ceiling = Some(rate);
                self.known |= run >= 1.0;
                rate * slower
            }
        };
        let rate = rate.max(self.floor);
        self.credit = match pause.rate {
            None => 0.0,
            Some(_) => self.store.min(rate * wait),
        };
        self.rate = Some(rate);
        (self.run_began, self.taken) = (now, 0);
        self.taken_lately.clear();
    }

    /// The accepted requests per second in the last [`MEASURED_SECONDS`] before a pause.
    fn late_rate(&self, pause_began: Instant) -> f64 {
        let lately = Duration::from_secs_f64(MEASURED_SECONDS);
        self.taken_lately
            .iter()
            .filter(|sent| pause_began.saturating_duration_since(**sent) < lately)
            .count() as f64
            / MEASURED_SECONDS
    }

    /// Whether a pause began within a second after saved-up requests were used.
    fn used_credit_before(&self, pause_began: Instant) -> bool {
        let used = self.credit_used;
        used.is_some_and(|used| {
            pause_began.saturating_duration_since(used) < Duration::from_secs(1)
        })
    }

    /// Notes a success of a request that was sent at a time.
    pub(super) fn took(&mut self, now: Instant, sent: Instant) {
        if sent >= self.run_began {
            self.taken += 1;
            self.taken_lately.push_back(sent);
            // Twice the time, because a pause may have begun before the last of them.
            let kept = Duration::from_secs_f64(2.0 * MEASURED_SECONDS);
            while let Some(first) = self.taken_lately.front()
                && now.saturating_duration_since(*first) > kept
            {
                self.taken_lately.pop_front();
            }
        }
        self.remember(false);
        self.pauses_in_a_row = 0;
        if let Some(rate) = self.rate.filter(|_| self.pause.is_none()) {
            let is_below = |share: f64| self.ceiling.is_none_or(|ceiling| rate < share * ceiling);
            let growth = if !self.known && is_below(FAR) {
                GROWTH[0]
            } else if is_below(NEAR) {
                GROWTH[1]
            } else {
                GROWTH[2]
            };
            let seconds = (now - self.grown).as_secs_f64().min(1.0);
            self.rate = Some(rate * libm::pow(1.0 + growth, seconds));
        }
        self.grown = now;
    }

    /// Notes a refusal of a request that was sent at a time; `wait` is what the server asks for.
    pub(super) fn refused(&mut self, now: Instant, sent: Instant, wait: Option<Duration>) {
        self.remember(true);
        if self.pause.is_some() || sent < self.run_began {
            // It belongs to a pause that is known.
            let until = wait.and_then(|wait| now.checked_add(wait));
            self.hold = until.map_or(self.hold, |until| self.hold.max(until));
            return;
        }
        let refusals = self.recent.iter().filter(|refused| **refused).count();
        if wait.is_none() && refusals < MANY_REFUSALS {
            if let Some(rate) = self.rate {
                (self.ceiling, self.known) = (Some(rate), true);
                self.rate = Some((SLOWER_KNOWN * rate).max(self.floor));
            }
            return;
        }
        let doublings = self.pauses_in_a_row.min(16);
        self.pauses_in_a_row += 1;
        let own = FIRST_PAUSE
            .saturating_mul(1 << doublings)
            .min(LONGEST_PAUSE);
        let length = wait.unwrap_or(own);
        self.check_cause(wait);
        let Some(until) = now.checked_add(length) else {
            return;
        };
        self.hold = self.hold.max(until);
        self.pause = Some(Pause {
            run_began: self.run_began,
            began: now,
            length,
            rate: self.rate,
        });
    }

    /// Forgets the rate if a slower one did not delay the last refusals: then they are not about the rate.
    fn check_cause(&mut self, wait: Option<Duration>) {
        let no_later = self.rate.is_some()
            && wait.is_none()
            && self
                .taken_before_pause
                .is_some_and(|before| self.taken < 2 * before);
        self.in_vain = if no_later { self.in_vain + 1 } else { 0 };
        self.taken_before_pause = Some(self.taken);
        if self.in_vain >= IN_VAIN {
            (self.rate, self.ceiling, self.known, self.in_vain) = (None, None, false, 0);
        }
    }

    fn remember(&mut self, refused: bool) {
        if self.recent.len() == RECENT {
            self.recent.pop_front();
        }
        self.recent.push_back(refused);
    }
}
