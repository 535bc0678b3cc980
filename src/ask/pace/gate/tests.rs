use std::num::NonZeroU32;
use std::sync::Arc;
use std::sync::atomic::AtomicUsize;
use std::sync::atomic::Ordering::Relaxed;

use super::*;

fn free() -> Gate {
    Gate::new(Quota::default())
}

fn per_minute(requests: Option<u32>, tokens: Option<u32>) -> Quota {
    let number = |number: Option<u32>| number.and_then(NonZeroU32::new);
    Quota {
        requests: number(requests),
        tokens: number(tokens),
    }
}

fn succeed(gate: &Gate, sent: Instant) {
    gate.succeeded(sent, None, Allowance::default(), Duration::MAX);
}

#[tokio::test(start_paused = true)]
async fn an_open_gate_delays_nobody() {
    let gate = free();
    let start = Instant::now();
    for _ in 0..1000 {
        let sent = gate.pass().await;
        succeed(&gate, sent);
    }
    assert_eq!(start.elapsed(), Duration::ZERO);
}

#[tokio::test(start_paused = true)]
async fn waiting_requests_wait_for_a_second_pause_too() {
    let gate = Arc::new(free());
    let start = Instant::now();
    let refused = |seconds| gate.rate_limited(start, Some(Duration::from_secs(seconds)));
    refused(1);
    let waiting = tokio::spawn({
        let gate = gate.clone();
        async move { gate.pass().await }
    });
    tokio::time::sleep(Duration::from_millis(900)).await;
    refused(4);
    waiting.await.unwrap();
    assert!(start.elapsed() >= Duration::from_millis(4900));
    // A request that is dropped while it waits changes nothing.
    gate.pause(Duration::from_secs(1));
    let dropped = tokio::time::timeout(Duration::from_millis(10), gate.pass()).await;
    assert!(dropped.is_err());
    gate.pass().await;
    assert!(gate.refused_for() >= Duration::from_secs(5));
    succeed(&gate, start);
    assert_eq!(gate.refused_for(), Duration::ZERO);
}

#[tokio::test(start_paused = true)]
async fn a_quota_applies_from_the_first_request_on() {
    let gate = Gate::new(per_minute(Some(1200), None));
    let start = Instant::now();
    for _ in 0..301 {
        gate.pass().await;
    }
    let took = start.elapsed();
    assert!((15_000..15_400).contains(&took.as_millis()), "{took:?}");
    tokio::time::sleep(Duration::from_mins(1)).await;
    let idle = Instant::now();
    for _ in 0..21 {
        gate.pass().await;
    }
    assert!(
        idle.elapsed() >= Duration::from_secs(1),
        "an idle minute does not allow a burst"
    );
}

#[tokio::test(start_paused = true)]
async fn absurd_numbers_from_a_server_do_not_stop_the_run() {
    let gate = Gate::new(per_minute(None, Some(u32::MAX)));
    let mut headers = reqwest::header::HeaderMap::new();
    for (name, value) in [
        ("x-ratelimit-remaining-requests", "0"),
        ("x-ratelimit-reset-requests", "18446744073709551615"),
    ] {
        headers.insert(name, value.parse().unwrap());
    }
    let allowance = Allowance::read(&headers, std::time::SystemTime::now());
    for _ in 0..10 {
        let sent = Instant::now();
        gate.succeeded(sent, Some(u64::MAX), allowance, Duration::from_mins(2));
        gate.rate_limited(sent, Some(Duration::MAX));
    }
    let passed = tokio::time::timeout(Duration::from_mins(1), gate.pass()).await;
    assert!(passed.is_ok(), "a wait beyond the clock's range is ignored");
}

/// Random numbers of a seed, in [0, 1): Knuth's generator (MMIX).
struct Dice(u64);

impl Dice {
    fn throw(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// A server that limits requests.
#[derive(Debug, Clone, Copy)]
enum Limit {
    /// A token bucket of `store` requests that refills `rate` of them a second.
    Bucket { rate: f64, store: f64 },
    /// So many in any 60 seconds.
    Sliding(usize),
    /// So many in each minute of the clock.
    Fixed(usize),
    /// This share is refused at random.
    Random(f64),
}

/// The wait that a server tells.
#[derive(Debug, Clone, Copy)]
enum Told {
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
            Limit::Random(share) => {
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

/// What came of asking a server.
struct Asked {
    seconds: f64,
    refused: usize,
    sent: Vec<Instant>,
}

impl Asked {
    /// The most requests in any 60 seconds.
    fn most_in_a_minute(&self) -> usize {
        let within = |first: &Instant| {
            let sent = self.sent.iter().filter(|sent| *sent >= first);
            sent.filter(|sent| **sent - *first < Duration::from_mins(1))
                .count()
        };
        self.sent.iter().map(within).max().unwrap_or(0)
    }
}

/// Asks a server for `items` replies, 16 at once, with replies that take 50 to 200 ms; refused requests come again.
async fn ask(limit: Limit, told: Told, items: usize, quota: Quota, seed: u64) -> Asked {
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
                    gate.rate_limited(sent, wait);
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

#[tokio::test(start_paused = true)]
async fn an_unknown_limit_is_found() {
    let bucket = |rate, store| Limit::Bucket { rate, store };
    // The ideal in seconds, the longest, and the most that are turned away.
    for (limit, told, items, ideal, longest, refused) in [
        (bucket(20.0, 20.0), Told::Seconds(1.0), 300, 14.0, 1.15, 30),
        (bucket(20.0, 20.0), Told::Exact, 300, 14.0, 1.2, 30),
        (bucket(20.0, 20.0), Told::Nothing, 300, 14.0, 1.15, 40),
        (bucket(20.0, 1.0), Told::Nothing, 300, 15.0, 1.4, 60),
        (bucket(20.0, 1.0), Told::Seconds(1.0), 300, 15.0, 1.6, 40),
        (bucket(2.0, 2.0), Told::Seconds(1.0), 100, 49.0, 1.3, 60),
        (
            bucket(100.0, 100.0),
            Told::Seconds(1.0),
            3000,
            29.0,
            1.25,
            150,
        ),
        (Limit::Sliding(15), Told::Exact, 40, 120.0, 1.4, 40),
        (Limit::Fixed(15), Told::Nothing, 40, 120.0, 1.5, 60),
        (Limit::Fixed(500), Told::Exact, 1500, 120.0, 1.3, 60),
    ] {
        for seed in 0..5 {
            let asked = ask(limit, told, items, Quota::default(), seed).await;
            let line = format!(
                "{limit:?}, {told:?}: {:.1} s where {ideal} are needed, {} turned away",
                asked.seconds, asked.refused
            );
            assert!(asked.seconds <= longest * ideal, "{line}");
            assert!(asked.refused <= refused, "{line}");
        }
    }
}

#[tokio::test(start_paused = true)]
async fn random_refusals_do_not_slow_a_run_down() {
    for seed in 0..5 {
        let asked = ask(
            Limit::Random(0.05),
            Told::Nothing,
            300,
            Quota::default(),
            seed,
        )
        .await;
        // 300 replies of 125 ms on average, 16 at once: 2.3 s.
        assert!(asked.seconds < 5.0, "{} s", asked.seconds);
    }
}

#[tokio::test(start_paused = true)]
async fn no_minute_has_more_requests_than_the_quota() {
    for (limit, told) in [
        (Limit::Random(0.0), Told::Nothing),
        (Limit::Random(0.05), Told::Nothing),
        (Limit::Random(0.5), Told::Nothing),
        (Limit::Sliding(15), Told::Exact),
        (Limit::Sliding(20), Told::Seconds(2.0)),
    ] {
        for most in [15, 30, 600] {
            for seed in 0..7 {
                let quota = per_minute(Some(most), None);
                let items = 4 * most as usize;
                let asked = ask(limit, told, items.min(900), quota, seed).await;
                let found = asked.most_in_a_minute();
                assert!(
                    found <= most as usize,
                    "{limit:?} {told:?}: {found} of {most}"
                );
                if matches!(limit, Limit::Random(share) if share < 0.1) {
                    assert!(found as u32 >= most * 9 / 10, "{found} of {most}");
                }
            }
        }
    }
}

#[tokio::test(start_paused = true)]
async fn no_minute_has_more_tokens_than_the_quota() {
    let gate = Arc::new(Gate::new(per_minute(None, Some(60_000))));
    let used = Arc::new(Mutex::new(Vec::new()));
    let mut asking = tokio::task::JoinSet::new();
    for worker in 0..8 {
        let (gate, used) = (gate.clone(), used.clone());
        let mut dice = Dice(worker);
        asking.spawn(async move {
            for _ in 0..25 {
                let sent = gate.pass().await;
                // The first replies are among the largest; later ones are no larger.
                let tokens = 500 + (1000.0 * dice.throw()) as u64;
                tokio::time::sleep(Duration::from_millis(200)).await;
                gate.succeeded(sent, Some(tokens), Allowance::default(), Duration::MAX);
                used.lock().unwrap().push((sent, tokens));
            }
        });
    }
    let start = Instant::now();
    while asking.join_next().await.is_some() {}
    let used = used.lock().unwrap().clone();
    let within = |first: Instant| -> u64 {
        let later = used.iter().filter(|(sent, _)| *sent >= first);
        let minute = later.filter(|(sent, _)| *sent - first < Duration::from_mins(1));
        minute.map(|(_, tokens)| tokens).sum()
    };
    let most = used.iter().map(|(sent, _)| within(*sent)).max().unwrap();
    assert!((50_000..=60_000).contains(&most), "{most}");
    // 200 requests of 1000 tokens are 3.3 minutes; the first minute's worth may pass at once.
    let minutes = start.elapsed().as_secs_f64() / 60.0;
    assert!((3.0..4.3).contains(&minutes), "{minutes}");
}

#[tokio::test(start_paused = true)]
async fn a_request_larger_than_the_quota_of_tokens_is_sent_alone() {
    let gate = Gate::new(per_minute(None, Some(1000)));
    let start = Instant::now();
    for _ in 0..2 {
        let sent = gate.pass().await;
        gate.succeeded(sent, Some(5000), Allowance::default(), Duration::MAX);
    }
    assert!(start.elapsed() >= Duration::from_mins(1));
}
