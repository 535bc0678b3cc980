//! The turnstile of an endpoint: [`Gate`].

use std::collections::VecDeque;
use std::num::NonZeroU32;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use tokio::time::{Instant, sleep_until};

use super::allowance::{Allowance, Asks};

/// What the user allows in a minute; `None` for any number.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Quota {
    /// Requests.
    pub requests: Option<NonZeroU32>,
    /// Tokens, of prompts and replies together.
    pub tokens: Option<NonZeroU32>,
}

/// How much of a quota's time may be used at once: servers that enforce a minute's limit do so by the second.
const BURST: Duration = Duration::from_millis(250);

/// How many tokens a request is taken for until a reply says how many it was charged: an image and a letter.
const FIRST_TOKENS: f64 = 1200.0;

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
    /// The distance learned from pauses.
    learned: Duration,
    /// Whether it was measured over a time with little in store.
    measured: bool,
    /// The distance that the endpoint's own figures ask for.
    asked: Duration,
    /// Tokens of a request, on the mean.
    tokens: f64,
    /// When the last ones passed since the last pause.
    passed: VecDeque<Instant>,
    /// When the pause began that holds now; `None` while there is none.
    paused: Option<Instant>,
    turned_away: usize,
    /// How many the endpoint took before its first pause: what it holds in store.
    store: Option<usize>,
}

/// What a success leaves of a distance that was guessed, and of one that was measured: it is halved in 14 successes, and in
/// 3,465.
const EASING: [f64; 2] = [0.95, 0.9998];

/// A measured rate is used to this share: a little below it nothing is turned away.
const MARGIN: f64 = 0.97;

/// Below this distance there is none.
const NEGLIGIBLE: Duration = Duration::from_millis(1);

/// The longest distance, so that one long pause does not leave a run crawling.
const WIDEST: Duration = Duration::from_secs(5);

/// The shortest time over which a rate is measured.
const MEASURED: Duration = Duration::from_secs(1);

/// Where nothing is known of the rate, so many pass in the length of the pause.
const PROBES: u32 = 32;

/// So many passes are remembered.
const REMEMBERED: usize = 2048;

impl Gate {
    pub(in crate::ask) fn new(quota: Quota) -> Self {
        let now = Instant::now();
        Self {
            quota,
            state: Mutex::new(State {
                shut_until: now,
                next: now,
                learned: Duration::ZERO,
                measured: false,
                asked: Duration::ZERO,
                tokens: FIRST_TOKENS,
                passed: VecDeque::new(),
                paused: None,
                turned_away: 0,
                store: None,
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
                state.passed.push_back(Instant::now());
                if state.passed.len() > REMEMBERED {
                    state.passed.pop_front();
                }
                return;
            }
        }
    }

    /// Shuts the gate, as the endpoint turned a request away for so long.
    pub(in crate::ask) fn shut(&self, wait: Duration) {
        self.state().turn_away(Instant::now(), wait);
    }

    /// Notes that a request succeeded, what it was charged, and what is left; pauses beyond `longest` are not kept.
    pub(in crate::ask) fn ease(&self, tokens: Option<u64>, left: Allowance, longest: Duration) {
        let mut state = self.state();
        if let Some(tokens) = tokens {
            state.tokens += NEWEST * (tokens as f64 - state.tokens);
        }
        let eased = state.learned.mul_f64(EASING[usize::from(state.measured)]);
        state.learned = if eased < NEGLIGIBLE {
            Duration::ZERO
        } else {
            eased
        };
        state.asked = match left.asks(state.tokens) {
            Asks::Nothing => Duration::ZERO,
            Asks::Spacing(spacing) => spacing.min(WIDEST),
            Asks::Pause(wait) => {
                if wait <= longest {
                    state.shut(Instant::now() + wait);
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
        if self.paused.is_some() && now >= self.shut_until {
            self.paused = None;
            self.passed.clear();
            self.turned_away = 0;
        }
        let minute = |share: f64| Duration::from_secs_f64(60.0 * share);
        let requests = quota
            .requests
            .map(|most| minute(1.0 / f64::from(most.get())));
        let tokens = quota
            .tokens
            .map(|most| minute(self.tokens / f64::from(most.get())));
        let quota = requests.max(tokens).unwrap_or_default();
        let own = self.learned.max(self.asked);
        // The user's own quota lets a few pass at once; what the endpoint has shown does not.
        let burst = if quota > own { BURST } else { Duration::ZERO };
        let due = self.next.max(now);
        let turn = due.checked_sub(burst).map_or(now, |early| early.max(now));
        let turn = turn.max(self.shut_until);
        self.next = due.max(self.shut_until) + quota.max(own);
        turn
    }

    fn turn_away(&mut self, now: Instant, wait: Duration) {
        let paused = *self.paused.get_or_insert(now);
        self.turned_away += 1;
        let taken = self.passed.len().saturating_sub(self.turned_away);
        let counted = self
            .passed
            .front()
            .map_or(Duration::ZERO, |first| paused - *first);
        let rate = self.rate(paused).filter(|_| counted >= MEASURED);
        self.measured = rate.is_some();
        let spacing = match rate {
            Some(rate) => Duration::from_secs_f64(1.0 / (rate * MARGIN)),
            None if taken > 0 => counted.saturating_add(wait) / taken as u32,
            None => self.learned.max(wait / PROBES),
        };
        self.learned = spacing.min(WIDEST);
        if self.store.is_none() || counted < MEASURED {
            self.store = self.store.max(Some(taken));
        }
        self.shut(now.checked_add(wait).unwrap_or(now));
    }

    /// How many in a second the endpoint takes: it turned one away when, since some moment, more had passed than it held in
    /// store and was filled up with since (a token bucket). That moment is the one that asks for the highest rate.
    fn rate(&self, paused: Instant) -> Option<f64> {
        let store = self.store? + self.turned_away;
        let times = self.passed.iter().enumerate();
        let rates = times.filter_map(|(before, since)| {
            let flow = (self.passed.len() - before).checked_sub(store)?;
            let seconds = (paused - *since).as_secs_f64();
            (flow > 0 && seconds > 0.0).then(|| flow as f64 / seconds)
        });
        rates.reduce(f64::max)
    }

    fn shut(&mut self, until: Instant) {
        self.shut_until = self.shut_until.max(until);
        // Turns given out before are void; those waiting queue anew from here.
        self.next = self.shut_until;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn free() -> Gate {
        Gate::new(Quota::default())
    }

    fn ease(gate: &Gate) {
        gate.ease(None, Allowance::default(), Duration::MAX);
    }

    #[tokio::test(start_paused = true)]
    async fn an_open_gate_delays_nobody() {
        let gate = free();
        let start = Instant::now();
        for _ in 0..1000 {
            gate.pass().await;
            ease(&gate);
        }
        assert_eq!(start.elapsed(), Duration::ZERO);
    }

    #[tokio::test(start_paused = true)]
    async fn a_shut_gate_holds_all_and_lets_them_go_at_the_rate_shown() {
        let gate = free();
        let start = Instant::now();
        for _ in 0..15 {
            gate.pass().await;
        }
        for _ in 0..5 {
            gate.shut(Duration::from_secs(2));
        }
        // Ten were taken, then a pause of 2 s: one in 200 ms.
        let mut passed = Vec::new();
        for _ in 0..3 {
            gate.pass().await;
            passed.push(start.elapsed().as_millis());
        }
        assert_eq!(passed, [2000, 2200, 2400]);
        for _ in 0..300 {
            ease(&gate);
        }
        gate.pass().await;
        let eased = start.elapsed();
        gate.pass().await;
        assert_eq!(start.elapsed(), eased);
    }

    #[tokio::test(start_paused = true)]
    async fn those_waiting_wait_on_when_it_shuts_again() {
        let gate = std::sync::Arc::new(free());
        let start = Instant::now();
        gate.shut(Duration::from_secs(1));
        let waiting = tokio::spawn({
            let gate = gate.clone();
            async move { gate.pass().await }
        });
        tokio::time::sleep(Duration::from_millis(900)).await;
        gate.shut(Duration::from_secs(4));
        waiting.await.unwrap();
        assert!(start.elapsed() >= Duration::from_millis(4900));
        // One that is dropped while waiting leaves the gate as it was.
        gate.shut(Duration::from_secs(1));
        let dropped = tokio::time::timeout(Duration::from_millis(10), gate.pass()).await;
        assert!(dropped.is_err());
        gate.pass().await;
    }

    #[tokio::test(start_paused = true)]
    async fn a_quota_is_kept_from_the_first_request_on() {
        let quota = Quota {
            requests: NonZeroU32::new(1200),
            tokens: None,
        };
        let gate = Gate::new(quota);
        let start = Instant::now();
        for _ in 0..300 {
            gate.pass().await;
        }
        // 20 in a second, a quarter of a second's worth of them at once.
        let took = start.elapsed();
        assert!(took >= Duration::from_millis(14_650), "{took:?}");
        assert!(took <= Duration::from_secs(15), "{took:?}");
        tokio::time::sleep(Duration::from_mins(1)).await;
        let idle = Instant::now();
        for _ in 0..26 {
            gate.pass().await;
        }
        assert!(
            idle.elapsed() >= Duration::from_secs(1),
            "no minute is saved up"
        );
    }

    #[tokio::test(start_paused = true)]
    async fn tokens_are_counted_by_what_replies_were_charged() {
        let quota = Quota {
            requests: None,
            tokens: NonZeroU32::new(60_000),
        };
        let gate = Gate::new(quota);
        for _ in 0..200 {
            gate.pass().await;
            gate.ease(Some(2000), Allowance::default(), Duration::MAX);
        }
        let start = Instant::now();
        for _ in 0..10 {
            gate.pass().await;
        }
        let took = start.elapsed().as_secs_f64();
        assert!((19.0..21.0).contains(&took), "{took}");
    }

    /// A server that holds `store` requests and lets `rate` of them in each second; what 300 requests of 32 at once take, and
    /// how often they are turned away.
    async fn against(store: f64, rate: f64, wait: Duration) -> (f64, u32) {
        let gate = std::sync::Arc::new(free());
        let level = std::sync::Arc::new(Mutex::new((store, Instant::now())));
        let start = Instant::now();
        let mut asking = tokio::task::JoinSet::new();
        let left = std::sync::Arc::new(std::sync::atomic::AtomicU32::new(300));
        let away = std::sync::Arc::new(std::sync::atomic::AtomicU32::new(0));
        for _ in 0..32 {
            let (gate, level, left, away) =
                (gate.clone(), level.clone(), left.clone(), away.clone());
            asking.spawn(async move {
                use std::sync::atomic::Ordering::Relaxed;
                while left
                    .fetch_update(Relaxed, Relaxed, |n| n.checked_sub(1))
                    .is_ok()
                {
                    loop {
                        gate.pass().await;
                        let taken = {
                            let mut level = level.lock().unwrap();
                            let now = Instant::now();
                            let filled = level.0 + (now - level.1).as_secs_f64() * rate;
                            *level = (filled.min(store), now);
                            level.0 >= 1.0 && {
                                level.0 -= 1.0;
                                true
                            }
                        };
                        if taken {
                            tokio::time::sleep(Duration::from_millis(100)).await;
                            ease(&gate);
                            break;
                        }
                        away.fetch_add(1, Relaxed);
                        gate.shut(wait);
                    }
                }
            });
        }
        while asking.join_next().await.is_some() {}
        (
            start.elapsed().as_secs_f64(),
            away.load(std::sync::atomic::Ordering::Relaxed),
        )
    }

    #[tokio::test(start_paused = true)]
    async fn an_unknown_rate_is_found_out() {
        // Without a limit in the way it were 14 s.
        let (took, away) = against(20.0, 20.0, Duration::from_secs(2)).await;
        assert!(took < 19.0 && away < 5, "{took} s, {away} turned away");
    }
}
