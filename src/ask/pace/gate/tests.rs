mod simulated;

use std::num::NonZeroU32;
use std::sync::Arc;

use super::*;
use simulated::{Dice, Limit, StatedWait, simulate};

fn unlimited() -> Gate {
    Gate::new(Quota::default())
}

fn per_minute(requests: Option<u32>, tokens: Option<u32>) -> Quota {
    Quota { requests: requests.and_then(NonZeroU32::new), tokens: tokens.and_then(NonZeroU32::new) }
}

fn succeed(gate: &Gate, sent: Instant) {
    gate.record_success(sent, None, RateLimits::default(), Duration::MAX);
}

#[tokio::test(start_paused = true)]
async fn an_unlimited_gate_causes_no_delay() {
    let gate = unlimited();
    let start = Instant::now();
    for _ in 0..1000 {
        let sent = gate.pass().await;
        succeed(&gate, sent);
    }
    assert_eq!(start.elapsed(), Duration::ZERO);
}

#[tokio::test(start_paused = true)]
async fn waiting_requests_respect_a_second_pause() {
    let gate = Arc::new(unlimited());
    let start = Instant::now();
    gate.record_rate_limited(start, Some(Duration::from_secs(1)));
    let waiting = tokio::spawn({
        let gate = gate.clone();
        async move { gate.pass().await }
    });
    tokio::time::sleep(Duration::from_millis(900)).await;
    gate.record_rate_limited(start, Some(Duration::from_secs(4)));
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
    assert!(idle.elapsed() >= Duration::from_secs(1), "an idle minute does not allow a burst");
}

#[tokio::test(start_paused = true)]
async fn implausible_numbers_do_not_stop_the_run() {
    let gate = Gate::new(per_minute(None, Some(u32::MAX)));
    let mut headers = reqwest::header::HeaderMap::new();
    for (name, value) in
        [("x-ratelimit-remaining-requests", "0"), ("x-ratelimit-reset-requests", "18446744073709551615")]
    {
        headers.insert(name, value.parse().unwrap());
    }
    let limits = RateLimits::read(&headers, std::time::SystemTime::now());
    for _ in 0..10 {
        let sent = Instant::now();
        gate.record_success(sent, Some(u64::MAX), limits, Duration::from_mins(2));
        gate.record_rate_limited(sent, Some(Duration::MAX));
    }
    let passed = tokio::time::timeout(Duration::from_mins(1), gate.pass()).await;
    assert!(passed.is_ok(), "a wait beyond the clock's range is ignored");
}

fn bucket(rate: f64, store: f64) -> Limit {
    Limit::Bucket { rate, store }
}

#[tokio::test(start_paused = true)]
async fn unknown_limits_are_learned() {
    // Ideal time in seconds, maximum ratio to it, and maximum number of refusals.
    for (limit, wait, items, ideal, max_ratio, max_refused) in [
        (bucket(20.0, 20.0), StatedWait::Seconds(1.0), 300, 14.0, 1.15, 30),
        (bucket(20.0, 20.0), StatedWait::Exact, 300, 14.0, 1.2, 30),
        (bucket(20.0, 20.0), StatedWait::None, 300, 14.0, 1.15, 40),
        (bucket(20.0, 1.0), StatedWait::None, 300, 15.0, 1.4, 60),
        (bucket(20.0, 1.0), StatedWait::Seconds(1.0), 300, 15.0, 1.6, 40),
        (bucket(2.0, 2.0), StatedWait::Seconds(1.0), 100, 49.0, 1.3, 60),
        (bucket(100.0, 100.0), StatedWait::Seconds(1.0), 3000, 29.0, 1.25, 150),
        (Limit::Sliding(15), StatedWait::Exact, 40, 120.0, 1.4, 40),
        (Limit::Fixed(15), StatedWait::None, 40, 120.0, 1.5, 60),
        (Limit::Fixed(500), StatedWait::Exact, 1500, 120.0, 1.3, 60),
    ] {
        for seed in 0..5 {
            let result = simulate(limit, wait, items, Quota::default(), seed).await;
            let line = format!(
                "{limit:?}, {wait:?}: {:.1} s where {ideal} are needed, {} refused",
                result.seconds, result.refused
            );
            assert!(result.seconds <= max_ratio * ideal, "{line}");
            assert!(result.refused <= max_refused, "{line}");
        }
    }
}

#[tokio::test(start_paused = true)]
async fn random_refusals_cause_no_slowdown() {
    for seed in 0..5 {
        let [with, without] = [0.05, 0.0].map(|share| {
            let limit = Limit::Random(share);
            simulate(limit, StatedWait::None, 300, Quota::default(), seed)
        });
        let (with, without) = (with.await, without.await);
        assert_eq!(without.refused, 0);
        assert!(with.refused > 5, "{}", with.refused);
        let slowdown = with.seconds / without.seconds;
        assert!(slowdown < 1.6, "{slowdown}");
    }
}

#[tokio::test(start_paused = true)]
async fn no_minute_has_more_requests_than_the_quota() {
    for (limit, wait) in [
        (Limit::Random(0.0), StatedWait::None),
        (Limit::Random(0.05), StatedWait::None),
        (Limit::Random(0.5), StatedWait::None),
        (Limit::Broken(0.05), StatedWait::None),
        (Limit::Broken(0.5), StatedWait::None),
        (Limit::Sliding(15), StatedWait::Exact),
        (Limit::Sliding(15), StatedWait::None),
        (Limit::Sliding(20), StatedWait::Seconds(2.0)),
    ] {
        for max in [15, 30, 600] {
            for seed in 0..7 {
                let quota = per_minute(Some(max), None);
                let items = 4 * max as usize;
                let result = simulate(limit, wait, items.min(900), quota, seed).await;
                let found = result.max_per_minute();
                assert!(found <= max as usize, "{limit:?} {wait:?}: {found} of {max}");
                let is_unlimited = match limit {
                    Limit::Random(share) => share < 0.1,
                    Limit::Broken(_) => true,
                    _ => false,
                };
                if is_unlimited {
                    assert!(found as u32 >= max * 9 / 10, "{found} of {max}");
                }
            }
        }
    }
}

/// Tokens of the requests within a minute from `first`.
fn tokens_in_minute(used: &[(Instant, u64)], first: Instant) -> u64 {
    used.iter()
        .filter(|(sent, _)| *sent >= first)
        .filter(|(sent, _)| *sent - first < Duration::from_mins(1))
        .map(|(_, tokens)| tokens)
        .sum()
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
                // The first replies are among the largest; later ones are not larger.
                let tokens = 500 + (1000.0 * dice.throw()) as u64;
                tokio::time::sleep(Duration::from_millis(200)).await;
                gate.record_success(sent, Some(tokens), RateLimits::default(), Duration::MAX);
                used.lock().unwrap().push((sent, tokens));
            }
        });
    }
    let start = Instant::now();
    while asking.join_next().await.is_some() {}
    let used = used.lock().unwrap().clone();
    let max = used.iter().map(|(sent, _)| tokens_in_minute(&used, *sent)).max().unwrap();
    assert!((50_000..=60_000).contains(&max), "{max}");
    // 200 requests of 1000 tokens take 3.3 minutes; the quota of the first minute may be used at once.
    let minutes = start.elapsed().as_secs_f64() / 60.0;
    assert!((3.0..4.3).contains(&minutes), "{minutes}");
}

#[tokio::test(start_paused = true)]
async fn a_request_larger_than_the_quota_of_tokens_is_sent_alone() {
    let gate = Gate::new(per_minute(None, Some(1000)));
    let start = Instant::now();
    for _ in 0..2 {
        let sent = gate.pass().await;
        gate.record_success(sent, Some(5000), RateLimits::default(), Duration::MAX);
    }
    assert!(start.elapsed() >= Duration::from_mins(1));
}
