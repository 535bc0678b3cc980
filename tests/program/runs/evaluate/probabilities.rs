//! Probabilities of choices: what is asked, and what is kept of what servers state.

use crate::support::endpoint::{Answer, MockEndpoint, Request};
use crate::support::run::{Bench, model_args, records, words};
use crate::support::snapshot::redacted;
use crate::support::table::check_rows;
use serde_json::{Value, json};

use super::text;

const ASKED: &str = "--data set.jsonl --levels L0 --out run --probabilities";

/// A completion with these probabilities of the letters at its only position.
fn likely(text: &str, letters: &[(&str, f64)]) -> Value {
    let top: Vec<Value> = letters
        .iter()
        .map(|(token, p)| json!({"token": token, "logprob": p.ln(), "bytes": token.as_bytes()}))
        .collect();
    let mut position = top[0].clone();
    position["top_logprobs"] = json!(top);
    json!({
        "model": "mock-1",
        "choices": [{"index": 0, "finish_reason": "stop", "message": {"role": "assistant", "content": text},
            "logprobs": {"content": [position], "refusal": null}}],
        "usage": {"prompt_tokens": 90, "completion_tokens": 1},
    })
}

fn sure() -> Value {
    likely("C", &[("C", 0.6), (" C", 0.1), ("A", 0.2), ("The", 0.05)])
}

fn kept(mock: &MockEndpoint, args: &str) -> Vec<Value> {
    let bench = Bench::with_questions(3);
    bench.complete(&model_args(&mock.base_url(), args));
    records(&bench.path("run"))
}

#[test]
fn probability_of_each_choice_is_kept() {
    let mock = MockEndpoint::start([Answer::json(200, &sure())]);
    for record in kept(&mock, ASKED) {
        let options = &record["options"];
        let p: Vec<f64> = serde_json::from_value(options["p"].clone()).unwrap();
        for (p, expected) in p.iter().zip([2.0 / 9.0, 0.0, 7.0 / 9.0]) {
            assert!((p - expected).abs() < 2e-6, "{options}");
        }
        assert!((options["mass"].as_f64().unwrap() - 0.9).abs() < 2e-6);
        assert!((options["bound"].as_f64().unwrap() - 0.05).abs() < 2e-6);
        assert_eq!(options["token"], "C");
        assert_eq!(options.get("reasoned"), None);
        assert_eq!(text(&record, "outcome"), "right");
    }
    for request in mock.requests() {
        let body = request.json();
        assert_eq!((&body["logprobs"], &body["top_logprobs"]), (&json!(true), &json!(20)));
    }
    // Without the flag nothing is asked, and what a server states is not kept.
    let mock = MockEndpoint::start([Answer::text("C")]);
    for record in kept(&mock, &ASKED.replace(" --probabilities", "")) {
        assert_eq!(record.get("options"), None);
    }
    assert_eq!(mock.requests()[0].json().get("logprobs"), None);
}

/// Replies that say nothing of the choices: the answer is read as ever.
#[test]
fn unstated_probabilities_are_not_invented() {
    let without = |logprobs: Value| {
        let mut body = sure();
        body["choices"][0]["logprobs"] = logprobs;
        body
    };
    let rows = [
        without(Value::Null),
        without(json!({})),
        without(json!({"content": []})),
        // Most of the probability is on words that name no choice.
        likely("C", &[("C", 0.4), ("The", 0.5)]),
    ];
    check_rows(rows, |body| {
        let mock = MockEndpoint::start([Answer::json(200, &body)]);
        for record in kept(&mock, ASKED) {
            assert_eq!(record.get("options"), None, "{body}");
            assert_eq!(text(&record, "outcome"), "right");
        }
    });
    let mut thought = sure();
    thought["usage"]["completion_tokens_details"] = json!({"reasoning_tokens": 64});
    let mock = MockEndpoint::start([Answer::json(200, &thought)]);
    for record in kept(&mock, ASKED) {
        assert_eq!(record["options"]["reasoned"], true);
    }
}

#[test]
fn probabilities_are_dropped_if_unsupported() {
    let mock = MockEndpoint::answering(|body| match body.get("logprobs") {
        Some(_) => Answer::error(400, "400", "Logprobs is not enabled for models/gemini-3-flash"),
        None => Answer::text("C"),
    });
    assert!(kept(&mock, ASKED).iter().all(|record| record["reply"] == "C"));
    assert_eq!(mock.requests().len(), 4);
    // One that states fewer is asked for fewer.
    let mock = MockEndpoint::answering(|body| match body["top_logprobs"].as_u64() {
        Some(6..) => Answer::error(422, "validation", "top_logprobs must be at most 5"),
        _ => Answer::json(200, &sure()),
    });
    assert!(kept(&mock, ASKED).iter().all(|record| record["options"].is_object()));
    assert_eq!(mock.requests().len(), 4);
}

/// The true choice is always named, with 7/9 of the probability.
#[test]
fn the_report_sets_confidence_against_accuracy() {
    let bench = Bench::with_questions(120);
    let mock = MockEndpoint::start([Answer::json(200, &sure())]);
    let asked = format!("{ASKED} --full").replace("L0", "L0,L3");
    let printed = bench.complete(&model_args(&mock.base_url(), &asked));
    assert!(printed.contains("Confidence (mean greatest probability"), "{printed}");
    let table = std::fs::read_to_string(bench.path("run/calibration.csv")).unwrap();
    let mut lines = table.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let head = lines.next().unwrap();
    let rows: Vec<Vec<&str>> = lines.collect();
    // L0, and L3 by exposure drop alone and with noise.
    assert_eq!(rows.len(), 3, "{table}");
    for row in rows {
        let number = |name: &str| -> f64 {
            let place = head.iter().position(|known| *known == name).unwrap();
            row[place].parse().unwrap()
        };
        let gap = 7.0 / 9.0 - 1.0;
        for (name, expected) in [
            ("replies", 120.0),
            ("reasoned", 0.0),
            ("unstated", 0.0),
            ("confidence", 7.0 / 9.0),
            ("accuracy", 1.0),
            ("overconfidence", gap),
            ("ece", -gap),
            ("brier", 2.0 * gap * gap),
            ("risk_100", 0.0),
        ] {
            assert!((number(name) - expected).abs() < 1e-4, "{name}: {row:?}");
        }
    }
    let page = std::fs::read_to_string(bench.path("run/report.html")).unwrap();
    assert!(page.contains("Confidence against accuracy"));
    assert!(bench.path("run/figures/confidence.svg").exists());
    // All replies are equally confident: one bin a condition.
    let bins = std::fs::read_to_string(bench.path("run/reliability.csv")).unwrap();
    let mut lines = bins.lines();
    let head: Vec<&str> = lines.next().unwrap().split(',').collect();
    let place = |name: &str| head.iter().position(|known| *known == name).unwrap();
    let lines: Vec<Vec<&str>> = lines.map(|line| line.split(',').collect()).collect();
    assert_eq!(lines.len(), 3, "{bins}");
    for line in lines {
        let number = |name: &str| line[place(name)].parse::<f64>().unwrap();
        assert!((number("confidence") - 7.0 / 9.0).abs() < 1e-4, "{bins}");
        for (name, expected) in [("bin", 1.0), ("accuracy", 1.0), ("n", 120.0)] {
            assert!((number(name) - expected).abs() < 1e-9, "{name}: {bins}");
        }
    }
    let figure = std::fs::read_to_string(bench.path("run/figures/reliability.svg")).unwrap();
    assert!(figure.contains(">confidence in %</text>") && page.contains("Is a model as often right"));
    let not_shown = "m was not detected to be surer than it is right at L3: its mean confidence is 77.8 %, and 100.0 % of its replies";
    let said = |bench: &Bench| std::fs::read_to_string(bench.path("run/summary.json")).unwrap();
    assert!(said(&bench).contains(not_shown), "{printed}");
    // One that is as sure, and wrong, in the light as in the dark.
    let bench = Bench::with_questions(120);
    let wrong = likely("A", &[("A", 0.6), (" A", 0.1), ("C", 0.2), ("The", 0.05)]);
    let mock = MockEndpoint::start([Answer::json(200, &wrong)]);
    bench.complete(&model_args(&mock.base_url(), &asked));
    let surer = "At L3 m is surer than it is right: its mean confidence is 77.8 %, and 0.0 % of its replies are right.";
    assert!(said(&bench).contains(surer), "{}", said(&bench));
    // A server that states none: said, and no table of it.
    let bench = Bench::with_questions(3);
    let mock = MockEndpoint::start([Answer::text("C")]);
    let printed = bench.complete(&model_args(&mock.base_url(), ASKED));
    insta::assert_snapshot!(redacted(&printed), @"
    m · 3 questions · 1 frame · 3 replies, 0 failed · intervals by question
    ! Only 3 questions (8 are needed): wide intervals, few possible verdicts.
    ! The confidence of m is not available: its server states no probabilities of
      tokens, or its replies do not begin with a choice.

     accuracy in %
     m            L0   95 %
     untouched 100.0   −56.1 0.0
     95 %: how far the widest interval of the row reaches down and up
     chance 33.3
    run: run
    report: run/report.html
    ");
    assert!(!bench.path("run/calibration.csv").exists());
    for figure in ["confidence", "reliability"] {
        assert!(!bench.path(&format!("run/figures/{figure}.svg")).exists());
    }
    assert!(!bench.path("run/reliability.csv").exists());
}

#[test]
fn probabilities_need_a_temperature_of_zero() {
    let bench = Bench::with_questions(3);
    let mock = MockEndpoint::start([Answer::text("C")]);
    let base = mock.base_url();
    let args = model_args(&base, ASKED);
    let called = bench.call(&[args.clone(), words("--temperature 0.5")].concat());
    insta::assert_snapshot!(called.messages(), @"
    exit code: 2
    error: --request probabilities: the probabilities of tokens depend on the temperature: --temperature 0, auto
        or default expected
    ");
    assert!(mock.requests().is_empty());
    bench.complete(&[args, words("--temperature 0")].concat());
}

/// The words follow the image; a model that is shown none is asked as ever.
#[test]
fn the_image_may_stand_first() {
    let mock = MockEndpoint::start([Answer::text("C")]);
    let asked = "--data set.jsonl --levels L0 --blind-model m --out run";
    let sorted = |args: &str| {
        let mut records = kept(&mock, args);
        records.sort_by_key(|record| (record["view"].to_string(), record["question"].to_string()));
        records
    };
    let last = sorted(asked);
    let first = sorted(&format!("{asked} --image-first"));
    let requests: Vec<Value> = mock.requests().iter().map(Request::json).collect();
    let kinds = |body: &Value| -> Vec<String> {
        let parts = body["messages"][0]["content"].as_array();
        parts.into_iter().flatten().map(|part| text(part, "type").to_owned()).collect()
    };
    let shown: Vec<Vec<String>> = requests.iter().map(kinds).filter(|kinds| !kinds.is_empty()).collect();
    assert_eq!(shown[..3], vec![["text", "image_url"].map(str::to_owned).to_vec(); 3]);
    assert_eq!(shown[3..], vec![["image_url", "text"].map(str::to_owned).to_vec(); 3]);
    for (last, first) in last.iter().zip(&first) {
        let same = text(last, "view") == "blind";
        assert_eq!(last["key"] == first["key"], same, "{first}");
    }
}
