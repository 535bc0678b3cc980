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
    for _ in 0..45 {
        gate.pass().await;
    }
    for _ in 0..5 {
        gate.shut(Duration::from_secs(2));
    }
    // Forty were taken, then a pause of 2 s: one in 50 ms.
    let mut passed = Vec::new();
    for _ in 0..3 {
        gate.pass().await;
        passed.push(start.elapsed().as_millis());
    }
    assert_eq!(passed, [2000, 2050, 2100]);
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
    // 20 in a second, a quarter of a second's worth of them in advance.
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

#[tokio::test(start_paused = true)]
async fn absurd_figures_of_a_server_stop_nothing() {
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
    let left = Allowance::read(&headers, std::time::SystemTime::now());
    for _ in 0..10 {
        gate.ease(Some(u64::MAX), left, Duration::from_mins(2));
        gate.shut(Duration::MAX);
    }
    let passed = tokio::time::timeout(Duration::from_mins(1), gate.pass()).await;
    assert!(passed.is_ok(), "a wait that no clock can show is none");
}

/// A server that holds `store` requests, has `first` of them at first and lets `rate` of them in each second; how long
/// 300 requests of 32 at once take, and how often they are turned away.
async fn against(first: f64, store: f64, rate: f64, wait: Duration) -> (f64, u32) {
    let gate = std::sync::Arc::new(free());
    let level = std::sync::Arc::new(Mutex::new((first, Instant::now())));
    let start = Instant::now();
    let mut asking = tokio::task::JoinSet::new();
    let left = std::sync::Arc::new(std::sync::atomic::AtomicU32::new(300));
    let away = std::sync::Arc::new(std::sync::atomic::AtomicU32::new(0));
    for _ in 0..32 {
        let (gate, level, left, away) = (gate.clone(), level.clone(), left.clone(), away.clone());
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
                    tokio::time::sleep(Duration::from_millis(5)).await;
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
async fn requests_turned_away_at_random_leave_no_run_crawling() {
    for (every, wait) in [(20, 1.0), (3, 0.5)] {
        let (gate, wait) = (free(), Duration::from_secs_f64(wait));
        let start = Instant::now();
        for i in 0..600 {
            gate.pass().await;
            tokio::time::sleep(Duration::from_millis(20)).await;
            if i % every == every - 1 {
                gate.shut(wait);
            } else {
                ease(&gate);
            }
        }
        let least = wait * (600 / every) + Duration::from_secs(12);
        let took = start.elapsed();
        assert!(took < least * 2, "{took:?} where {least:?} were needed");
    }
}

#[tokio::test(start_paused = true)]
async fn an_unknown_rate_is_found_out() {
    for (first, store, rate, wait, longest) in [
        // Without a pause it were 14 s; each of two costs a second and more.
        (20.0, 20.0, 20.0, 2.0, 23.0),
        (8.0, 20.0, 20.0, 2.0, 26.0),
        (8.0, 20.0, 20.0, 0.5, 18.0),
        // 59 s.
        (5.0, 5.0, 5.0, 1.0, 110.0),
        // 240 s.
        (60.0, 60.0, 1.0, 6.0, 300.0),
        // 6 s.
        (50.0, 50.0, 50.0, 1.0, 8.0),
    ] {
        let wait = Duration::from_secs_f64(wait);
        let (took, away) = against(first, store, rate, wait).await;
        assert!(
            took < longest && away < 80,
            "{store} {rate}: {took} s, {away} turned away"
        );
    }
}
