//! When to send: what `Retry-After` says, and the [`Gate`] that all requests to one endpoint pass.

use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, SystemTime};

use reqwest::header::{HeaderMap, RETRY_AFTER};
use tokio::time::{Instant, sleep_until};

/// How long a server asks to wait: `retry-after-ms`, else `Retry-After` in seconds (fractions too) or as a date. `None` where it asks
/// for nothing, for no time, or in a form nobody knows.
pub(super) fn asked_wait(headers: &HeaderMap, now: SystemTime) -> Option<Duration> {
    let text = |name: &str| headers.get(name)?.to_str().ok();
    let after = || text(RETRY_AFTER.as_str());
    text("retry-after-ms")
        .and_then(|ms| seconds(ms, 1e-3))
        .or_else(|| seconds(after()?, 1.0))
        .or_else(|| {
            let date = httpdate::parse_http_date(after()?.trim()).ok()?;
            date.duration_since(now).ok().filter(|wait| !wait.is_zero())
        })
}

/// A positive number of units; longer than can be written down is as long as can be.
fn seconds(text: &str, unit: f64) -> Option<Duration> {
    let seconds = text.trim().parse::<f64>().ok()? * unit;
    (seconds.is_finite() && seconds > 0.0)
        .then(|| Duration::try_from_secs_f64(seconds).unwrap_or(Duration::MAX))
}

/// The gate of an endpoint. It stands open until the endpoint asks for a pause; then nobody passes until the pause is over,
/// and after it requests pass one by one, at the rate that the endpoint has just shown it takes. Each success lets
/// them pass a little faster, until there is no distance left between them.
#[derive(Debug)]
pub(super) struct Gate(Mutex<State>);

#[derive(Debug)]
struct State {
    /// Nobody passes before.
    shut_until: Instant,
    /// When the next one may pass.
    next: Instant,
    /// The distance between two that pass.
    spacing: Duration,
    /// Since when requests are counted.
    since: Instant,
    /// How long they were counted before the pause began; `None` while there is none.
    counted: Option<Duration>,
    passed: u32,
    turned_away: u32,
}

/// What a success leaves of the distance: 14 of them halve it.
const EASING: f64 = 0.95;

/// Below this distance there is none.
const NEGLIGIBLE: Duration = Duration::from_millis(1);

/// The longest distance, so that one long pause does not leave a run crawling.
const WIDEST: Duration = Duration::from_secs(5);

/// Where nothing is known of the rate, so many pass in the length of the pause.
const PROBES: u32 = 32;

impl Gate {
    pub(super) fn new() -> Self {
        let now = Instant::now();
        Self(Mutex::new(State {
            shut_until: now,
            next: now,
            spacing: Duration::ZERO,
            since: now,
            counted: None,
            passed: 0,
            turned_away: 0,
        }))
    }

    /// Waits until the gate is open and it is one's turn.
    pub(super) async fn pass(&self) {
        loop {
            let turn = self.state().reserve(Instant::now());
            sleep_until(turn).await;
            let mut state = self.state();
            // Shut again while waiting: that turn is void.
            if state.shut_until <= turn {
                state.passed = state.passed.saturating_add(1);
                return;
            }
        }
    }

    /// Shuts the gate, as the endpoint turned a request away for so long.
    pub(super) fn shut(&self, wait: Duration) {
        self.state().shut(Instant::now(), wait);
    }

    /// Notes that a request succeeded.
    pub(super) fn ease(&self) {
        let mut state = self.state();
        let eased = state.spacing.mul_f64(EASING);
        state.spacing = if eased < NEGLIGIBLE {
            Duration::ZERO
        } else {
            eased
        };
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl State {
    fn reserve(&mut self, now: Instant) -> Instant {
        if self.counted.is_some() && now >= self.shut_until {
            self.counted = None;
            self.since = self.shut_until;
            (self.passed, self.turned_away) = (0, 0);
        }
        let turn = self.next.max(self.shut_until).max(now);
        self.next = turn + self.spacing;
        turn
    }

    fn shut(&mut self, now: Instant, wait: Duration) {
        let counted = *self.counted.get_or_insert(now - self.since);
        self.turned_away = self.turned_away.saturating_add(1);
        // What the endpoint took, over the time until it takes more, is the rate it takes.
        let taken = self.passed.saturating_sub(self.turned_away);
        let spacing = match taken {
            0 => self.spacing.max(wait / PROBES),
            taken => counted.saturating_add(wait) / taken,
        };
        self.spacing = spacing.min(WIDEST);
        let until = now.checked_add(wait).unwrap_or(now);
        self.shut_until = self.shut_until.max(until);
        // Turns given out before are void; those waiting queue anew from here.
        self.next = self.shut_until;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wait(pairs: &[(&'static str, &str)]) -> Option<Duration> {
        let mut headers = HeaderMap::new();
        for (name, value) in pairs {
            headers.insert(*name, value.parse().unwrap());
        }
        let now = SystemTime::UNIX_EPOCH + Duration::from_secs(784_111_777);
        asked_wait(&headers, now)
    }

    #[test]
    fn waits_of_every_form_are_read() {
        let ms = |ms| Some(Duration::from_millis(ms));
        for (pairs, expected) in [
            (vec![("retry-after", "2")], ms(2000)),
            (vec![("retry-after", " 0.25 ")], ms(250)),
            (vec![("retry-after", "2"), ("retry-after-ms", "50")], ms(50)),
            (
                vec![("retry-after", "2"), ("retry-after-ms", "soon")],
                ms(2000),
            ),
            (
                vec![("retry-after", "Sun, 06 Nov 1994 08:49:47 GMT")],
                ms(10_000),
            ),
            (vec![("retry-after", "Sun, 06 Nov 1994 08:49:37 GMT")], None),
            (vec![("retry-after", "Sun, 06 Nov 1904 08:49:37 GMT")], None),
            (vec![("retry-after", "1e300")], Some(Duration::MAX)),
            (vec![("retry-after", "NaN")], None),
            (vec![("retry-after", "inf")], None),
            (vec![("retry-after", "-1")], None),
            (vec![("retry-after", "0")], None),
            (vec![("retry-after", "")], None),
            (vec![], None),
        ] {
            assert_eq!(wait(&pairs), expected, "{pairs:?}");
        }
    }

    #[tokio::test(start_paused = true)]
    async fn an_open_gate_delays_nobody() {
        let gate = Gate::new();
        let start = Instant::now();
        for _ in 0..1000 {
            gate.pass().await;
            gate.ease();
        }
        assert_eq!(start.elapsed(), Duration::ZERO);
    }

    #[tokio::test(start_paused = true)]
    async fn a_shut_gate_holds_all_and_lets_them_go_at_the_rate_shown() {
        let gate = Gate::new();
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
            gate.ease();
        }
        gate.pass().await;
        let eased = start.elapsed();
        gate.pass().await;
        assert_eq!(start.elapsed(), eased);
    }

    #[tokio::test(start_paused = true)]
    async fn those_waiting_wait_on_when_it_shuts_again() {
        let gate = std::sync::Arc::new(Gate::new());
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
}
