//! The maximum number of requests in flight ([`Window`]), adapted within [`ConcurrencyBounds`].

use std::fmt;
use std::num::NonZeroUsize;
use std::str::FromStr;
use std::sync::{Mutex, MutexGuard, PoisonError};

use tokio::time::{Duration, Instant};

/// Bounds of the number of requests in flight (`--concurrency`): minimum, initial value and maximum.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ConcurrencyBounds {
    min: NonZeroUsize,
    initial: NonZeroUsize,
    max: NonZeroUsize,
}

impl ConcurrencyBounds {
    /// The default, `auto`: from 8 up to 32 while replies do not get slower, down to 1 if the server is overloaded.
    pub const DEFAULT: Self =
        Self { min: NonZeroUsize::MIN, initial: NonZeroUsize::new(8).unwrap(), max: NonZeroUsize::new(32).unwrap() };

    /// Bounds for each of `count` replicas, so that these bounds apply to all replicas together, with at least one
    /// request each. The default bounds are not divided: each replica gets them whole.
    #[must_use]
    pub fn per_replica(self, count: usize) -> Self {
        if self == Self::DEFAULT {
            return self;
        }
        Self { min: share(count, self.min), initial: share(count, self.initial), max: share(count, self.max) }
    }

    /// The maximum number of requests in flight.
    #[must_use]
    pub fn max(self) -> usize {
        self.max.get()
    }
}

fn share(count: usize, number: NonZeroUsize) -> NonZeroUsize {
    NonZeroUsize::new(number.get().div_ceil(count.max(1))).unwrap_or(NonZeroUsize::MIN)
}

impl fmt::Display for ConcurrencyBounds {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.initial == self.max { write!(f, "{}", self.max) } else { write!(f, "{}-{}", self.initial, self.max) }
    }
}

impl FromStr for ConcurrencyBounds {
    type Err = String;

    /// Parses `32` (from 32 down to 1 and back), `4-64` (from 4 up to 64, never below 4) or `auto`.
    fn from_str(text: &str) -> Result<Self, String> {
        if text == "auto" {
            return Ok(Self::DEFAULT);
        }
        let is_range = text.contains('-');
        let (initial, max) = text.split_once('-').unwrap_or((text, text));
        match (initial.trim().parse::<NonZeroUsize>(), max.trim().parse()) {
            (Ok(initial), Ok(max)) if initial <= max => {
                Ok(Self { min: if is_range { initial } else { NonZeroUsize::MIN }, initial, max })
            }
            _ => Err("a number of requests from 1 on, or a range like 4-64, expected".to_owned()),
        }
    }
}

/// Factor by which an overload narrows the window; chosen.
const DECREASE: f64 = 0.7;

/// Ratio of a round's mean reply time to the fastest round's from which the window stays: the server only queues
/// further requests. Chosen.
const QUEUEING_RATIO: f64 = 1.5;

/// Window of requests in flight at an endpoint: additive increase, multiplicative decrease (Chiu and Jain 1989,
/// Comput. Netw. ISDN Syst. 17:1).
///
/// Each round of successes widens it by one request while replies do not get slower. An overload (429, 503, 529, a
/// timeout) narrows it by 30 %, once for all requests in flight at that time.
#[derive(Debug)]
pub(crate) struct Window {
    bounds: ConcurrencyBounds,
    state: Mutex<WindowState>,
}

#[derive(Debug)]
struct WindowState {
    width: f64,
    /// Time of the last decrease; overloads of requests that were sent before it are ignored.
    decreased_at: Option<Instant>,
    /// Number of replies in the current round.
    replies: u32,
    /// Sum of the times of these replies.
    reply_time: Duration,
    /// Mean reply time of the fastest round; `None` before the first round ends.
    fastest: Option<Duration>,
    /// True if the last round was too slow to widen the window.
    is_queueing: bool,
}

impl Window {
    pub(crate) fn new(bounds: ConcurrencyBounds) -> Self {
        Self {
            bounds,
            state: Mutex::new(WindowState {
                width: bounds.initial.get() as f64,
                decreased_at: None,
                replies: 0,
                reply_time: Duration::ZERO,
                fastest: None,
                is_queueing: false,
            }),
        }
    }

    /// Maximum number of requests in flight at the moment.
    pub(crate) fn width(&self) -> usize {
        self.state().width as usize
    }

    /// Records a reply and its duration.
    pub(crate) fn record_success(&self, duration: Duration) {
        let mut state = self.state();
        state.replies += 1;
        state.reply_time += duration;
        if state.replies as f64 >= state.width {
            let mean = state.reply_time / state.replies;
            let fastest = state.fastest.map_or(mean, |fastest| fastest.min(mean));
            state.fastest = Some(fastest);
            state.is_queueing = mean > fastest.mul_f64(QUEUEING_RATIO);
            state.replies = 0;
            state.reply_time = Duration::ZERO;
        }
        if !state.is_queueing {
            let wider = state.width + 1.0 / state.width;
            state.width = wider.min(self.bounds.max.get() as f64);
        }
    }

    /// Records that the request sent at `sent` overloaded the server.
    pub(crate) fn record_overload(&self, sent: Instant) {
        let mut state = self.state();
        if state.decreased_at.is_none_or(|decreased| sent > decreased) {
            state.decreased_at = Some(Instant::now());
            state.width = (state.width * DECREASE).max(self.bounds.min.get() as f64);
        }
    }

    fn state(&self) -> MutexGuard<'_, WindowState> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounds_round_trip() {
        for text in ["1", "32", "4-64"] {
            assert_eq!(text.parse::<ConcurrencyBounds>().unwrap().to_string(), text);
        }
        assert_eq!(ConcurrencyBounds::DEFAULT.to_string(), "8-32");
        for wrong in ["", "0", "-4", "8-4", "4-", "a", "4-8-16"] {
            assert!(wrong.parse::<ConcurrencyBounds>().is_err(), "{wrong}");
        }
    }

    #[tokio::test(start_paused = true)]
    async fn the_window_grows_slowly_and_shrinks_fast() {
        let window = Window::new("8-32".parse().unwrap());
        for _ in 0..9 {
            window.record_success(Duration::from_millis(200));
        }
        assert_eq!(window.width(), 9);
        for _ in 0..2000 {
            window.record_success(Duration::from_millis(200));
        }
        assert_eq!(window.width(), 32);
        let sent = Instant::now();
        tokio::time::advance(Duration::from_millis(100)).await;
        for _ in 0..32 {
            window.record_overload(sent);
        }
        assert_eq!(window.width(), 22, "simultaneous overloads count once");
        for _ in 0..20 {
            tokio::time::advance(Duration::from_millis(100)).await;
            window.record_overload(Instant::now());
        }
        assert_eq!(window.width(), 8, "the lower bound");
    }

    #[test]
    fn the_window_stays_while_the_server_queues() {
        let window = Window::new("4-64".parse().unwrap());
        // The server answers one request at a time: a reply waits for all requests sent before it.
        for _ in 0..2000 {
            window.record_success(Duration::from_millis(100 * window.width() as u64));
        }
        assert!(window.width() <= 7, "{}", window.width());
    }
}
