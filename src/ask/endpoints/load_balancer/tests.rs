use super::*;
use crate::ask::requests::AdaptableField;

fn balancer(count: usize) -> LoadBalancer {
    let all = LoadBalancer::new((0..count).map(|index| format!("r{index}")));
    assert_eq!(all.add_model("a".to_owned()), ONE);
    all
}

/// The first model at the replicas, which every test has.
const ONE: ModelIndex = ModelIndex(0);

fn failed(kind: FailureKind, status: Option<u16>, reach: Reach) -> AskError {
    let mut failed = AskError::new(kind, "no".to_owned());
    failed.failure.status = status;
    AskError {
        reach,
        retry: Retry::AfterDelay,
        ..failed
    }
}

fn refused_connection() -> AskError {
    failed(FailureKind::Connection, None, Reach::Trial)
}

fn choose(balancer: &LoadBalancer, affinity: u64) -> usize {
    balancer.choose(ONE, affinity, &[], |_| true).unwrap()
}

/// The requests of one image stay together while the load allows it, and the load stays even.
#[tokio::test(start_paused = true)]
async fn requests_of_one_image_meet_one_replica_while_the_load_is_even() {
    let all = balancer(4);
    let favourite = choose(&all, 7);
    for _ in 0..AFFINITY_SLACK {
        assert_eq!(choose(&all, 7), favourite);
    }
    assert_ne!(
        choose(&all, 7),
        favourite,
        "four more than the others are too many"
    );
    // Whatever the images are, no replica has more than AFFINITY_SLACK + 1 more than another.
    let all = balancer(4);
    for image in 0..400_u64 {
        for _ in 0..3 {
            choose(&all, image);
        }
        let loads: Vec<usize> = (0..4).map(|index| all.in_flight(index)).collect();
        let (least, most) = (loads.iter().min().unwrap(), loads.iter().max().unwrap());
        assert!(most - least <= AFFINITY_SLACK + 1, "{loads:?}");
    }
    // The favourites are spread evenly.
    let mut counts = [0_u32; 4];
    for image in 0..4000_u64 {
        let all = balancer(4);
        counts[choose(&all, image)] += 1;
    }
    assert!(
        counts.iter().all(|count| (850..1150).contains(count)),
        "{counts:?}"
    );
}

/// Without one of the replicas only its own images move.
#[test]
fn a_replica_that_goes_moves_only_its_own_images() {
    let best = |affinity, replicas: &[usize]| {
        *replicas
            .iter()
            .max_by_key(|index| rendezvous_weight(affinity, **index))
            .unwrap()
    };
    for image in 0..1000 {
        let before = best(image, &[0, 1, 2, 3]);
        if before != 2 {
            assert_eq!(best(image, &[0, 1, 3]), before);
        }
    }
}

#[tokio::test(start_paused = true)]
async fn a_replica_that_fails_three_times_is_out_for_longer_each_time() {
    let all = balancer(2);
    let mut out = Vec::new();
    for _ in 0..2 {
        assert_eq!(
            all.record_failure(ONE, 0, &refused_connection()),
            Failover::OtherReplica
        );
        assert!(all.accepts(ONE, 0));
    }
    assert_eq!(
        all.record_failure(ONE, 0, &refused_connection()),
        Failover::OtherReplica
    );
    assert!(!all.accepts(ONE, 0));
    for _ in 0..14 {
        let start = Instant::now();
        // Until it may be tried, everything goes to the other; then one request alone tries it.
        loop {
            let index = all.choose(ONE, 0, &[1], |_| true).unwrap();
            if index == 0 {
                break;
            }
            all.release(index);
            tokio::time::advance(Duration::from_secs(1)).await;
        }
        out.push(start.elapsed().as_secs());
        let second = all.choose(ONE, 0, &[], |_| true);
        assert_eq!(second, Some(1), "one request tries it");
        all.release(1);
        all.record_failure(ONE, 0, &refused_connection());
        all.release(0);
    }
    assert_eq!(out[..4], [5, 10, 15, 20]);
    assert_eq!(out[13], 60);
    // One reply brings it back, with a clean record.
    tokio::time::advance(Duration::from_mins(2)).await;
    assert_eq!(all.choose(ONE, 0, &[1], |_| true), Some(0));
    assert!(all.record_success(ONE, 0, None, Instant::now()));
    assert!(all.accepts(ONE, 0));
    all.record_failure(ONE, 0, &refused_connection());
    assert!(all.accepts(ONE, 0));
}

#[tokio::test(start_paused = true)]
async fn what_the_request_may_have_caused_spends_a_retry() {
    let all = balancer(2);
    let server = failed(FailureKind::Server, Some(500), Reach::Trial);
    assert_eq!(all.record_failure(ONE, 0, &server), Failover::None);
    assert_eq!(all.record_failure(ONE, 0, &server), Failover::None);
    assert_eq!(
        all.record_failure(ONE, 0, &server),
        Failover::OtherReplica,
        "now it is out"
    );
    // A reply in between resets the count.
    all.record_failure(ONE, 1, &server);
    all.record_failure(ONE, 1, &server);
    assert!(all.record_success(ONE, 1, None, Instant::now()));
    all.record_failure(ONE, 1, &server);
    assert!(all.accepts(ONE, 1));
    // One to a request from before the failure does not.
    let before = Instant::now();
    tokio::time::advance(Duration::from_secs(1)).await;
    all.record_failure(ONE, 1, &server);
    assert!(all.record_success(ONE, 1, None, before));
    tokio::time::advance(Duration::from_secs(1)).await;
    assert!(all.record_success(ONE, 1, None, Instant::now()));
    // A refusal of the request, and a rate limit, reveal nothing about the replica.
    for (kind, status, retry) in [
        (FailureKind::Request, 400, Retry::Never),
        (FailureKind::RateLimit, 429, Retry::WhenAccepted),
        (FailureKind::Server, 503, Retry::WhenAccepted),
    ] {
        for _ in 0..9 {
            let failure = AskError {
                retry,
                ..failed(kind, Some(status), Reach::Trial)
            };
            assert_eq!(all.record_failure(ONE, 1, &failure), Failover::None);
        }
        assert!(all.accepts(ONE, 1), "{status}");
    }
}

#[tokio::test(start_paused = true)]
async fn a_replica_without_the_model_is_gone_and_the_last_one_stops_the_run() {
    let all = balancer(2);
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
async fn a_replica_of_another_model_is_gone() {
    let all = balancer(3);
    assert!(all.record_success(ONE, 0, Some("a"), Instant::now()));
    assert!(
        all.record_success(ONE, 1, None, Instant::now()),
        "it does not say"
    );
    assert!(!all.record_success(ONE, 1, Some("b"), Instant::now()));
    assert!(!all.accepts(ONE, 1));
    assert!(all.record_success(ONE, 2, Some("a"), Instant::now()) && all.accepts(ONE, 2));
}

/// The state of a replica for one model does not affect another model at the same replicas.
#[tokio::test(start_paused = true)]
async fn each_model_has_replicas_of_its_own() {
    let all = balancer(2);
    let other = all.add_model("b".to_owned());
    for (model, name) in [(ONE, "a"), (other, "b"), (ONE, "a")] {
        for index in 0..2 {
            let is_expected = all.record_success(model, index, Some(name), Instant::now());
            assert!(
                is_expected && all.accepts(model, index),
                "{name} at {index}"
            );
        }
    }
    let missing = failed(FailureKind::Request, Some(404), Reach::Endpoint);
    assert_eq!(all.record_failure(ONE, 0, &missing), Failover::OtherReplica);
    assert_eq!(all.record_failure(ONE, 1, &missing), Failover::None);
    assert_eq!(all.choose(ONE, 0, &[], |_| true), None);
    assert!(!all.has_other(ONE, &[]) && all.has_other(other, &[0]));
    assert!(all.choose(other, 0, &[], |_| true).is_some());
    // A replica that does not answer is out for all of them.
    for _ in 0..3 {
        all.record_failure(other, 0, &refused_connection());
    }
    assert!(!all.accepts(other, 0) && all.accepts(other, 1));
}

/// A model is asked retry without the field that a replica refuses.
#[tokio::test(start_paused = true)]
async fn a_refused_field_takes_no_replica_away() {
    let all = balancer(2);
    let field = AskError {
        refused_field: Some(AdaptableField::Temperature),
        ..failed(FailureKind::Request, Some(403), Reach::Endpoint)
    };
    assert_eq!(all.record_failure(ONE, 0, &field), Failover::None);
    assert!(all.accepts(ONE, 0));
}

#[tokio::test(start_paused = true)]
async fn if_none_works_all_are_tried_as_one_endpoint_is() {
    let all = balancer(2);
    for index in [0, 0, 0, 1, 1] {
        all.record_failure(ONE, index, &refused_connection());
    }
    assert_eq!(
        all.record_failure(ONE, 1, &refused_connection()),
        Failover::None,
        "no other is left"
    );
    assert!(!all.accepts(ONE, 0) && !all.accepts(ONE, 1));
    assert!(all.choose(ONE, 0, &[], |_| true).is_some());
}

#[test]
fn those_that_have_room_come_first() {
    let all = balancer(3);
    for image in 0..20 {
        assert_eq!(all.choose(ONE, image, &[], |index| index == 1), Some(1));
        all.release(1);
    }
    drop(all.guard(1));
    assert_eq!(all.in_flight(1), 0);
}
