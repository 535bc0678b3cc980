//! What a run would cost, what it has cost, and where it stops.
#[cfg(unix)]
use std::process::Stdio;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use serde_json::{Value, json};

use crate::support::endpoint::{Answer, MockEndpoint};
#[cfg(unix)]
use crate::support::process::{signal, wait_until};
use crate::support::run::{Bench, Called, model_args, records, words};
use crate::support::snapshot::{lines_with, on_one_line, redacted};
use crate::support::table::{check_rows, check_rows_at_once};

const PRICES: &str =
    "as-of = \"2026-01-01\"\nbatch = 0.5\n[models]\nm = { input = 1000, output = 0, image-tokens = 70 }\n";

/// The arguments of every run here, and more of them.
fn args<'a>(base: &'a str, more: &'a str) -> Vec<&'a str> {
    [model_args(base, "--data set.jsonl --levels L0"), words(more)].concat()
}

#[test]
fn dry_run_sends_and_writes_nothing() {
    let bench = Bench::with_questions(3);
    let mock = MockEndpoint::start([Answer::text("C")]);
    let base = mock.base_url();
    let dry = args(&base, "--out run --dry-run");
    let table = bench.complete(&dry);
    insta::assert_snapshot!(lines_with(&table, "trials"), @"Nothing was sent. 3 of 3 trials are left to ask.");
    insta::assert_snapshot!(lines_with(&table, "unknown"), @"
     m              3           112        unknown     12 – 3,072   unknown
    unknown: state the price of a model and its image-tokens in a table of --prices FILE
    ");
    assert!(mock.requests().is_empty());
    assert!(!bench.path("run").exists());

    bench.file("prices.toml", PRICES);
    let json = args(&base, "--out run --dry-run --prices prices.toml --json");
    let estimate: Value = serde_json::from_str(&bench.complete(&json)).unwrap();
    let line = &estimate["lines"][0];
    assert_eq!((&line["requests"], &line["image_tokens"]), (&3.into(), &210.0.into()));
    let (text, dollars) = (line["text_tokens"].as_f64().unwrap(), line["dollars"].as_f64().unwrap());
    assert!((dollars - (text + 210.0) / 1000.0).abs() < 1e-9, "{estimate}");

    // What is answered is not counted again.
    bench.complete(&args(&base, "--out run --limit 3"));
    let table = bench.complete(&args(&base, "--out run --limit 3 --dry-run"));
    insta::assert_snapshot!(redacted(&table), @"
    Nothing was sent. 0 of 3 trials are left to ask.
    power: 3 questions detects no difference between two conditions; 5 points need about 794 questions (one model;
        level 3.33 % after correction; assumed: 20 % of answers change without an effect, correlation 0.05 in a
        question)
    only 1 frame (8 are needed): intervals and tests would be rough
    ");
}

#[test]
fn budget_stops_run_until_raised() {
    let bench = Bench::with_questions(12);
    bench.file("prices.toml", PRICES);
    // 90 tokens of prompt and 1 of reply: 9 cents each.
    let mock = MockEndpoint::start([Answer::text("C")]);
    let base = mock.base_url();
    let call = |most: &str| {
        let more = format!("--out run --prices prices.toml --max-cost {most}");
        bench.call(&args(&base, &more))
    };
    let stopped = call("0.5");
    insta::assert_snapshot!(stopped.messages(), @"
    exit code: 3
     WARN stopped: one more question could exceed the $0.5000 of --max-cost; the same command with a higher limit
        continues
    ");
    insta::assert_snapshot!(stopped.lines_with("over budget"), @"
    exit code: 3
    ! run: over budget: 5 of 12 trials answered, 0 failed. The same command asks the
    ");
    let again = call("0.5");
    assert_eq!((again.code, mock.requests().len()), (Some(3), 5), "nothing is asked beyond it");
    let on = call("2");
    assert_eq!((on.code, mock.requests().len()), (Some(0), 12), "{on:?}");
    assert_eq!(records(&bench.path("run")).len(), 12);
}

#[test]
fn a_limit_needs_a_price() {
    let bench = Bench::with_questions(1);
    let refused = bench.call(&args("http://127.0.0.1:9/v1", "--max-cost 1"));
    insta::assert_snapshot!(refused.messages(), @"
    exit code: 2
    error: --max-cost: the price of m is not in the table of [DATE]; add it to your own table and name that with
        --prices FILE, or set price in a file of models
    ");
    check_rows(["0", "-1", "NaN"], |wrong| {
        let flag = format!("--max-cost={wrong}");
        assert_eq!(bench.call(&args("http://127.0.0.1:9/v1", &flag)).code, Some(2));
    });
}

#[test]
fn oversized_image_is_found_early() {
    let bench = Bench::with_questions(2);
    let mock = MockEndpoint::start([Answer::text("C")]);
    let base = mock.base_url();
    let refused = bench.call(&args(&base, "--max-image 0.00005"));
    insta::assert_snapshot!(refused.messages(), @"
    exit code: 2
    error: frame a.png at L0: 64 × 48 pixels are 0.0 MB as png, more than the 0.00005 MB of --image max-mb; make
        it smaller with --image max-side=N, or with --image jpeg:95, or set another limit with --image max-mb
    ");
    assert!(mock.requests().is_empty());
}

#[test]
fn charged_prompts_correct_estimate() {
    let bench = Bench::with_questions(20);
    bench.file("prices.toml", PRICES);
    let mock = MockEndpoint::start([Answer::message_charged("C", 900)]);
    let base = mock.base_url();
    let line = |more: &str| {
        let more = format!("--out run --prices prices.toml --dry-run --json {more}");
        let printed = bench.complete(&args(&base, &more));
        let estimate: Value = serde_json::from_str(&printed).unwrap();
        estimate["lines"][0].clone()
    };
    // By the table of prices: 70 tokens each.
    assert_eq!(line("")["image_tokens"], 1400.0);
    let ask = |more: &str| {
        let more = format!("--out run --prices prices.toml {more}");
        bench.call(&args(&base, &more))
    };
    // Nine replies are too few to say anything.
    let nine = ask("--limit 9");
    assert_eq!(nine.code, Some(0), "{nine:?}");
    assert!(!nine.stderr.contains("were estimated"), "{nine:?}");
    assert!(line("").get("charged_image_tokens").is_none());
    let bench_of_ten = Bench::with_questions(15);
    bench_of_ten.file("prices.toml", PRICES);
    let more = "--out run --prices prices.toml";
    let fifteen = bench_of_ten.call(&args(&base, more));
    let said = "m: a prompt is charged 900 tokens, where";
    assert_eq!(fifteen.stderr.matches(said).count(), 1, "{fifteen:?}");
    // From ten on, the rest is estimated by what is charged.
    ask("--limit 10");
    let corrected = line("");
    let each = corrected["charged_image_tokens"].as_f64().unwrap();
    let text = corrected["text_tokens"].as_f64().unwrap() / 10.0;
    assert!((each + text - 900.0).abs() < 2.0, "{corrected}");
    let images = corrected["image_tokens"].as_f64().unwrap();
    assert!((images - 10.0 * each).abs() < 1e-6, "{corrected}");
    // Where the estimate is right, nothing is said.
    let right = PRICES.replace("70", &format!("{each:.0}"));
    bench_of_ten.file("prices.toml", right);
    let more = "--out right --prices prices.toml";
    let quiet = bench_of_ten.call(&args(&base, more));
    assert_eq!((quiet.code, quiet.stderr.as_str()), (Some(0), ""));
}

/// Prices of a short prompt and a long reply: 100 tokens of prompt and 1024 of reply cost $0.1025.
const DEAR: &str =
    "as-of = \"2026-01-01\"\nbatch = 0.5\n[models]\nm = { input = 1, output = 100, image-tokens = 80 }\n";

/// The tokens of a reply at [`DEAR`], in dollars.
fn dollars(replies: u64) -> f64 {
    (100 + replies * 100) as f64 / 1e6
}

/// A reply charged `tokens` tokens; `usage` changes the stated counts.
fn charged(tokens: u64, usage: &Value) -> Answer {
    let mut body = json!({
        "choices": [{"message": {"content": "C"}, "finish_reason": "stop"}],
        "usage": {"prompt_tokens": 100, "completion_tokens": tokens},
    });
    if let Some(other) = usage.as_object() {
        body["usage"] = other.clone().into();
    }
    Answer::json(200, &body)
}

/// Answers by their number, each with the tokens of its reply that are charged. The cost of all so far comes with them.
fn counting(answer: impl Fn(u64) -> (Answer, u64) + Send + Sync + 'static) -> (MockEndpoint, Arc<Mutex<f64>>) {
    let cost = Arc::new(Mutex::new(0.0));
    let number = AtomicU64::new(0);
    let mock = MockEndpoint::answering({
        let cost = Arc::clone(&cost);
        move |_| {
            let (answer, tokens) = answer(number.fetch_add(1, Ordering::SeqCst));
            *cost.lock().unwrap() += dollars(tokens);
            std::thread::sleep(Duration::from_millis(20));
            answer
        }
    });
    (mock, cost)
}

/// A run with a limit, and the cost of all its requests.
fn limited(bench: &Bench, mock: &MockEndpoint, cost: &Mutex<f64>, (limit, more): (f64, &str)) -> (Called, f64) {
    bench.file("prices.toml", DEAR);
    let base = mock.base_url();
    let line = format!("--out run --prices prices.toml --max-cost {limit} {more}");
    let called = bench.call(&args(&base, &line));
    let cost = *cost.lock().unwrap();
    (called, cost)
}

/// Silent charges of a server, with short and long replies in any order.
#[test]
fn limit_holds_whatever_is_charged_for() {
    type Answers = fn(u64) -> (Answer, u64);
    let rows: [(&str, Answers, f64); 9] = [
        (
            "a short reply before long ones",
            |i| {
                let tokens = if i == 0 { 1 } else { 1024 };
                (charged(tokens, &Value::Null), tokens)
            },
            0.8,
        ),
        (
            "no choices",
            |i| {
                if i % 2 == 0 {
                    (charged(1, &Value::Null), 1)
                } else {
                    let usage = json!({"prompt_tokens": 100, "completion_tokens": 1000});
                    (Answer::json(200, &json!({"choices": [], "usage": usage})), 1000)
                }
            },
            0.6,
        ),
        ("no tokens stated", |_| (charged(1024, &json!({})), 1024), 0.8),
        (
            "zero tokens stated",
            |_| {
                let zero = json!({"prompt_tokens": 0, "completion_tokens": 0, "total_tokens": 0});
                (charged(1024, &zero), 1024)
            },
            0.8,
        ),
        ("only the prompt stated", |_| (charged(1024, &json!({"prompt_tokens": 100})), 1024), 0.8),
        (
            "an error after the work",
            |i| match i % 3 {
                0 => (Answer::error(500, "x", "oops"), 1024),
                _ => (charged(1024, &Value::Null), 1024),
            },
            0.8,
        ),
        (
            "a cut reply",
            |i| match i % 3 {
                0 => (charged(1024, &Value::Null).cut(20), 1024),
                _ => (charged(1024, &Value::Null), 1024),
            },
            0.8,
        ),
        (
            "a time-out",
            |i| match i % 3 {
                1 => (Answer::silent(), 1024),
                _ => (charged(1024, &Value::Null), 1024),
            },
            0.8,
        ),
        (
            "an error that states its charge",
            |i| {
                if i % 2 == 0 {
                    (charged(1, &Value::Null), 1)
                } else {
                    let usage = json!({"prompt_tokens": 100, "completion_tokens": 1000});
                    let error = json!({"error": {"message": "no"}, "usage": usage});
                    (Answer::json(500, &error), 1000)
                }
            },
            0.6,
        ),
    ];
    check_rows_at_once(rows, |(case, answers, used)| {
        let bench = Bench::with_questions(40);
        let (mock, cost) = counting(answers);
        let more = "--concurrency 16 --timeout 0.7";
        let mut last = 0.0;
        for _ in 0..3 {
            // The same command again asks nothing more.
            let (called, cost) = limited(&bench, &mock, &cost, (0.75, more));
            assert_eq!(called.code, Some(3), "{case}: {called:?}");
            assert!(cost <= 0.75 + 1e-9, "{case}: {cost}: {called:?}");
            assert!(cost >= 0.75 * used, "{case}: only {cost}");
            last = cost;
        }
        let (called, cost) = limited(&bench, &mock, &cost, (1.2, more));
        assert!(cost > last && cost <= 1.2 + 1e-9, "{case}: {cost}: {called:?}");
    });
}

/// A refusal is not charged, and takes nothing of the limit.
#[test]
fn refusals_cost_nothing() {
    let bench = Bench::with_questions(12);
    let (mock, cost) = counting(|i| match i % 2 {
        0 => (Answer::error(429, "rate_limit_exceeded", "slow down").header("retry-after", "0"), 0),
        _ => (charged(1, &Value::Null), 1),
    });
    let (called, _) = limited(&bench, &mock, &cost, (0.11, "--concurrency 4"));
    assert_eq!(called.code, Some(0), "{called:?}");
    assert_eq!(records(&bench.path("run")).len(), 12);
}

/// A server that charges more than the token limit, once it is seen, exceeds the limit by the requests in flight at
/// most.
#[test]
fn replies_beyond_their_limit_are_said() {
    let bench = Bench::with_questions(40);
    let (mock, cost) = counting(|i| {
        let tokens = if i < 2 { 1 } else { 5000 };
        (charged(tokens, &Value::Null), tokens)
    });
    let (called, cost) = limited(&bench, &mock, &cost, (0.75, "--concurrency 16"));
    assert_eq!(called.code, Some(3), "{called:?}");
    // Seven of up to $0.1026 fit at once.
    assert!(cost <= 7.0 * dollars(5000) + 0.001, "{cost}");
    assert!(called.stderr.contains("more than its limit of 1024"), "{called:?}");
    let requests = mock.requests().len() as u64;
    let sentence = format!("than --max-tokens: m ({})", requests - 2);
    for text in [&called.stderr, &called.stdout] {
        let text = on_one_line(text);
        assert!(text.contains(&sentence), "{sentence}: {called:?}");
    }
    // The same command asks nothing more.
    let (again, _) = limited(&bench, &mock, &Mutex::new(0.0), (0.75, ""));
    assert_eq!((again.code, mock.requests().len() as u64), (Some(3), requests));
}

/// Without a token limit the cost has no bound, which is said before anything is sent.
#[test]
fn cost_limit_needs_token_limit() {
    for more in [
        "--token-field none",
        "--extra-body {\"google\":{\"thinking_config\":{\"thinking_budget\":-1}}}",
        "--omit-field max_tokens",
    ] {
        let bench = Bench::with_questions(3);
        let (mock, cost) = counting(|_| (charged(1, &Value::Null), 1));
        let (called, _) = limited(&bench, &mock, &cost, (1.0, more));
        assert_eq!(called.code, Some(0), "{called:?}");
        let said = "m: no token limit holds";
        assert_eq!(called.stderr.matches(said).count(), 1, "{more}: {called:?}");
    }
    let bench = Bench::with_questions(3);
    let (mock, cost) = counting(|_| (charged(1, &Value::Null), 1));
    let (called, _) = limited(&bench, &mock, &cost, (1.0, ""));
    assert_eq!((called.code, called.stderr.as_str()), (Some(0), ""));
}

/// Requests that are given up while they are in flight may be charged; the next command counts them.
#[cfg(unix)]
#[test]
fn requests_that_are_given_up_count() {
    let bench = Bench::with_questions(40);
    bench.file("prices.toml", DEAR);
    let (mock, cost) = counting(|i| match i {
        0 => (charged(1, &Value::Null), 1),
        _ => (Answer::silent(), 1024),
    });
    let base = mock.base_url();
    let line = "--out run --prices prices.toml --max-cost 0.75 --concurrency 4 --timeout 60 --grace 0.1";
    let mut first = bench.spawn(&args(&base, line), Stdio::null());
    wait_until(|| mock.requests().len() == 5);
    signal(&first, "-INT");
    assert_eq!(first.wait().unwrap().code(), Some(130));
    let (again, cost) = limited(&bench, &mock, &cost, (0.75, "--concurrency 16 --timeout 0.5 --retries 0"));
    assert!(cost <= 0.75, "{cost}: {again:?}");
}

/// A file of models with one model at this endpoint, which charges $1 for 1,000 tokens of a prompt or 100 of a reply.
fn priced(bench: &Bench, mock: &MockEndpoint) {
    let table = format!(
        "[[model]]\nid = \"m\"\nendpoints = [\"{}\"]\nkey-env = \"none\"\nprice = {{ input = 1000, output = 10000 }}\n",
        mock.base_url()
    );
    bench.file("models.toml", table);
}

const PRICED: &str = "--models models.toml --data set.jsonl --levels L0 --out run --concurrency 1";

/// A reply that is charged as a vendor states it.
fn billed(usage: &Value) -> Answer {
    let message = json!({"role": "assistant", "content": "C"});
    let choice = json!({"index": 0, "message": message, "finish_reason": "stop"});
    Answer::json(200, &json!({"model": "m", "choices": [choice], "usage": usage}))
}

#[test]
fn bill_is_that_of_vendors() {
    // By hand, in dollars: the tokens of the prompt by 1,000 and those of the reply by 100.
    let vendors = [
        // OpenAI: reasoning within the reply.
        (
            json!({"prompt_tokens": 1000, "completion_tokens": 600, "total_tokens": 1600,
                "completion_tokens_details": {"reasoning_tokens": 512}}),
            1.0 + 6.0,
        ),
        // xAI: reasoning outside the reply.
        (
            json!({"prompt_tokens": 1000, "completion_tokens": 100, "total_tokens": 6100,
                "completion_tokens_details": {"reasoning_tokens": 5000}}),
            1.0 + 51.0,
        ),
        // Gemini: reasoning in the total alone.
        (json!({"prompt_tokens": 1000, "completion_tokens": 5, "total_tokens": 1805}), 1.0 + 8.05),
        // Perplexity: reasoning beside both.
        (
            json!({"prompt_tokens": 1000, "completion_tokens": 30, "total_tokens": 1030, "reasoning_tokens": 400}),
            1.0 + 4.3,
        ),
        // DeepSeek: what the cache had is in the prompt.
        (
            json!({"prompt_tokens": 1000, "completion_tokens": 9, "total_tokens": 1009,
                "prompt_cache_hit_tokens": 900, "prompt_cache_miss_tokens": 100}),
            1.0 + 0.09,
        ),
        // Anthropic behind a gateway: what the cache had is outside the prompt.
        (
            json!({"prompt_tokens": 100, "completion_tokens": 10, "total_tokens": 1010, "cache_read_input_tokens": 900}),
            1.0 + 0.1,
        ),
        // A gateway that writes texts and fractions.
        (json!({"prompt_tokens": "1000", "completion_tokens": 20.0, "total_tokens": " 1060.5 "}), 1.0 + 0.61),
    ];
    let bench = Bench::with_questions(vendors.len());
    let mock = MockEndpoint::start(vendors.iter().map(|(usage, _)| billed(usage)));
    priced(&bench, &mock);
    bench.complete(&words(PRICED));
    let by_hand: f64 = vendors.iter().map(|(_, dollars)| dollars).sum();
    assert!((by_hand - 77.15).abs() < 1e-9);
    let page = std::fs::read_to_string(bench.path("run/report.html")).unwrap();
    assert!(page.contains("$77.15 at the prices of the models file"), "{by_hand}");
    let mut all = records(&bench.path("run"));
    all.sort_by_key(|record| record["question"].to_string());
    let totals: Vec<&Value> = all.iter().map(|record| &record["usage"]["total_tokens"]).collect();
    assert_eq!(totals[1], 6100, "the record keeps the stated total");
    // What is paid counts against the limit of the next call.
    let over = bench.call(&words(&format!("{PRICED} --limit 7 --max-cost 77 --repeats 2")));
    assert_eq!((over.code, mock.requests().len()), (Some(3), 7), "{over:?}");
}

#[test]
fn report_counts_cost_of_failures() {
    let bench = Bench::with_questions(1);
    let usage = json!({"prompt_tokens": 1000, "completion_tokens": 100});
    let empty = Answer::json(200, &json!({"model": "m", "choices": [], "usage": usage}));
    let reply = billed(&json!({"prompt_tokens": 500, "completion_tokens": 10}));
    let mock = MockEndpoint::start([empty, reply]);
    priced(&bench, &mock);
    bench.complete(&words(PRICED));
    let page = std::fs::read_to_string(bench.path("run/report.html")).unwrap();
    let cost = page.split("at the prices of the models file").next().unwrap();
    assert!(cost.ends_with("$2.60 "), "{}", &cost[cost.len() - 60..]);
    assert!(page.contains(", $2.00 of it for 1 attempt without a usable reply"));
}

#[test]
fn report_has_prices_that_run_had() {
    let bench = Bench::with_questions(1);
    let usage = json!({"prompt_tokens": 1000, "completion_tokens": 100});
    let mock = MockEndpoint::start([billed(&usage)]);
    bench.file("prices.toml", PRICES);
    let base = mock.base_url();
    let cost = || {
        let page = std::fs::read_to_string(bench.path("run/report.html")).unwrap();
        let (before, _) = page.split_once(" of --prices").unwrap();
        before[before.len() - 40..].to_owned()
    };
    let printed = bench.complete(&args(&base, "--out run --prices prices.toml"));
    insta::assert_snapshot!(redacted(&printed), @"
    m · 1 question · 1 frame · 1 reply, 0 failed · intervals by question
    ! Only 1 question (8 are needed): wide intervals, few possible verdicts.

     accuracy in %
     m            L0   95 %
     untouched 100.0   −79.3 0.0
     95 %: how far the widest interval of the row reaches down and up
     chance 33.3
    run: run
    cost: $1.00 at the prices of [DATE] of --prices
    report: run/report.html
    ");
    let stated = cost();
    assert!(stated.ends_with("$1.00 at the prices of 2026-01-01"), "{stated}");
    // Made again from the folder alone, without the file of prices.
    std::fs::remove_file(bench.path("prices.toml")).unwrap();
    bench.complete(&words("report run"));
    assert_eq!(cost(), stated);
    // The same run goes on with these prices, and says so where they are a limit.
    let limited = bench.call(&args(&base, "--out run --max-cost 5"));
    assert_eq!(limited.code, Some(0), "{limited:?}");
    insta::assert_snapshot!(limited.messages(), @"
    exit code: 0
     WARN --max-cost counts with the prices that the run folder keeps; --prices FILE names others
    ");
    assert_eq!(cost(), stated);
}
