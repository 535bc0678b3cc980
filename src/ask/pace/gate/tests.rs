use super::*;

fn free() -> Gate {
    Gate::new(Quota::default())
}

fn succeed(gate: &Gate) {
    gate.succeeded(None, Allowance::default(), Duration::MAX);
}

#[tokio::test(start_paused = true)]
async fn an_open_gate_delays_nobody() {
    let gate = free();
    let start = Instant::now();
    for _ in 0..1000 {
        gate.pass().await;
        succeed(&gate);
    }
    assert_eq!(start.elapsed(), Duration::ZERO);
}

#[tokio::test(start_paused = true)]
async fn after_a_pause_requests_pass_at_the_rate_that_was_accepted() {
    let gate = free();
    let start = Instant::now();
    for _ in 0..45 {
        gate.pass().await;
    }
    for _ in 0..5 {
        gate.rate_limited(Duration::from_secs(2));
    }
    // 40 were accepted before a pause of 2 s: one in 50 ms.
    let mut passed = Vec::new();
    for _ in 0..3 {
        gate.pass().await;
        passed.push(start.elapsed().as_millis());
    }
    assert_eq!(passed, [2000, 2050, 2100]);
    for _ in 0..300 {
        succeed(&gate);
    }
    gate.pass().await;
    let eased = start.elapsed();
    gate.pass().await;
    assert_eq!(start.elapsed(), eased);
}

#[tokio::test(start_paused = true)]
async fn waiting_requests_wait_for_a_second_pause_too() {
    let gate = std::sync::Arc::new(free());
    let start = Instant::now();
    gate.rate_limited(Duration::from_secs(1));
    let waiting = tokio::spawn({
        let gate = gate.clone();
        async move { gate.pass().await }
    });
    tokio::time::sleep(Duration::from_millis(900)).await;
    gate.rate_limited(Duration::from_secs(4));
    waiting.await.unwrap();
    assert!(start.elapsed() >= Duration::from_millis(4900));
    // A request that is dropped while it waits changes nothing.
    gate.rate_limited(Duration::from_secs(1));
    let dropped = tokio::time::timeout(Duration::from_millis(10), gate.pass()).await;
    assert!(dropped.is_err());
    gate.pass().await;
}

#[tokio::test(start_paused = true)]
async fn a_quota_applies_from_the_first_request_on() {
    let quota = Quota {
        requests: NonZeroU32::new(1200),
        tokens: None,
    };
    let gate = Gate::new(quota);
    let start = Instant::now();
    for _ in 0..300 {
        gate.pass().await;
    }
    // 20 a second, of which those of a quarter of a second may pass in advance.
    let took = start.elapsed();
    assert!(took >= Duration::from_millis(14_650), "{took:?}");
    assert!(took <= Duration::from_millis(14_750), "{took:?}");
    tokio::time::sleep(Duration::from_mins(1)).await;
    let idle = Instant::now();
    for _ in 0..26 {
        gate.pass().await;
    }
    assert!(
        idle.elapsed() >= Duration::from_secs(1),
        "an idle minute does not allow a burst"
    );
}

#[tokio::test(start_paused = true)]
async fn the_token_quota_uses_the_tokens_of_the_replies() {
    let quota = Quota {
        requests: None,
        tokens: NonZeroU32::new(60_000),
    };
    let gate = Gate::new(quota);
    for _ in 0..200 {
        gate.pass().await;
        gate.succeeded(Some(2000), Allowance::default(), Duration::MAX);
    }
    let start = Instant::now();
    for _ in 0..10 {
        gate.pass().await;
    }
    let took = start.elapsed().as_secs_f64();
    assert!((19.0..21.0).contains(&took), "{took}");
}

#[tokio::test(start_paused = true)]
async fn absurd_numbers_from_a_server_do_not_stop_the_run() {
    let quota = Quota {
        requests: None,
        tokens: NonZeroU32::new(u32::MAX),
    };
    let gate = Gate::new(quota);
    let mut headers = reqwest::header::HeaderMap::new();
    for (name, value) in [
        ("x-ratelimit-remaining-requests", "0"),
        ("x-ratelimit-reset-requests", "18446744073709551615"),
    ] {
        headers.insert(name, value.parse().unwrap());
    }
    let allowance = Allowance::read(&headers, std::time::SystemTime::now());
    for _ in 0..10 {
        gate.succeeded(Some(u64::MAX), allowance, Duration::from_mins(2));
        gate.rate_limited(Duration::MAX);
    }
    let passed = tokio::time::timeout(Duration::from_mins(1), gate.pass()).await;
    assert!(passed.is_ok(), "a wait beyond the clock's range is ignored");
}

/// The seconds that 300 requests take, 32 at once, and the number of rejections. The server has a token bucket of `burst`
/// requests with `first` in it at the start, and refills `rate` of them per second.
async fn run_against_bucket(first: f64, burst: f64, rate: f64, wait: Duration) -> (f64, u32) {
    let gate = std::sync::Arc::new(free());
    let level = std::sync::Arc::new(Mutex::new((first, Instant::now())));
    let start = Instant::now();
    let mut asking = tokio::task::JoinSet::new();
    let remaining = std::sync::Arc::new(std::sync::atomic::AtomicU32::new(300));
    let rejections = std::sync::Arc::new(std::sync::atomic::AtomicU32::new(0));
    for _ in 0..32 {
        let (gate, level) = (gate.clone(), level.clone());
        let (remaining, rejections) = (remaining.clone(), rejections.clone());
        asking.spawn(async move {
            use std::sync::atomic::Ordering::Relaxed;
            while remaining
                .fetch_update(Relaxed, Relaxed, |n| n.checked_sub(1))
                .is_ok()
            {
                loop {
                    gate.pass().await;
                    let accepted = {
                        let mut level = level.lock().unwrap();
                        let now = Instant::now();
                        let filled = level.0 + (now - level.1).as_secs_f64() * rate;
                        *level = (filled.min(burst), now);
                        level.0 >= 1.0 && {
                            level.0 -= 1.0;
                            true
                        }
                    };
                    if accepted {
                        tokio::time::sleep(Duration::from_millis(100)).await;
                        succeed(&gate);
                        break;
                    }
                    rejections.fetch_add(1, Relaxed);
                    tokio::time::sleep(Duration::from_millis(5)).await;
                    gate.rate_limited(wait);
                }
            }
        });
    }
    while asking.join_next().await.is_some() {}
    (
        start.elapsed().as_secs_f64(),
        rejections.load(std::sync::atomic::Ordering::Relaxed),
    )
}

#[tokio::test(start_paused = true)]
async fn random_rejections_do_not_slow_a_run_down() {
    for (every, wait) in [(20, 1.0), (3, 0.5)] {
        let (gate, wait) = (free(), Duration::from_secs_f64(wait));
        let start = Instant::now();
        for i in 0..600 {
            gate.pass().await;
            tokio::time::sleep(Duration::from_millis(20)).await;
            if i % every == every - 1 {
                gate.rate_limited(wait);
            } else {
                succeed(&gate);
            }
        }
        let least = wait * (600 / every) + Duration::from_secs(12);
        let took = start.elapsed();
        assert!(took < least * 2, "{took:?}, {least:?} were needed");
    }
}

#[tokio::test(start_paused = true)]
async fn an_unknown_rate_is_learned() {
    for (first, burst, rate, wait, longest) in [
        // Without a pause it would be 14 s; each of two pauses costs more than a second.
        (20.0, 20.0, 20.0, 2.0, 23.0),
        (8.0, 20.0, 20.0, 2.0, 26.0),
        (8.0, 20.0, 20.0, 0.5, 18.0),
        // Without a pause, 59 s.
        (5.0, 5.0, 5.0, 1.0, 110.0),
        // Without a pause, 240 s.
        (60.0, 60.0, 1.0, 6.0, 300.0),
        // Without a pause, 6 s.
        (50.0, 50.0, 50.0, 1.0, 8.0),
    ] {
        let wait = Duration::from_secs_f64(wait);
        let (took, rejections) = run_against_bucket(first, burst, rate, wait).await;
        assert!(
            took < longest && rejections < 80,
            "{burst} {rate}: {took} s, {rejections} rejections"
        );
    }
}
