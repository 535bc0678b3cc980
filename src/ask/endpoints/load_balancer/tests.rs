use super::*;
use crate::requests::AdaptableField;

fn new_balancer(count: usize) -> LoadBalancer {
    let all = LoadBalancer::new((0..count).map(|index| format!("r{index}")));
    assert_eq!(all.add_model("a".to_owned()), ONE);
    all
}

/// First model, which every test uses.
const ONE: ModelIndex = ModelIndex(0);

fn failed(kind: FailureKind, status: Option<u16>, reach: Reach) -> AskError {
    let mut failed = AskError::new(kind, "no".to_owned());
    failed.failure.status = status;
    AskError { reach, retry: Retry::AfterDelay, ..failed }
}

fn refused_connection() -> AskError {
    failed(FailureKind::Connection, None, Reach::Trial)
}

fn choose(balancer: &LoadBalancer, affinity: u64) -> usize {
    balancer.choose(ONE, affinity, &[], |_| true).unwrap()
}

#[tokio::test(start_paused = true)]
async fn requests_about_one_image_share_a_replica_within_the_load_limit() {
    let all = new_balancer(4);
    let favourite = choose(&all, 7);
    for _ in 0..AFFINITY_SLACK {
        assert_eq!(choose(&all, 7), favourite);
    }
    assert_ne!(choose(&all, 7), favourite, "four more than the others are too many");
    // For any images, the loads of two replicas differ by at most AFFINITY_SLACK + 1.
    let all = new_balancer(4);
    for image in 0..400_u64 {
        for _ in 0..3 {
            choose(&all, image);
        }
        let loads: Vec<usize> = (0..4).map(|index| all.in_flight(index)).collect();
        let (min, max) = (loads.iter().min().unwrap(), loads.iter().max().unwrap());
        assert!(max - min <= AFFINITY_SLACK + 1, "{loads:?}");
    }
    // Preferred replicas are distributed evenly.
    let mut counts = [0_u32; 4];
    for image in 0..4000_u64 {
        let all = new_balancer(4);
        counts[choose(&all, image)] += 1;
    }
    assert!(counts.iter().all(|count| (850..1150).contains(count)), "{counts:?}");
}

#[tokio::test(start_paused = true)]
async fn an_endless_stated_wait_is_no_panic() {
    let all = new_balancer(2);
    let limited = AskError { wait: Some(Duration::MAX), ..failed(FailureKind::RateLimit, Some(429), Reach::Endpoint) };
    assert_eq!(all.record_failure(ONE, 0, &limited), Failover::OtherReplica);
    for image in 0..100 {
        assert_eq!(choose(&all, image), 1);
    }
}

fn best(affinity: u64, replicas: &[usize]) -> usize {
    *replicas.iter().max_by_key(|index| rendezvous_weight(affinity, **index)).unwrap()
}

#[test]
fn removing_a_replica_moves_only_its_images() {
    for image in 0..1000 {
        let before = best(image, &[0, 1, 2, 3]);
        if before != 2 {
            assert_eq!(best(image, &[0, 1, 3]), before);
        }
    }
}

#[tokio::test(start_paused = true)]
async fn backoff_grows_with_each_failed_probe() {
    let all = new_balancer(2);
    let mut backoffs = Vec::new();
    for _ in 0..2 {
        assert_eq!(all.record_failure(ONE, 0, &refused_connection()), Failover::OtherReplica);
        assert!(all.accepts(ONE, 0));
    }
    assert_eq!(all.record_failure(ONE, 0, &refused_connection()), Failover::OtherReplica);
    assert!(!all.accepts(ONE, 0));
    for _ in 0..14 {
        let start = Instant::now();
        // Requests go to the other replica until the backoff ends; then a single request probes this one.
        loop {
            let index = all.choose(ONE, 0, &[1], |_| true).unwrap();
            if index == 0 {
                break;
            }
            all.release(index);
            tokio::time::advance(Duration::from_secs(1)).await;
        }
        backoffs.push(start.elapsed().as_secs());
        let second = all.choose(ONE, 0, &[], |_| true);
        assert_eq!(second, Some(1), "a single request probes it");
        all.release(1);
        all.record_failure(ONE, 0, &refused_connection());
        all.release(0);
    }
    assert_eq!(backoffs[..4], [5, 10, 15, 20]);
    assert_eq!(backoffs[13], 60);
    // A reply resets its health and its failure count.
    tokio::time::advance(Duration::from_mins(2)).await;
    assert_eq!(all.choose(ONE, 0, &[1], |_| true), Some(0));
    assert!(all.record_success(ONE, 0, None, Instant::now()));
    assert!(all.accepts(ONE, 0));
    all.record_failure(ONE, 0, &refused_connection());
    assert!(all.accepts(ONE, 0));
}

#[tokio::test(start_paused = true)]
async fn server_failures_use_a_retry() {
    let all = new_balancer(2);
    let server = failed(FailureKind::Server, Some(500), Reach::Trial);
    assert_eq!(all.record_failure(ONE, 0, &server), Failover::None);
    assert_eq!(all.record_failure(ONE, 0, &server), Failover::None);
    assert_eq!(all.record_failure(ONE, 0, &server), Failover::OtherReplica, "it backs off now");
    // A reply in between resets the count.
    all.record_failure(ONE, 1, &server);
    all.record_failure(ONE, 1, &server);
    assert!(all.record_success(ONE, 1, None, Instant::now()));
    all.record_failure(ONE, 1, &server);
    assert!(all.accepts(ONE, 1));
    // A reply to a request sent before the failure does not.
    let before = Instant::now();
    tokio::time::advance(Duration::from_secs(1)).await;
    all.record_failure(ONE, 1, &server);
    assert!(all.record_success(ONE, 1, None, before));
    tokio::time::advance(Duration::from_secs(1)).await;
    assert!(all.record_success(ONE, 1, None, Instant::now()));
    // Refusals and rate limits reveal nothing about the health of a replica.
    for (kind, status, retry) in [
        (FailureKind::Request, 400, Retry::Never),
        (FailureKind::RateLimit, 429, Retry::WhenAccepted),
        (FailureKind::Server, 503, Retry::WhenAccepted),
    ] {
        for _ in 0..9 {
            let failure = AskError { retry, ..failed(kind, Some(status), Reach::Trial) };
            assert_eq!(all.record_failure(ONE, 1, &failure), Failover::None);
        }
        assert!(all.accepts(ONE, 1), "{status}");
    }
}

#[tokio::test(start_paused = true)]
async fn replicas_without_the_model_are_excluded() {
    let all = new_balancer(2);
    let missing = failed(FailureKind::Request, Some(404), Reach::Endpoint);
    assert_eq!(all.record_failure(ONE, 0, &missing), Failover::OtherReplica);
    tokio::time::advance(Duration::from_hours(1)).await;
    for image in 0..20 {
        assert_eq!(choose(&all, image), 1);
    }
    assert_eq!(all.record_failure(ONE, 1, &missing), Failover::None);
    assert_eq!(all.choose(ONE, 0, &[], |_| true), None);
}

#[tokio::test(start_paused = true)]
async fn replicas_with_another_model_are_excluded() {
    let all = new_balancer(3);
    assert!(all.record_success(ONE, 0, Some("a"), Instant::now()));
    assert!(all.record_success(ONE, 1, None, Instant::now()), "the reply names no model");
    assert!(!all.record_success(ONE, 1, Some("b"), Instant::now()));
    assert!(!all.accepts(ONE, 1));
    assert!(all.record_success(ONE, 2, Some("a"), Instant::now()) && all.accepts(ONE, 2));
}

#[tokio::test(start_paused = true)]
async fn exclusion_concerns_a_single_model() {
    let all = new_balancer(2);
    let other = all.add_model("b".to_owned());
    for (model, name) in [(ONE, "a"), (other, "b"), (ONE, "a")] {
        for index in 0..2 {
            let is_expected = all.record_success(model, index, Some(name), Instant::now());
            assert!(is_expected && all.accepts(model, index), "{name} at {index}");
        }
    }
    let missing = failed(FailureKind::Request, Some(404), Reach::Endpoint);
    assert_eq!(all.record_failure(ONE, 0, &missing), Failover::OtherReplica);
    assert_eq!(all.record_failure(ONE, 1, &missing), Failover::None);
    assert_eq!(all.choose(ONE, 0, &[], |_| true), None);
    assert!(!all.has_other(ONE, &[]) && all.has_other(other, &[0]));
    assert!(all.choose(other, 0, &[], |_| true).is_some());
    // A replica without answers backs off for all models.
    for _ in 0..3 {
        all.record_failure(other, 0, &refused_connection());
    }
    assert!(!all.accepts(other, 0) && all.accepts(other, 1));
}

/// The request is sent again without the refused field.
#[tokio::test(start_paused = true)]
async fn refused_fields_exclude_no_replica() {
    let all = new_balancer(2);
    let field = AskError {
        refused_field: Some(AdaptableField::Temperature { least: None }),
        ..failed(FailureKind::Request, Some(403), Reach::Endpoint)
    };
    assert_eq!(all.record_failure(ONE, 0, &field), Failover::None);
    assert!(all.accepts(ONE, 0));
}

#[tokio::test(start_paused = true)]
async fn without_a_healthy_replica_all_are_tried() {
    let all = new_balancer(2);
    for index in [0, 0, 0, 1, 1] {
        all.record_failure(ONE, index, &refused_connection());
    }
    assert_eq!(all.record_failure(ONE, 1, &refused_connection()), Failover::None, "no other is left");
    assert!(!all.accepts(ONE, 0) && !all.accepts(ONE, 1));
    assert!(all.choose(ONE, 0, &[], |_| true).is_some());
}

#[test]
fn ready_replicas_are_preferred() {
    let all = new_balancer(3);
    for image in 0..20 {
        assert_eq!(all.choose(ONE, image, &[], |index| index == 1), Some(1));
        all.release(1);
    }
    drop(all.guard(1));
    assert_eq!(all.in_flight(1), 0);
}
