//! Simulation of rate-limited servers and of clients behind a gate, on a paused clock.

use std::sync::Arc;
use std::sync::atomic::AtomicUsize;
use std::sync::atomic::Ordering::Relaxed;

use super::succeed;
use crate::pace::gate::*;

/// Random numbers in [0, 1): Knuth's generator (MMIX).
pub(super) struct Dice(pub(super) u64);

impl Dice {
    pub(super) fn throw(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// Limit of a server.
#[derive(Debug, Clone, Copy)]
pub(super) enum Limit {
    /// Token bucket of `store` requests, refilled with `rate` requests per second.
    Bucket { rate: f64, store: f64 },
    /// This number of requests in any 60 seconds.
    Sliding(usize),
    /// This number of requests in each minute of the clock.
    Fixed(usize),
    /// Random refusal of this share of the requests.
    Random(f64),
    /// Random failure of this share of the requests that reveals nothing about a rate: status 500, or a truncated
    /// reply.
    Broken(f64),
}

/// Wait that a server states in a refusal.
#[derive(Debug, Clone, Copy)]
pub(super) enum StatedWait {
    None,
    Exact,
    Seconds(f64),
}

struct MockServer {
    limit: Limit,
    wait: StatedWait,
    start: Instant,
    /// Number of requests in the bucket.
    level: f64,
    /// Time of the last refill of the bucket.
    last: Instant,
    /// Times of the accepted requests of the last minute.
    accepted: Vec<Instant>,
    dice: Dice,
}

impl MockServer {
    fn new(limit: Limit, wait: StatedWait, seed: u64) -> Self {
        let now = Instant::now();
        let level = match limit {
            Limit::Bucket { store, .. } => store,
            _ => 0.0,
        };
        Self { limit, wait, start: now, level, last: now, accepted: Vec::new(), dice: Dice(seed) }
    }

    /// Accepts a request, or returns the stated wait as the error.
    fn answer(&mut self, now: Instant) -> Result<(), Option<Duration>> {
        let minute = Duration::from_mins(1);
        let exact = match self.limit {
            Limit::Random(share) | Limit::Broken(share) => {
                return if self.dice.throw() < share { Err(None) } else { Ok(()) };
            }
            Limit::Bucket { rate, store } => {
                let filled = self.level + (now - self.last).as_secs_f64() * rate;
                (self.level, self.last) = (filled.min(store), now);
                if self.level >= 1.0 {
                    self.level -= 1.0;
                    return Ok(());
                }
                Duration::from_secs_f64((1.0 - self.level) / rate)
            }
            Limit::Sliding(max) => {
                self.accepted.retain(|accepted| now - *accepted < minute);
                if self.accepted.len() < max {
                    self.accepted.push(now);
                    return Ok(());
                }
                self.accepted[0] + minute - now
            }
            Limit::Fixed(max) => {
                let current = minute_of(self.start, now);
                self.accepted.retain(|accepted| minute_of(self.start, *accepted) == current);
                if self.accepted.len() < max {
                    self.accepted.push(now);
                    return Ok(());
                }
                self.start + minute * (current as u32 + 1) - now
            }
        };
        Err(match self.wait {
            StatedWait::None => None,
            StatedWait::Exact => Some(exact),
            StatedWait::Seconds(seconds) => Some(Duration::from_secs_f64(seconds)),
        })
    }
}

/// Result of a simulation.
pub(super) struct Simulation {
    pub(super) seconds: f64,
    pub(super) refused: usize,
    sent: Vec<Instant>,
}

impl Simulation {
    /// Maximum number of requests in any 60 seconds.
    pub(super) fn max_per_minute(&self) -> usize {
        self.sent
            .iter()
            .map(|first| {
                self.sent.iter().filter(|sent| *sent >= first && **sent - *first < Duration::from_mins(1)).count()
            })
            .max()
            .unwrap_or(0)
    }
}

/// Sends `items` requests to a server, 16 at once, and repeats refused ones. Replies take 50 to 200 ms.
pub(super) async fn simulate(limit: Limit, wait: StatedWait, items: usize, quota: Quota, seed: u64) -> Simulation {
    let gate = Arc::new(Gate::new(quota));
    let server = Arc::new(Mutex::new(MockServer::new(limit, wait, seed)));
    let (left, refused) = (Arc::new(AtomicUsize::new(items)), Arc::new(AtomicUsize::new(0)));
    let sent_at = Arc::new(Mutex::new(Vec::new()));
    let start = Instant::now();
    let mut asking = tokio::task::JoinSet::new();
    for worker in 0..16 {
        let (gate, server, left) = (gate.clone(), server.clone(), left.clone());
        let (refused, sent_at) = (refused.clone(), sent_at.clone());
        let mut dice = Dice(seed * 100 + worker);
        asking.spawn(async move {
            while left.fetch_update(Relaxed, Relaxed, |n| n.checked_sub(1)).is_ok() {
                let default_wait = Duration::from_millis(250);
                loop {
                    let sent = gate.pass().await;
                    sent_at.lock().unwrap().push(sent);
                    let answer = server.lock().unwrap().answer(sent);
                    let Err(wait) = answer else {
                        let took = Duration::from_secs_f64(0.05 + 0.15 * dice.throw());
                        tokio::time::sleep(took).await;
                        succeed(&gate, sent);
                        break;
                    };
                    refused.fetch_add(1, Relaxed);
                    tokio::time::sleep(Duration::from_millis(30)).await;
                    if !matches!(limit, Limit::Broken(_)) {
                        gate.record_rate_limited(sent, wait);
                    }
                    if wait.is_none() {
                        tokio::time::sleep(default_wait).await;
                    }
                }
            }
        });
    }
    while asking.join_next().await.is_some() {}
    let sent = sent_at.lock().unwrap().clone();
    Simulation { seconds: start.elapsed().as_secs_f64(), refused: refused.load(Relaxed), sent }
}

fn minute_of(start: Instant, at: Instant) -> u64 {
    (at - start).as_secs() / 60
}
