//! Outputs of an evaluation: fields of a record, columns of a table, the summary as JSON.

use std::fs;

use serde_json::{Value, json};

use super::text;
use crate::support::endpoint::{Answer, MockEndpoint};
use crate::support::run::{Bench, model_args, records, words};
use crate::support::snapshot::{lines_with, on_one_line};
use crate::support::table::check_rows;

#[test]
fn record_and_row_keep_contract() {
    let bench = Bench::with_frames();
    bench.file("script.jsonl", "{\"question\":\"a1\",\"reply\":\"No.\"}\n{\"question\":\"b1\",\"condition\":\"L1-ev\",\"reply\":\"too dark to see\"}\n{\"default\":\"**A**\"}\n");
    let table = bench
        .complete(&words("--data frames --model script:script.jsonl --levels L0,L1 --variant ev --out run --full"));
    insta::assert_snapshot!(
        lines_with(&table, "(66.7)"),
        @"script:script.jsonl   untouched       33.3 (66.7)          3      2 (0)        0   −33.1 +65.4"
    );
    let records = records(&bench.path("run"));
    let record = records.iter().find(|r| text(r, "question") == "b1" && text(r, "condition") == "L1-ev").unwrap();
    let keys: Vec<&str> = record.as_object().unwrap().keys().map(String::as_str).collect();
    let rows = [
        "key",
        "question",
        "frame",
        "family",
        "model",
        "view",
        "condition",
        "level",
        "variant",
        "ev",
        "reading",
        "enhancer",
        "choices",
        "truth",
        "reply",
        "strict",
        "lenient",
        "outcome",
        "failure",
        "usage",
        "latency_ms",
        "attempts",
        "image",
    ];
    check_rows(rows, |key| {
        assert!(keys.contains(&key), "{key} of {keys:?}");
    });
    assert_eq!((text(record, "level"), text(record, "variant"), text(record, "outcome")), ("L1", "ev", "unparsed"));
    assert_eq!(record["ev"], 2.0);
    assert_eq!(record["reading"], Value::Null);
    assert_eq!(record["strict"], json!({"chosen": null, "why": "refused"}));
    assert_eq!(record["image"]["format"], "png");

    let csv = fs::read_to_string(bench.path("run/summary.csv")).unwrap();
    let mut lines = csv.lines();
    assert_eq!(
        lines.next().unwrap(),
        "model,view,level,variant,enhancer,family,mode,n,right,unparsed,failed,value,low,high,reading"
    );
    let all: Vec<&str> = lines.filter(|line| line.contains(",all,")).collect();
    // a1 is right both times; a2 and b1 say **A**, which is not strict: b1's A is right in the lenient parsing.
    assert!(all.iter().any(|line| line.contains(",L0,none,,all,strict,3,1,2,0,0.333")), "{csv}");
    assert!(all.iter().any(|line| line.contains(",L0,none,,all,lenient,3,2,0,0,0.666")), "{csv}");
    assert!(all.iter().any(|line| line.contains(",L1,ev,,all,lenient,3,1,1,0,0.333")), "{csv}");
    assert!(all.iter().any(|line| line.starts_with("chance,,,none,,all,strict,3,,0,0,0.4444")), "{csv}");
}

#[test]
fn json_is_the_summary() {
    let bench = Bench::new();
    let output = bench.complete(&words("--model random --levels L0 --json --out run"));
    let summary: Value = serde_json::from_str(&output).unwrap();
    assert_eq!(summary["run"]["status"], "complete");
    assert_eq!(summary["folder"], "run");
    let stored = fs::read(bench.path("run/summary.json")).unwrap();
    let stored: Value = serde_json::from_slice(&stored).unwrap();
    assert_eq!(summary["rows"], stored["rows"]);
}

/// A router names the provider that it passed a request on to: kept in the record, and said if there are several.
#[test]
fn router_providers_are_counted() {
    let reply = |provider: &str| {
        let message = json!({"role": "assistant", "content": "A"});
        Answer::json(
            200,
            &json!({"model": "mock-1", "provider": provider, "choices": [{"message": message, "finish_reason": "stop"}]}),
        )
    };
    for (providers, several) in [(["a", "b"], true), (["a", "a"], false)] {
        let bench = Bench::with_questions(3);
        let mock = MockEndpoint::start(providers.map(reply));
        let line = "--data set.jsonl --levels L0 --out run --full";
        let printed = bench.complete(&model_args(&mock.base_url(), line));
        let mut kept: Vec<String> =
            records(&bench.path("run")).iter().map(|record| text(record, "provider").to_owned()).collect();
        kept.sort();
        assert_eq!(kept, ["a", providers[1], providers[1]]);
        let printed = on_one_line(&printed);
        let said = "m was served by a (1 reply), b (2 replies)";
        assert_eq!(printed.contains(said), several, "{printed}");
    }
}
