//! Several replicas of one server: the load, the caches, and what happens if one of them fails.

use std::collections::{BTreeMap, VecDeque};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use serde_json::{Value, json};

use crate::support::endpoint::{Answer, MockEndpoint};
use crate::support::run::{Bench, Called, records, words};

const RUN: &str = "--data set.jsonl --levels L0 --out run --models models.toml";

/// A run of one model at these replicas.
fn run(bench: &Bench, replicas: &[&MockEndpoint], more: &str, line: &str) -> Called {
    run_models(bench, replicas, &[("m", more)], line)
}

/// A run of models, each with more lines of its table, that all have these replicas.
fn run_models(bench: &Bench, replicas: &[&MockEndpoint], models: &[(&str, &str)], line: &str) -> Called {
    let urls: Vec<String> = replicas.iter().map(|mock| format!("\"{}\"", mock.base_url())).collect();
    let endpoints = urls.join(", ");
    let tables =
        models.iter().map(|(id, more)| format!("[[model]]\nid = \"{id}\"\nendpoints = [{endpoints}]\n{more}\n"));
    bench.file("models.toml", tables.collect::<String>());
    bench.call(&words(&format!("{RUN} {line}")))
}

/// The number of chat requests that a replica was sent.
fn asked(mock: &MockEndpoint) -> usize {
    let requests = mock.requests();
    requests.iter().filter(|request| request.line.starts_with("POST")).count()
}

/// A server that answers after a time.
fn slow(milliseconds: u64) -> MockEndpoint {
    MockEndpoint::answering(move |_| {
        std::thread::sleep(Duration::from_millis(milliseconds));
        Answer::text("A")
    })
}

#[test]
fn the_load_is_shared() {
    let bench = Bench::with_questions(80);
    let mocks = [slow(20), slow(20), slow(20)];
    let called = run(&bench, &mocks.each_ref(), "", "");
    assert_eq!(called.code, Some(0), "{called:?}");
    let shares = mocks.each_ref().map(asked);
    assert_eq!(shares.iter().sum::<usize>(), 80, "none was sent twice: {shares:?}");
    assert!(shares.iter().all(|share| *share >= 12), "{shares:?}");
    for (index, share) in shares.into_iter().enumerate() {
        let records = records(&bench.path("run"));
        let own = records.iter().filter(|record| record["endpoint"] == index);
        assert_eq!(own.count(), share);
    }
    let manifest = std::fs::read_to_string(bench.path("run/manifest.json")).unwrap();
    assert!(mocks.iter().all(|mock| manifest.contains(&mock.base_url())));
}

#[test]
fn replica_that_dies_costs_no_trial() {
    let bench = Bench::with_questions(120);
    let replies = AtomicUsize::new(0);
    let dying = MockEndpoint::answering(move |_| {
        std::thread::sleep(Duration::from_millis(10));
        match replies.fetch_add(1, Ordering::SeqCst) {
            0..15 => Answer::text("A"),
            _ => Answer::dropped(),
        }
    });
    let living = [slow(10), slow(10)];
    // Without retries a trial that lost a try would have failed.
    let called = run(&bench, &[&living[0], &dying, &living[1]], "retries = 0", "");
    assert_eq!(called.code, Some(0), "{called:?}");
    let records = records(&bench.path("run"));
    assert_eq!(records.len(), 120);
    assert!(records.iter().all(|record| record["outcome"] != "failed"));
    let lost = asked(&dying) - 15;
    // Its window is some 10 requests; three failures tell that it is out, and one request tries it again.
    assert!(lost <= 16, "{lost} requests were lost");
    assert_eq!(asked(&living[0]) + asked(&living[1]), 120 - 15);
    assert!(called.stderr.contains("failures in a row"), "{called:?}");
}

#[test]
fn replicas_without_access_drop_out() {
    let bench = Bench::with_questions(20);
    let locked = MockEndpoint::start([Answer::error(401, "invalid_api_key", "no such key")]);
    let open = slow(5);
    let called = run(&bench, &[&locked, &open], "", "");
    assert_eq!(called.code, Some(0), "{called:?}");
    assert_eq!(asked(&open), 20);
    assert_eq!(called.stderr.matches("gets no more requests").count(), usize::from(asked(&locked) > 0));
    let other = MockEndpoint::start([Answer::error(401, "invalid_api_key", "no such key")]);
    let bench = Bench::with_questions(20);
    let called = run(&bench, &[&locked, &other], "", "");
    insta::assert_snapshot!(called.messages(), @"
    exit code: 2
     WARN http://127.0.0.1:[PORT]/v1: it gets no more requests for m: http://127.0.0.1:[PORT]/v1 answered 401: no
        such key (no key was sent: set OPENAI_API_KEY, or name another variable or a file with --api-key-env or
        --api-key-file)
     WARN http://127.0.0.1:[PORT]/v1: it gets no more requests for m: http://127.0.0.1:[PORT]/v1 answered 401: no
        such key (no key was sent: set OPENAI_API_KEY, or name another variable or a file with --api-key-env or
        --api-key-file)
    error: http://127.0.0.1:[PORT]/v1 http://127.0.0.1:[PORT]/v1: m: http://127.0.0.1:[PORT]/v1 answered 401: no
        such key (no key was sent: set OPENAI_API_KEY, or name another variable or a file with --api-key-env or
        --api-key-file) (replies so far are stored; the same command continues)
    ");
    assert_eq!(asked(&other), 1);
}

#[test]
fn replica_of_other_model_is_unused() {
    let bench = Bench::with_questions(40);
    let named = |name: &'static str| {
        MockEndpoint::answering(move |_| {
            std::thread::sleep(Duration::from_millis(10));
            let choice = json!({"index": 0, "message": {"content": "A"}, "finish_reason": "stop"});
            Answer::json(200, &json!({"model": name, "choices": [choice]}))
        })
    };
    let (one, two) = (named("m"), named("other"));
    let called = run(&bench, &[&one, &two], "", "");
    assert_eq!(called.code, Some(0), "{called:?}");
    let served: BTreeMap<String, usize> =
        records(&bench.path("run")).iter().fold(BTreeMap::new(), |mut counts, record| {
            *counts.entry(record["served_model"].as_str().unwrap().to_owned()).or_default() += 1;
            counts
        });
    assert_eq!(served.len(), 1, "{served:?}");
    assert_eq!(called.stderr.matches("it gets no more requests").count(), 1, "{called:?}");
}

/// A server of only these models; its replies name the model.
fn serving_models(known: &'static [&'static str]) -> MockEndpoint {
    MockEndpoint::answering(move |request| {
        std::thread::sleep(Duration::from_millis(5));
        let model = request["model"].as_str().unwrap();
        if !known.contains(&model) {
            return Answer::error(404, "model_not_found", "no such model");
        }
        let choice = json!({"index": 0, "message": {"content": "A"}, "finish_reason": "stop"});
        Answer::json(200, &json!({"model": model, "choices": [choice]}))
    })
}

/// The numbers of replies and failures of a model, and how many replies each of two replicas gave.
fn outcomes(bench: &Bench, model: &str) -> (usize, usize, [usize; 2]) {
    let records = records(&bench.path("run"));
    let own = records.iter().filter(|record| record["model"] == model);
    let (failed, answered): (Vec<_>, Vec<_>) = own.partition(|record| record["outcome"] == "failed");
    let at = |index: u64| answered.iter().filter(move |record| record["endpoint"] == index);
    (answered.len(), failed.len(), [at(0).count(), at(1).count()])
}

#[test]
fn models_share_replicas() {
    let bench = Bench::with_questions(40);
    let mocks = [serving_models(&["qwen", "internvl"]), serving_models(&["qwen", "internvl"])];
    let called = run_models(&bench, &mocks.each_ref(), &[("qwen", ""), ("internvl", "")], "");
    assert_eq!(called.code, Some(0), "{called:?}");
    assert!(!called.stderr.contains("gets no more requests"), "{called:?}");
    for model in ["qwen", "internvl"] {
        let (answered, failed, shares) = outcomes(&bench, model);
        assert_eq!((answered, failed), (40, 0), "{model}");
        assert!(shares.iter().all(|share| *share > 0), "{model}: {shares:?}");
    }
}

#[test]
fn model_without_replica_leaves_others() {
    let bench = Bench::with_questions(40);
    let mocks = [serving_models(&["m"]), serving_models(&["m"])];
    let called = run_models(&bench, &mocks.each_ref(), &[("mistyped", ""), ("m", "")], "");
    assert_eq!(called.code, Some(1), "the mistyped one was stopped: {called:?}");
    let (answered, failed, shares) = outcomes(&bench, "m");
    assert_eq!((answered, failed), (40, 0));
    assert!(shares.iter().all(|share| *share > 0), "{shares:?}");
    let (answered, _, _) = outcomes(&bench, "mistyped");
    assert_eq!(answered, 0);
    assert_eq!(called.stderr.matches("gets no more requests for mistyped").count(), 2, "{called:?}");
    // One replica that lacks a model is left out for that model alone.
    let bench = Bench::with_questions(40);
    let mocks = [serving_models(&["m"]), serving_models(&["m", "n"])];
    let called = run_models(&bench, &mocks.each_ref(), &[("n", ""), ("m", "")], "");
    assert_eq!(called.code, Some(0), "{called:?}");
    let (answered, failed, shares) = outcomes(&bench, "n");
    assert_eq!((answered, failed, shares), (40, 0, [0, 40]));
    let (answered, failed, shares) = outcomes(&bench, "m");
    assert_eq!((answered, failed), (40, 0));
    assert!(shares.iter().all(|share| *share > 0), "{shares:?}");
}

/// A request that can be adapted costs a model no replica.
#[test]
fn refused_api_keeps_replicas() {
    let bench = Bench::with_questions(4);
    let responses_alone = || {
        MockEndpoint::watching(|request| {
            if request.line.starts_with("GET ") {
                return Answer::new(404, "");
            }
            if request.line.contains("/chat/completions") {
                let message = "This model is only supported in v1/responses and not in v1/chat/completions.";
                return Answer::error(404, "unsupported", message);
            }
            let content = json!([{"type": "output_text", "text": "A"}]);
            let output = json!([{"type": "message", "role": "assistant", "content": content}]);
            Answer::json(200, &json!({"model": "m", "status": "completed", "output": output}))
        })
    };
    let mocks = [responses_alone(), responses_alone()];
    let called = run(&bench, &mocks.each_ref(), "", "");
    assert_eq!(called.code, Some(0), "{called:?}");
    assert!(!called.stderr.contains("gets no more requests"), "{called:?}");
}

#[test]
fn differing_replicas_are_reported() {
    let bench = Bench::with_questions(4);
    let serving = |length: u32| {
        MockEndpoint::watching(move |request| {
            if request.line.starts_with("GET /v1/models ") {
                let data = json!([{"id": "m", "root": "/models/m", "max_model_len": length}]);
                return Answer::json(200, &json!({"data": data}));
            }
            Answer::text("A")
        })
    };
    let (one, two, three) = (serving(8192), serving(8192), serving(4096));
    let called = run(&bench, &[&one, &two], "", "");
    assert_eq!((called.code, &*called.stderr), (Some(0), ""));
    let bench = Bench::with_questions(4);
    let called = run(&bench, &[&one, &three], "", "");
    insta::assert_snapshot!(called.messages(), @r#"
    exit code: 0
     WARN the replicas http://127.0.0.1:[PORT]/v1 and http://127.0.0.1:[PORT]/v1 serve the model m differently
        (max_model_len 8192, root "/models/m" and max_model_len 4096, root "/models/m"): their replies may differ
    "#);
    // A single one is not asked for its models.
    let single = serving(1);
    let bench = Bench::with_questions(1);
    run(&bench, &[&single], "", "");
    assert_eq!((single.requests().len(), asked(&single)), (1, 1));
}

#[test]
fn one_address_twice_is_refused() {
    let bench = Bench::with_questions(1);
    let mock = slow(0);
    let called = run(&bench, &[&mock, &mock], "", "");
    insta::assert_snapshot!(called.messages(), @"
    exit code: 2
    error: models.toml, line 2: m: --base-url: http://127.0.0.1:[PORT]/v1 is named twice
    ");
}

/// A server that takes so many requests a second and turns the others away, with the store that it begins with.
fn limited(rate: f64) -> MockEndpoint {
    let state = Mutex::new((Instant::now(), rate));
    MockEndpoint::answering(move |_| {
        let taken = {
            let mut state = state.lock().unwrap();
            let (last, store) = *state;
            let now = Instant::now();
            let store = (store + rate * now.duration_since(last).as_secs_f64()).min(rate);
            let taken = store >= 1.0;
            *state = (now, if taken { store - 1.0 } else { store });
            taken
        };
        if !taken {
            return Answer::error(429, "rate_limit_exceeded", "slow down").header("retry-after", "1");
        }
        std::thread::sleep(Duration::from_millis(100));
        Answer::text("A")
    })
}

/// A limit of the user is one for all replicas together.
#[test]
fn rate_limit_covers_all_replicas() {
    let bench = Bench::with_questions(6);
    let times = Arc::new(Mutex::new(VecDeque::new()));
    let watched = || {
        let times = Arc::clone(&times);
        MockEndpoint::answering(move |_| {
            times.lock().unwrap().push_back(Instant::now());
            Answer::text("A")
        })
    };
    let mocks = [watched(), watched(), watched()];
    // One every 200 ms, whichever takes it.
    let called = run(&bench, &mocks.each_ref(), "rpm = 300", "");
    assert_eq!(called.code, Some(0), "{called:?}");
    let times = times.lock().unwrap();
    let took = times.back().unwrap().duration_since(*times.front().unwrap());
    assert!(took >= Duration::from_millis(950), "{took:?}");
}

/// Four replicas of ten a second each. What is turned away tells how well each is known; the time depends on the
/// machine.
#[test]
fn four_replicas_quadruple_speed() {
    let bench = Bench::with_questions(240);
    let mocks = [limited(10.0), limited(10.0), limited(10.0), limited(10.0)];
    let called = run(&bench, &mocks.each_ref(), "", "");
    assert_eq!(called.code, Some(0), "{called:?}");
    let sent: usize = mocks.iter().map(asked).sum();
    let records = records(&bench.path("run"));
    assert!(records.iter().all(|record: &Value| record["outcome"] != "failed"));
    assert!(sent < 300, "{sent}");
}
