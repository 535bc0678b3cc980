//! The number of requests in flight: [`Window`] within [`Bounds`].

use std::fmt;
use std::num::NonZeroUsize;
use std::str::FromStr;
use std::sync::{Mutex, MutexGuard, PoisonError};

use tokio::time::{Duration, Instant};

/// The minimum, first and maximum number of requests in flight.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Bounds {
    least: NonZeroUsize,
    first: NonZeroUsize,
    most: NonZeroUsize,
}

impl Bounds {
    /// The default: it starts at 8, rises to 32 while replies do not get slower, and falls to 1 if the server is overloaded.
    pub const DEFAULT: Self = Self {
        least: NonZeroUsize::MIN,
        first: NonZeroUsize::new(8).unwrap(),
        most: NonZeroUsize::new(32).unwrap(),
    };

    /// The bounds of each of several replicas, so that the stated ones hold for all together, at least one each. The default holds
    /// for each.
    #[must_use]
    pub(in crate::ask) fn share(self, count: usize) -> Self {
        if self == Self::DEFAULT {
            return self;
        }
        let share = |number: NonZeroUsize| {
            NonZeroUsize::new(number.get().div_ceil(count.max(1))).unwrap_or(NonZeroUsize::MIN)
        };
        Self {
            least: share(self.least),
            first: share(self.first),
            most: share(self.most),
        }
    }

    /// The maximum number of requests in flight.
    #[must_use]
    pub fn most(self) -> usize {
        self.most.get()
    }
}

impl fmt::Display for Bounds {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.first == self.most {
            write!(f, "{}", self.most)
        } else {
            write!(f, "{}-{}", self.first, self.most)
        }
    }
}

impl FromStr for Bounds {
    type Err = String;

    /// Reads `32` (from there down to 1 and back), `4-64` (from 4 up to 64, never below 4) or `auto`.
    fn from_str(text: &str) -> Result<Self, String> {
        if text == "auto" {
            return Ok(Self::DEFAULT);
        }
        let (first, most) = text.split_once('-').unwrap_or((text, text));
        let range = text.contains('-');
        match (first.trim().parse::<NonZeroUsize>(), most.trim().parse()) {
            (Ok(first), Ok(most)) if first <= most => Ok(Self {
                least: if range { first } else { NonZeroUsize::MIN },
                first,
                most,
            }),
            _ => Err("a number of requests from 1 on, or a range like 4-64, expected".to_owned()),
        }
    }
}

/// The factor by which an overload narrows the window.
const CUT: f64 = 0.7;

/// A round whose replies take this much longer than in the quickest round ends the widening: the server only queues further
/// requests.
const QUEUEING: f64 = 1.5;

/// The window of an endpoint: additive increase, multiplicative decrease (Chiu and Jain 1989, Comput. Netw. ISDN Syst. 17:1).
///
/// Each round of successes widens it by one request while replies do not get slower. An overload (429, 503, 529, a timeout)
/// narrows it by a third, once for all requests in flight at that time.
#[derive(Debug)]
pub(in crate::ask) struct Window {
    bounds: Bounds,
    state: Mutex<State>,
}

#[derive(Debug)]
struct State {
    width: f64,
    /// The time of the last narrowing; overloads of requests that were sent before it are ignored.
    cut_at: Option<Instant>,
    /// The number of replies in the current round; `took` is their total time.
    replies: u32,
    took: Duration,
    /// The mean time of a reply in the quickest round; `None` before the first round ends.
    quickest: Option<Duration>,
    /// Whether the last round was too slow to widen the window.
    queueing: bool,
}

impl Window {
    pub(in crate::ask) fn new(bounds: Bounds) -> Self {
        Self {
            bounds,
            state: Mutex::new(State {
                width: bounds.first.get() as f64,
                cut_at: None,
                replies: 0,
                took: Duration::ZERO,
                quickest: None,
                queueing: false,
            }),
        }
    }

    /// The number of requests that may be in flight now.
    pub(in crate::ask) fn width(&self) -> usize {
        self.state().width as usize
    }

    /// Notes a reply that came after this time.
    pub(in crate::ask) fn succeeded(&self, took: Duration) {
        let mut state = self.state();
        state.replies += 1;
        state.took += took;
        if state.replies as f64 >= state.width {
            let mean = state.took / state.replies;
            let quickest = state.quickest.map_or(mean, |quickest| quickest.min(mean));
            state.quickest = Some(quickest);
            state.queueing = mean > quickest.mul_f64(QUEUEING);
            (state.replies, state.took) = (0, Duration::ZERO);
        }
        if !state.queueing {
            let wider = state.width + 1.0 / state.width;
            state.width = wider.min(self.bounds.most.get() as f64);
        }
    }

    /// Notes the overload of a request that was sent at this time.
    pub(in crate::ask) fn overloaded(&self, sent: Instant) {
        let mut state = self.state();
        if state.cut_at.is_none_or(|cut| sent > cut) {
            state.cut_at = Some(Instant::now());
            state.width = (state.width * CUT).max(self.bounds.least.get() as f64);
        }
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounds_read_back() {
        for text in ["1", "32", "4-64"] {
            assert_eq!(text.parse::<Bounds>().unwrap().to_string(), text);
        }
        assert_eq!(Bounds::DEFAULT.to_string(), "8-32");
        for wrong in ["", "0", "-4", "8-4", "4-", "a", "4-8-16"] {
            assert!(wrong.parse::<Bounds>().is_err(), "{wrong}");
        }
    }

    #[tokio::test(start_paused = true)]
    async fn the_window_widens_by_one_and_narrows_by_a_third() {
        let window = Window::new("8-32".parse().unwrap());
        for _ in 0..9 {
            window.succeeded(Duration::from_millis(200));
        }
        assert_eq!(window.width(), 9);
        for _ in 0..2000 {
            window.succeeded(Duration::from_millis(200));
        }
        assert_eq!(window.width(), 32);
        let sent = Instant::now();
        tokio::time::advance(Duration::from_millis(100)).await;
        for _ in 0..32 {
            window.overloaded(sent);
        }
        assert_eq!(window.width(), 22, "simultaneous overloads count once");
        for _ in 0..20 {
            tokio::time::advance(Duration::from_millis(100)).await;
            window.overloaded(Instant::now());
        }
        assert_eq!(window.width(), 8, "the lower bound");
    }

    #[test]
    fn the_window_stays_if_the_server_only_queues() {
        let window = Window::new("4-64".parse().unwrap());
        // The server answers one at a time: a reply waits for all that were sent before it.
        for _ in 0..2000 {
            window.succeeded(Duration::from_millis(100 * window.width() as u64));
        }
        assert!(window.width() <= 7, "{}", window.width());
    }
}
