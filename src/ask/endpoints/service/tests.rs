use super::*;
use crate::ask::requests::AdaptableField;

fn services(count: usize) -> Services {
    let all = Services::new((0..count).map(|index| format!("r{index}")));
    assert_eq!(all.add_model("a".to_owned()), ONE);
    all
}

/// The first model at the replicas, which every test has.
const ONE: ModelNumber = ModelNumber(0);

fn failed(kind: FailureKind, status: Option<u16>, reach: Reach) -> AskError {
    let mut failed = AskError::new(kind, "no".to_owned());
    failed.failure.status = status;
    AskError {
        reach,
        again: Again::Later,
        ..failed
    }
}

fn refused_connection() -> AskError {
    failed(FailureKind::Connection, None, Reach::Trial)
}

fn choose(services: &Services, affinity: u64) -> usize {
    match services.choose(ONE, affinity, &[], |_| true) {
        Choice::Replica(index) => index,
        Choice::None => panic!("none"),
    }
}

/// The requests of one image stay together while the load allows it, and the load stays even.
#[tokio::test(start_paused = true)]
async fn requests_of_one_image_meet_one_replica_while_the_load_is_even() {
    let all = services(4);
    let favourite = choose(&all, 7);
    for _ in 0..LEANING {
        assert_eq!(choose(&all, 7), favourite);
    }
    assert_ne!(
        choose(&all, 7),
        favourite,
        "four more than the others are too many"
    );
    // Whatever the images are, no replica has more than LEANING + 1 more than another.
    let all = services(4);
    for image in 0..400_u64 {
        for _ in 0..3 {
            choose(&all, image);
        }
        let loads: Vec<usize> = (0..4).map(|index| all.in_flight(index)).collect();
        let (least, most) = (loads.iter().min().unwrap(), loads.iter().max().unwrap());
        assert!(most - least <= LEANING + 1, "{loads:?}");
    }
    // The favourites are spread evenly.
    let mut counts = [0_u32; 4];
    for image in 0..4000_u64 {
        let all = services(4);
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
            .max_by_key(|index| weight(affinity, **index))
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
    let all = services(2);
    let mut out = Vec::new();
    for _ in 0..2 {
        assert_eq!(all.failed(ONE, 0, &refused_connection()), Effect::Elsewhere);
        assert!(all.takes(ONE, 0));
    }
    assert_eq!(all.failed(ONE, 0, &refused_connection()), Effect::Elsewhere);
    assert!(!all.takes(ONE, 0));
    for _ in 0..14 {
        let start = Instant::now();
        // Until it may be tried, everything goes to the other; then one request alone tries it.
        loop {
            let taken = all.choose(ONE, 0, &[1], |_| true);
            let Choice::Replica(index) = taken else {
                panic!()
            };
            if index == 0 {
                break;
            }
            all.released(index);
            tokio::time::advance(Duration::from_secs(1)).await;
        }
        out.push(start.elapsed().as_secs());
        let second = all.choose(ONE, 0, &[], |_| true);
        assert_eq!(second, Choice::Replica(1), "one request tries it");
        all.released(1);
        all.failed(ONE, 0, &refused_connection());
        all.released(0);
    }
    assert_eq!(out[..4], [5, 10, 15, 20]);
    assert_eq!(out[13], 60);
    // One reply brings it back, with a clean record.
    tokio::time::advance(Duration::from_mins(2)).await;
    assert_eq!(all.choose(ONE, 0, &[1], |_| true), Choice::Replica(0));
    assert!(all.succeeded(ONE, 0, None, Instant::now()).is_ok());
    assert!(all.takes(ONE, 0));
    all.failed(ONE, 0, &refused_connection());
    assert!(all.takes(ONE, 0));
}

#[tokio::test(start_paused = true)]
async fn what_the_request_may_have_caused_spends_a_retry() {
    let all = services(2);
    let server = failed(FailureKind::Server, Some(500), Reach::Trial);
    assert_eq!(all.failed(ONE, 0, &server), Effect::Own);
    assert_eq!(all.failed(ONE, 0, &server), Effect::Own);
    assert_eq!(
        all.failed(ONE, 0, &server),
        Effect::Elsewhere,
        "now it is out"
    );
    // A reply in between begins the count anew.
    all.failed(ONE, 1, &server);
    all.failed(ONE, 1, &server);
    assert!(all.succeeded(ONE, 1, None, Instant::now()).is_ok());
    all.failed(ONE, 1, &server);
    assert!(all.takes(ONE, 1));
    // One to a request from before the failure does not.
    let before = Instant::now();
    tokio::time::advance(Duration::from_secs(1)).await;
    all.failed(ONE, 1, &server);
    assert!(all.succeeded(ONE, 1, None, before).is_ok());
    tokio::time::advance(Duration::from_secs(1)).await;
    assert!(all.succeeded(ONE, 1, None, Instant::now()).is_ok());
    // A refusal of the request, and a rate limit, reveal nothing about the replica.
    for (kind, status, again) in [
        (FailureKind::Request, 400, Again::Never),
        (FailureKind::RateLimit, 429, Again::WhenTaken),
        (FailureKind::Server, 503, Again::WhenTaken),
    ] {
        for _ in 0..9 {
            let failure = AskError {
                again,
                ..failed(kind, Some(status), Reach::Trial)
            };
            assert_eq!(all.failed(ONE, 1, &failure), Effect::Own);
        }
        assert!(all.takes(ONE, 1), "{status}");
    }
}

#[tokio::test(start_paused = true)]
async fn a_replica_without_the_model_is_gone_and_the_last_one_stops_the_run() {
    let all = services(2);
    let missing = failed(FailureKind::Request, Some(404), Reach::Endpoint);
    assert_eq!(all.failed(ONE, 0, &missing), Effect::Elsewhere);
    tokio::time::advance(Duration::from_hours(1)).await;
    for image in 0..20 {
        assert_eq!(choose(&all, image), 1);
    }
    assert_eq!(all.failed(ONE, 1, &missing), Effect::Own);
    assert_eq!(all.choose(ONE, 0, &[], |_| true), Choice::None);
}

#[tokio::test(start_paused = true)]
async fn a_replica_of_another_model_is_gone() {
    let all = services(3);
    assert!(all.succeeded(ONE, 0, Some("a"), Instant::now()).is_ok());
    assert!(
        all.succeeded(ONE, 1, None, Instant::now()).is_ok(),
        "it does not say"
    );
    assert_eq!(
        all.succeeded(ONE, 1, Some("b"), Instant::now()),
        Err(Effect::Elsewhere)
    );
    assert!(!all.takes(ONE, 1));
    assert!(all.succeeded(ONE, 2, Some("a"), Instant::now()).is_ok() && all.takes(ONE, 2));
}

/// The state of a replica for one model does not affect another model at the same replicas.
#[tokio::test(start_paused = true)]
async fn each_model_has_replicas_of_its_own() {
    let all = services(2);
    let other = all.add_model("b".to_owned());
    for (model, name) in [(ONE, "a"), (other, "b"), (ONE, "a")] {
        for index in 0..2 {
            let noted = all.succeeded(model, index, Some(name), Instant::now());
            assert!(
                noted.is_ok() && all.takes(model, index),
                "{name} at {index}"
            );
        }
    }
    let missing = failed(FailureKind::Request, Some(404), Reach::Endpoint);
    assert_eq!(all.failed(ONE, 0, &missing), Effect::Elsewhere);
    assert_eq!(all.failed(ONE, 1, &missing), Effect::Own);
    assert_eq!(all.choose(ONE, 0, &[], |_| true), Choice::None);
    assert!(!all.has_other(ONE, &[]) && all.has_other(other, &[0]));
    assert!(matches!(
        all.choose(other, 0, &[], |_| true),
        Choice::Replica(_)
    ));
    // A replica that does not answer is out for all of them.
    for _ in 0..3 {
        all.failed(other, 0, &refused_connection());
    }
    assert!(!all.takes(other, 0) && all.takes(other, 1));
}

/// A model is asked again without the field that a replica refuses.
#[tokio::test(start_paused = true)]
async fn a_refused_field_takes_no_replica_away() {
    let all = services(2);
    let field = AskError {
        refused_field: Some(AdaptableField::Temperature),
        ..failed(FailureKind::Request, Some(403), Reach::Endpoint)
    };
    assert_eq!(all.failed(ONE, 0, &field), Effect::Own);
    assert!(all.takes(ONE, 0));
}

#[tokio::test(start_paused = true)]
async fn if_none_works_all_are_tried_as_one_endpoint_is() {
    let all = services(2);
    for index in [0, 0, 0, 1, 1] {
        all.failed(ONE, index, &refused_connection());
    }
    assert_eq!(
        all.failed(ONE, 1, &refused_connection()),
        Effect::Own,
        "no other is left"
    );
    assert!(!all.takes(ONE, 0) && !all.takes(ONE, 1));
    assert!(matches!(
        all.choose(ONE, 0, &[], |_| true),
        Choice::Replica(_)
    ));
}

#[test]
fn those_that_have_room_come_first() {
    let all = services(3);
    for image in 0..20 {
        assert_eq!(
            all.choose(ONE, image, &[], |index| index == 1),
            Choice::Replica(1)
        );
        all.released(1);
    }
    drop(all.guard(1));
    assert_eq!(all.in_flight(1), 0);
}
