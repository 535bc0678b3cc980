//! Charges that servers state in their replies, and prices of versions and service tiers.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use serde_json::{Value, json};

use crate::support::endpoint::{Answer, MockEndpoint};
use crate::support::run::{Bench, Called, model_args, records, words};
use crate::support::snapshot::on_one_line;
use crate::support::table::check_rows_at_once;

/// A prompt of 100 tokens costs $0.10, a reply nothing.
const PRICES: &str =
    "as-of = \"2026-01-01\"\nbatch = 0.5\n[models]\nm = { input = 1000, output = 0, image-tokens = 30 }\n";

/// The list price of a reply here, in dollars.
const LIST: f64 = 0.1;

/// A reply whose body and headers state a charge in a vendor's way.
fn stated(usage: Value, beside: Value, header: Option<(&str, f64)>) -> Answer {
    let mut body = json!({
        "choices": [{"message": {"content": "C"}, "finish_reason": "stop"}],
        "usage": {"prompt_tokens": 100, "completion_tokens": 1},
    });
    for (into, fields) in [("/usage", usage), ("", beside)] {
        let target = body.pointer_mut(into).and_then(Value::as_object_mut).unwrap();
        target.extend(fields.as_object().cloned().unwrap_or_default());
    }
    let answer = Answer::json(200, &body);
    match header {
        Some((name, dollars)) => answer.header(name, &dollars.to_string()),
        None => answer,
    }
}

fn call(bench: &Bench, mock: &MockEndpoint, more: &str) -> Called {
    bench.file("prices.toml", PRICES);
    let base = mock.base_url();
    let line = format!("--data set.jsonl --levels L0 --out run --prices prices.toml {more}");
    bench.call(&model_args(&base, &line))
}

/// The way in which a vendor states a charge of some dollars.
type Vendor = fn(f64) -> Answer;

const VENDORS: [(&str, Vendor); 6] = [
    ("OpenRouter", |dollars| stated(json!({"cost": dollars, "is_byok": false}), Value::Null, None)),
    ("xAI", |dollars| stated(json!({"cost_in_usd_ticks": (dollars * 1e10).round()}), Value::Null, None)),
    ("Perplexity", |dollars| {
        let cost = json!({"input_tokens_cost": 0.001, "total_cost": dollars});
        stated(json!({"cost": cost}), Value::Null, None)
    }),
    ("LiteLLM", |dollars| stated(Value::Null, Value::Null, Some(("x-litellm-response-cost", dollars)))),
    ("LLM Gateway", |dollars| stated(json!({"cost_usd_total": dollars, "cost_usd_input": 9.0}), Value::Null, None)),
    ("own key at OpenRouter", |dollars| {
        let details = json!({"upstream_inference_cost": dollars - 0.01});
        stated(json!({"cost": 0.01, "is_byok": true, "cost_details": details}), Value::Null, None)
    }),
];

/// The bill of six replies, at charges that differ, in every vendor's way.
#[test]
fn bills_are_those_of_the_vendors() {
    check_rows_at_once(VENDORS, |(vendor, answer)| {
        let bench = Bench::with_questions(6);
        let bill = Arc::new(Mutex::new(0.0));
        let number = AtomicUsize::new(0);
        let mock = MockEndpoint::answering({
            let bill = Arc::clone(&bill);
            move |_| {
                let dollars = 0.25 + 0.125 * number.fetch_add(1, Ordering::SeqCst) as f64;
                *bill.lock().unwrap() += dollars;
                answer(dollars)
            }
        });
        let called = call(&bench, &mock, "").ended(0);
        // 0.25 + 0.375 + … + 0.875
        let bill = *bill.lock().unwrap();
        assert!((bill - 3.375).abs() < 1e-9, "{vendor}");
        let records = records(&bench.path("run"));
        let kept: f64 = records.iter().map(|record| record["usage"]["cost"].as_f64().unwrap()).sum();
        assert!((kept - bill).abs() < 1e-9, "{vendor}: {kept}");
        let report = on_one_line(&bench.complete(&words("report run")));
        for text in [on_one_line(&called.stdout), report] {
            let cost = "$3.38 as its replies state, against $0.6000 at the prices of 2026-01-01";
            assert!(text.contains(cost), "{vendor}: {text}");
        }
        let told = on_one_line(&called.stderr);
        assert_eq!(told.matches("as its server states").count(), 1, "{vendor}: {told}");
        assert!(told.contains("where the price table gives $0.1000"), "{vendor}: {told}");
    });
}

#[test]
fn a_limit_counts_stated_charges() {
    check_rows_at_once(VENDORS, |(vendor, answer)| {
        let bench = Bench::with_questions(12);
        let mock = MockEndpoint::answering(move |_| answer(5.0 * LIST));
        let called = call(&bench, &mock, "--max-cost 2.6");
        // Five replies at $0.50; a sixth would exceed it.
        let asked = mock.requests().len();
        assert_eq!((called.code, asked), (Some(3), 5), "{vendor}: {called:?}");
        let again = call(&bench, &mock, "--max-cost 2.6");
        assert_eq!((again.code, mock.requests().len()), (Some(3), 5), "{vendor}");
        // The estimate of the rest follows the charges.
        let estimate = call(&bench, &mock, "--dry-run --json").ended(0);
        let estimate: Value = serde_json::from_str(&estimate.stdout).unwrap();
        let line = &estimate["lines"][0];
        let ratio = line["charge_ratio"].as_f64().unwrap();
        assert!((ratio - 5.0).abs() < 1e-6, "{vendor}: {estimate}");
        let tokens = line["text_tokens"].as_f64().unwrap() + line["image_tokens"].as_f64().unwrap();
        let dollars = line["dollars"].as_f64().unwrap();
        assert!((dollars - 5.0 * tokens / 1000.0).abs() < 1e-6, "{vendor}: {estimate}");
    });
}

#[test]
fn list_prices_stated_change_nothing() {
    let silent = Bench::with_questions(12);
    let without = MockEndpoint::start([stated(Value::Null, Value::Null, None)]);
    let plain = call(&silent, &without, "--max-cost 0.75");
    check_rows_at_once(VENDORS, |(vendor, answer)| {
        let bench = Bench::with_questions(12);
        let mock = MockEndpoint::answering(move |_| answer(LIST));
        let called = call(&bench, &mock, "--max-cost 0.75");
        let asked = (mock.requests().len(), called.code);
        assert_eq!(asked, (without.requests().len(), plain.code), "{vendor}");
        assert_eq!(called.stderr, plain.stderr, "{vendor}");
    });
}

#[test]
fn records_keep_what_is_stated_and_nothing_else() {
    let bench = Bench::with_questions(2);
    let answers = [
        stated(json!({"cost": 0.125}), json!({"service_tier": "default"}), None),
        stated(Value::Null, Value::Null, None),
    ];
    let mock = MockEndpoint::start(answers);
    call(&bench, &mock, "--concurrency 1").ended(0);
    let usages: Vec<Value> = records(&bench.path("run")).iter().map(|record| record["usage"].clone()).collect();
    let plain = json!({"prompt_tokens": 100, "completion_tokens": 1});
    let mut first = plain.clone();
    first["cost"] = 0.125.into();
    first["service_tier"] = "standard".into();
    assert_eq!(usages, [first, plain]);
}

#[test]
fn odd_charges_are_ignored_and_said() {
    for (usage, said) in [
        (json!({"cost": -3}), "usage.cost of -3, no plausible charge"),
        (json!({"cost": "NaN"}), "usage.cost of NaN, no plausible charge"),
        (json!({"cost": 3, "currency": "CNY"}), "a charge in CNY, not in US dollars"),
        (json!({"cost": 25, "cost_unit": "credits"}), "a charge in credits, not in US dollars"),
        (json!({"cost": 25}), "states a charge of $25, where the price table gives $0.1000"),
        (json!({"cost": 0}), "states a charge of $0, where the price table gives $0.1000"),
    ] {
        let bench = Bench::with_questions(12);
        let mock = MockEndpoint::start([stated(usage.clone(), Value::Null, None)]);
        let called = call(&bench, &mock, "--max-cost 0.75");
        assert_eq!((called.code, mock.requests().len()), (Some(3), 7), "{usage}: {called:?}");
        let told = on_one_line(&called.stderr);
        assert_eq!(told.matches(said).count(), 1, "{usage}: {told}");
    }
}

/// Charges of a model without a price are summed up; a limit still needs a price.
#[test]
fn stated_charges_need_no_price() {
    let bench = Bench::with_questions(4);
    let mock = MockEndpoint::start([stated(json!({"cost": 0.25}), Value::Null, None)]);
    let base = mock.base_url();
    let line = "--data set.jsonl --levels L0 --out run";
    let called = bench.call(&model_args(&base, line)).ended(0);
    assert!(on_one_line(&called.stdout).contains("$1.00 as its replies state"), "{called:?}");
}

#[test]
fn streams_and_responses_state_charges() {
    let piece = json!({"choices": [{"index": 0, "delta": {"content": "C"}, "finish_reason": "stop"}]});
    let usage = json!({"choices": [], "usage": {"prompt_tokens": 100, "completion_tokens": 1, "cost": 0.25}});
    let stream = Answer::stream(&[&piece.to_string(), &usage.to_string(), "[DONE]"]);
    let response = json!({
        "status": "completed", "service_tier": "priority",
        "output": [{"type": "message", "content": [{"type": "output_text", "text": "C"}]}],
        "usage": {"input_tokens": 100, "output_tokens": 1, "cost_in_usd_ticks": 2_500_000_000_u64},
    });
    for (wire, answer) in [("chat-stream", stream), ("responses", Answer::json(200, &response))] {
        let bench = Bench::with_questions(2);
        let mock = MockEndpoint::start([answer]);
        let called = call(&bench, &mock, &format!("--request wire={wire}")).ended(0);
        assert!(on_one_line(&called.stdout).contains("$0.5000 as its replies state"), "{wire}: {called:?}");
    }
}

/// Prices of a model with a version and tiers; a reply costs $0.10 at the standard tier.
const TIERS: &str = "as-of = \"2026-01-01\"\nbatch = 0.5\n[models]\nm = { input = 1000, output = 0, image-tokens = 30 }\n\
                     [tiers.priority]\nm = 2\n[tiers.turbo]\nm = 4\n";

/// Number of requests within $1.10, and the call.
fn within_limit(answer: Answer, extra: &str) -> (usize, Called) {
    let bench = Bench::with_questions(14);
    bench.file("prices.toml", TIERS);
    let mock = MockEndpoint::start([answer]);
    let base = mock.base_url();
    let line = "--data set.jsonl --levels L0 --out run --prices prices.toml --max-cost 1.1 --concurrency 1";
    let mut args = model_args(&base, line);
    if !extra.is_empty() {
        args.extend(["--extra-body", extra]);
    }
    let called = bench.call(&args);
    (mock.requests().len(), called)
}

#[test]
fn service_tiers_have_their_own_prices() {
    let at = |tier: Value| stated(Value::Null, json!({"service_tier": tier}), None);
    for (tier, extra, replies) in [
        (Value::Null, "", 10),
        (json!("default"), "", 10),
        // The server chooses the tier.
        (json!("priority"), "", 5),
        (Value::Null, r#"{"service_tier":"priority"}"#, 5),
        (json!("priority"), r#"{"service_tier":"priority"}"#, 5),
        // The server has charged the standard tier, but may charge priority for the next one.
        (json!("default"), r#"{"service_tier":"priority"}"#, 9),
        // Until three prompts were charged, the bound of the next one is by its length: more than 175 tokens, or $0.70.
        (Value::Null, r#"{"service_tier":"turbo"}"#, 1),
        (json!("turbo"), r#"{"service_tier":"turbo"}"#, 1),
    ] {
        let (asked, called) = within_limit(at(tier.clone()), extra);
        let case = format!("{tier} {extra}: {called:?}");
        assert_eq!(asked, replies, "{case}");
    }
    let (_, called) = within_limit(at(json!("flex")), "");
    let told = on_one_line(&called.stderr);
    assert_eq!(told.matches("a service tier without a price in the table").count(), 1, "{told}");
}

/// The remedy in the message helps.
#[test]
fn a_tier_without_a_price_is_refused_before_the_first_request() {
    let answer = stated(Value::Null, Value::Null, None);
    let (asked, called) = within_limit(answer.clone(), r#"{"service_tier":"flex"}"#);
    assert_eq!((asked, called.code), (0, Some(2)));
    insta::assert_snapshot!(called.messages(), @r#"
    exit code: 2
    error: --max-cost: the table of [DATE] has no price of m at the service tier "flex"; add [tiers.flex] with "m"
        = FACTOR to your own table and name that with --prices FILE, or set price in a file of models
    "#);
    let bench = Bench::with_questions(2);
    bench.file("prices.toml", format!("{TIERS}[tiers.flex]\n\"m\" = 0.5\n"));
    let mock = MockEndpoint::start([answer]);
    let base = mock.base_url();
    let line = "--data set.jsonl --levels L0 --prices prices.toml --out run";
    let mut args = model_args(&base, line);
    args.extend(["--extra-body", r#"{"service_tier":"flex"}"#]);
    let called = bench.call(&args).ended(0);
    assert!(on_one_line(&called.stdout).contains("$0.1000 at the prices"), "{called:?}");
    // Without a limit and without a price, the run says why its cost is not known.
    bench.file("prices.toml", TIERS);
    let again = args.iter().map(|word| if *word == "run" { "other" } else { word });
    let called = bench.call(&again.collect::<Vec<_>>()).ended(0);
    let told = on_one_line(&called.stderr);
    assert!(
        told.contains("m: its cost is not known: the table of 2026-01-01 has no price of m at the service tier"),
        "{told}"
    );
}

#[test]
fn versions_have_the_price_of_their_model_only_if_the_table_says_so() {
    let run = |model: &str, prices: Option<&str>| {
        let bench = Bench::with_questions(2);
        let mock = MockEndpoint::start([stated(Value::Null, Value::Null, None)]);
        let base = mock.base_url();
        let mut args = vec!["--model", model, "--base-url", &base];
        args.extend(words("--data set.jsonl --levels L0 --out run --max-cost 5"));
        if let Some(prices) = prices {
            bench.file("prices.toml", prices);
            args.extend(["--prices", "prices.toml"]);
        }
        bench.call(&args)
    };
    for (model, cost) in [
        // 200 tokens of prompts, two of replies.
        ("gpt-4o", "$0.0005"),
        ("gpt-4o-2024-08-06", "$0.0005"),
        ("openai/gpt-4o-2024-05-13", "$0.0010"),
    ] {
        let called = run(model, None).ended(0);
        assert!(called.stdout.contains(cost), "{model}: {called:?}");
    }
    let refused = run("gpt-4o-2031-01-01", None).ended(2);
    let told = on_one_line(&refused.stderr);
    let reason = "has a price of gpt-4o, and does not say that gpt-4o-2031-01-01 costs the same";
    assert!(told.contains(reason), "{told}");
    let own = PRICES.replace("m = {", "gpt-4o-2031-01-01 = {");
    run("gpt-4o-2031-01-01", Some(&own)).ended(0);
}

/// Random numbers from a seed, from 0 to 1.
fn share(seed: u64) -> f64 {
    let mixed = (seed ^ 0x9e37_79b9_7f4a_7c15).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let mixed = (mixed ^ (mixed >> 29)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((mixed ^ (mixed >> 32)) >> 11) as f64 / (1_u64 << 53) as f64
}

/// Charge so far, dearest reply so far, requests in flight with their charges, and the excess that they may cause.
#[derive(Default)]
struct State {
    charged: f64,
    dearest: f64,
    in_flight: f64,
    excess: f64,
}

/// A run at a server that charges up to ten times the list price: its charge beyond the limit, and the most that it may
/// be, which is what was in flight when replies were dearer than any before.
fn simulate(seed: u64) -> (f64, f64) {
    let of = |place: u64| share(seed.wrapping_mul(1000) + place);
    let factor = 10_f64.powf(of(1));
    // Half of the servers charge some replies more than others.
    let varies = of(2) < 0.5;
    let concurrency = 1 + (of(3) * 15.0) as usize;
    let limit = LIST * (3.0 + 40.0 * of(4));
    let bench = Bench::with_questions(60);
    let state = Arc::new(Mutex::new(State::default()));
    let number = AtomicUsize::new(0);
    let vendor = VENDORS[(seed % VENDORS.len() as u64) as usize].1;
    let mock = MockEndpoint::answering({
        let state = Arc::clone(&state);
        move |_| {
            let place = number.fetch_add(1, Ordering::SeqCst) as u64;
            let ratio = if varies { factor.powf(share(seed.wrapping_mul(7919) + place)) } else { factor };
            let dollars = LIST * ratio;
            state.lock().unwrap().in_flight += dollars;
            std::thread::sleep(Duration::from_millis(1 + place % 7));
            let mut state = state.lock().unwrap();
            if ratio > 1.05 * state.dearest.max(1.0) {
                state.dearest = ratio;
                state.excess += state.in_flight;
            }
            state.in_flight -= dollars;
            state.charged += dollars;
            vendor(dollars)
        }
    });
    let called = call(&bench, &mock, &format!("--max-cost {limit} --concurrency {concurrency}"));
    let state = state.lock().unwrap();
    let over = state.charged - limit;
    assert!(matches!(called.code, Some(0 | 3)), "seed {seed}: {called:?}");
    if over > 1e-6 {
        let told = on_one_line(&called.stderr);
        assert!(
            told.contains("more than the") && told.contains("charged more than the price table: m ("),
            "seed {seed}: {told}"
        );
    }
    if factor > 1.06 && !varies {
        assert!(called.stderr.contains("as its server"), "seed {seed}: {called:?}");
    }
    (over, state.excess)
}

#[test]
fn a_limit_holds_against_dear_servers() {
    for seed in 1..=6 {
        let (over, excess) = simulate(seed);
        assert!(over <= excess + 1e-6, "seed {seed}: {over} over, {excess} in flight");
    }
}

/// The long form: some minutes.
#[test]
#[ignore = "slow"]
#[expect(clippy::print_stdout, reason = "the result of the simulation")]
fn a_limit_holds_against_200_dear_servers() {
    let (mut over, mut largest) = (0, 0.0_f64);
    for seed in 1..=200 {
        let (dollars, excess) = simulate(seed);
        assert!(dollars <= excess + 1e-6, "seed {seed}: {dollars} over, {excess} in flight");
        over += usize::from(dollars > 1e-6);
        largest = largest.max(dollars);
    }
    println!("{over} of 200 runs over the limit, by ${largest:.2} at most");
}
