//! Servers with limits, and clients that ask them through a gate, on a clock that does not wait.

use std::sync::Arc;
use std::sync::atomic::AtomicUsize;
use std::sync::atomic::Ordering::Relaxed;

use super::succeed;
use crate::ask::pace::gate::*;

/// Random numbers of a seed, in [0, 1): Knuth's generator (MMIX).
pub(super) struct Dice(pub(super) u64);

impl Dice {
    pub(super) fn throw(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// A server that limits requests.
#[derive(Debug, Clone, Copy)]
pub(super) enum Limit {
    /// A token bucket of `store` requests that refills `rate` of them a second.
    Bucket { rate: f64, store: f64 },
    /// So many in any 60 seconds.
    Sliding(usize),
    /// So many in each minute of the clock.
    Fixed(usize),
    /// This share is refused at random.
    Random(f64),
    /// This share fails at random, which reveals nothing about a rate: status 500, or a reply that is cut.
    Broken(f64),
}

/// The wait that a server tells.
#[derive(Debug, Clone, Copy)]
pub(super) enum Told {
    Nothing,
    Exact,
    Seconds(f64),
}

struct MockServer {
    limit: Limit,
    told: Told,
    start: Instant,
    level: f64,
    last: Instant,
    taken: Vec<Instant>,
    dice: Dice,
}

impl MockServer {
    fn new(limit: Limit, told: Told, seed: u64) -> Self {
        let now = Instant::now();
        let level = match limit {
            Limit::Bucket { store, .. } => store,
            _ => 0.0,
        };
        Self {
            limit,
            told,
            start: now,
            level,
            last: now,
            taken: Vec::new(),
            dice: Dice(seed),
        }
    }

    /// `Ok` if the request is taken, else the wait that is told.
    fn answer(&mut self, now: Instant) -> Result<(), Option<Duration>> {
        let minute = Duration::from_mins(1);
        let exact = match self.limit {
            Limit::Random(share) | Limit::Broken(share) => {
                return if self.dice.throw() < share {
                    Err(None)
                } else {
                    Ok(())
                };
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
            Limit::Sliding(most) => {
                self.taken.retain(|taken| now - *taken < minute);
                if self.taken.len() < most {
                    self.taken.push(now);
                    return Ok(());
                }
                self.taken[0] + minute - now
            }
            Limit::Fixed(most) => {
                let of = |at: Instant| (at - self.start).as_secs() / 60;
                let here = of(now);
                self.taken.retain(|taken| of(*taken) == here);
                if self.taken.len() < most {
                    self.taken.push(now);
                    return Ok(());
                }
                self.start + minute * (here as u32 + 1) - now
            }
        };
        Err(match self.told {
            Told::Nothing => None,
            Told::Exact => Some(exact),
            Told::Seconds(seconds) => Some(Duration::from_secs_f64(seconds)),
        })
    }
}

/// The outcome of asking a server.
pub(super) struct Asked {
    pub(super) seconds: f64,
    pub(super) refused: usize,
    sent: Vec<Instant>,
}

impl Asked {
    /// The most requests in any 60 seconds.
    pub(super) fn most_in_a_minute(&self) -> usize {
        let within = |first: &Instant| {
            let sent = self.sent.iter().filter(|sent| *sent >= first);
            sent.filter(|sent| **sent - *first < Duration::from_mins(1))
                .count()
        };
        self.sent.iter().map(within).max().unwrap_or(0)
    }
}

/// Asks a server for `items` replies, 16 at once, with replies that take 50 to 200 ms; refused requests come again.
pub(super) async fn ask(limit: Limit, told: Told, items: usize, quota: Quota, seed: u64) -> Asked {
    let gate = Arc::new(Gate::new(quota));
    let server = Arc::new(Mutex::new(MockServer::new(limit, told, seed)));
    let (left, refused) = (
        Arc::new(AtomicUsize::new(items)),
        Arc::new(AtomicUsize::new(0)),
    );
    let sent_at = Arc::new(Mutex::new(Vec::new()));
    let start = Instant::now();
    let mut asking = tokio::task::JoinSet::new();
    for worker in 0..16 {
        let (gate, server, left) = (gate.clone(), server.clone(), left.clone());
        let (refused, sent_at) = (refused.clone(), sent_at.clone());
        let mut dice = Dice(seed * 100 + worker);
        asking.spawn(async move {
            while left
                .fetch_update(Relaxed, Relaxed, |n| n.checked_sub(1))
                .is_ok()
            {
                let own = Duration::from_millis(250);
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
                        tokio::time::sleep(own).await;
                    }
                }
            }
        });
    }
    while asking.join_next().await.is_some() {}
    let sent = sent_at.lock().unwrap().clone();
    Asked {
        seconds: start.elapsed().as_secs_f64(),
        refused: refused.load(Relaxed),
        sent,
    }
}
