//! What a run would cost, what it has cost, and where it stops.
use crate::support::endpoint::{Answer, MockEndpoint};
use crate::support::run::{Bench, model_args, records, words};
use crate::support::table::check_rows;
use serde_json::Value;

const PRICES: &str = "as-of = \"2026-01-01\"\nbatch = 0.5\n[models]\nm = { input = 1000, output = 0, image-tokens = 70 }\n";

/// The arguments of every run here, and more of them.
fn args<'a>(base: &'a str, more: &'a str) -> Vec<&'a str> {
    [
        model_args(base, "--data set.jsonl --levels L0"),
        words(more),
    ]
    .concat()
}

#[test]
fn a_dry_run_sends_nothing_and_leaves_nothing() {
    let bench = Bench::with_questions(3);
    let mock = MockEndpoint::start([Answer::text("C")]);
    let base = mock.base_url();
    let dry = args(&base, "--out run --dry-run");
    let table = bench.complete(&dry);
    assert!(table.contains("3 of 3 trials are left to ask"), "{table}");
    assert!(table.contains("unknown"), "no price, no family: {table}");
    assert!(mock.requests().is_empty());
    assert!(!bench.path("run").exists());

    bench.file("prices.toml", PRICES);
    let json = args(&base, "--out run --dry-run --prices prices.toml --json");
    let estimate: Value = serde_json::from_str(&bench.complete(&json)).unwrap();
    let line = &estimate["lines"][0];
    assert_eq!(
        (&line["requests"], &line["image_tokens"]),
        (&3.into(), &210.0.into())
    );
    let (text, dollars) = (
        line["text_tokens"].as_f64().unwrap(),
        line["dollars"].as_f64().unwrap(),
    );
    assert!(
        (dollars - (text + 210.0) / 1000.0).abs() < 1e-9,
        "{estimate}"
    );

    // What is answered is not counted again.
    bench.complete(&args(&base, "--out run --limit 3"));
    let table = bench.complete(&args(&base, "--out run --limit 3 --dry-run"));
    assert!(table.contains("0 of 3 trials are left to ask"), "{table}");
}

#[test]
fn a_run_stops_before_it_costs_too_much_and_goes_on_with_more() {
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
    assert_eq!(stopped.code, Some(3), "{stopped:?}");
    assert!(stopped.stderr.contains("--max-cost"), "{stopped:?}");
    assert!(
        stopped
            .stdout
            .contains("over budget: 5 of 12 trials answered"),
        "{}",
        stopped.stdout
    );
    let again = call("0.5");
    assert_eq!(
        (again.code, mock.requests().len()),
        (Some(3), 5),
        "nothing is asked beyond it"
    );
    let on = call("2");
    assert_eq!((on.code, mock.requests().len()), (Some(0), 12), "{on:?}");
    assert_eq!(records(&bench.path("run")).len(), 12);
}

#[test]
fn a_limit_needs_a_price() {
    let bench = Bench::with_questions(1);
    let refused = bench.call(&args("http://127.0.0.1:9/v1", "--max-cost 1"));
    assert_eq!(refused.code, Some(2));
    assert!(refused.stderr.contains("--prices FILE"), "{refused:?}");
    check_rows(["0", "-1", "NaN"], |wrong| {
        let flag = format!("--max-cost={wrong}");
        assert_eq!(
            bench.call(&args("http://127.0.0.1:9/v1", &flag)).code,
            Some(2)
        );
    });
}

#[test]
fn an_image_beyond_the_limit_is_found_before_anything_is_asked() {
    let bench = Bench::with_questions(2);
    let mock = MockEndpoint::start([Answer::text("C")]);
    let base = mock.base_url();
    let refused = bench.call(&args(&base, "--max-image 0.00005"));
    assert_eq!(refused.code, Some(2), "{refused:?}");
    assert!(
        refused.stderr.contains("frame") && refused.stderr.contains("--max-side"),
        "{refused:?}"
    );
    assert!(mock.requests().is_empty());
}

#[test]
fn the_estimate_is_corrected_by_what_prompts_are_charged() {
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
