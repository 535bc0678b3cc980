//! The order of models in a report, and the groups by which tables are divided.

use std::fs;

use serde_json::Value;

use crate::support::endpoint::{Answer, MockEndpoint};
use crate::support::house::House;
use crate::support::run::{Bench, Called, records, words};

/// Names in another order than that of the alphabet.
const NAMES: [&str; 3] = ["zebra", "mole", "cow"];

const RUN: &str = "--models models.toml --data set.jsonl --levels L0,L3 --retries 0 --out run";

fn table(name: &str, url: &str, more: &str) -> String {
    format!("[[model]]\nname = \"{name}\"\nid = \"id-{name}\"\nendpoints = [\"{url}\"]\n{more}\n")
}

fn complete(bench: &Bench, line: &str) -> Called {
    let called = bench.call(&words(&format!("{RUN} {line}")));
    assert_eq!(called.code, Some(0), "{called:?}");
    called
}

/// The names in the order in which they first stand in a text.
fn order<'a>(text: &str, names: &[&'a str]) -> Vec<&'a str> {
    let mut found: Vec<(usize, &str)> = names.iter().filter_map(|name| Some((text.find(name)?, *name))).collect();
    found.sort_unstable();
    found.into_iter().map(|(_, name)| name).collect()
}

fn read(bench: &Bench, file: &str) -> String {
    fs::read_to_string(bench.path(file)).unwrap()
}

/// The part of a text from one mark to the next one behind it.
fn between<'a>(text: &'a str, start: &str, end: &str) -> &'a str {
    let from = text.find(start).unwrap_or_else(|| panic!("no {start}"));
    let rest = &text[from..];
    &rest[..rest[start.len()..].find(end).unwrap_or(rest.len() - start.len()) + start.len()]
}

#[test]
fn rows_stand_in_order_of_file() {
    let mock = MockEndpoint::start([Answer::text("C")]);
    let url = mock.base_url();
    let tables = NAMES.map(|name| table(name, &url, ""));
    let bench = Bench::with_questions(2);
    bench.file("models.toml", tables.concat());
    let run = complete(&bench, "");
    let accuracy = between(&run.stdout, " accuracy in %", "run: ");
    assert_eq!(order(accuracy, &NAMES), NAMES, "{}", run.stdout);
    for file in ["run/summary.csv", "run/tables.tex"] {
        assert_eq!(order(&read(&bench, file), &NAMES), NAMES, "{file}");
    }
    let thresholds = read(&bench, "run/thresholds.csv");
    assert_eq!(order(&thresholds, &NAMES), NAMES, "{thresholds}");
    let page = read(&bench, "run/report.html");
    let shown = between(&page, "Accuracy in % by level, with", "</table>");
    assert_eq!(order(shown, &NAMES), NAMES);
    let figure = read(&bench, "run/figures/accuracy.svg");
    assert_eq!(order(&figure, &NAMES), NAMES);
    // Another order of the file asks nothing, and shows the complete run in that order.
    let asked = mock.requests().len();
    let tables = [tables[1].clone(), tables[2].clone(), tables[0].clone()];
    bench.file("models.toml", tables.concat());
    complete(&bench, "");
    let turned = ["mole", "cow", "zebra"];
    assert_eq!(order(&read(&bench, "run/summary.csv"), &NAMES), turned);
    bench.complete(&["report", "run"]);
    assert_eq!(order(&read(&bench, "run/summary.csv"), &NAMES), turned);
    // A model that a flag names stands behind those of the file; --only keeps the places of the others.
    complete(&bench, "--model random --only zebra,random,cow");
    let all = ["mole", "cow", "zebra", "random"];
    assert_eq!(order(&read(&bench, "run/summary.csv"), &all), all);
    assert_eq!(mock.requests().len(), asked);
    // Without a file names decide.
    let flags = "--data set.jsonl --levels L0 --out flags --model random --model observer";
    let called = bench.call(&words(flags));
    assert_eq!(called.code, Some(2), "{called:?}");
    let flags = format!("--data set.jsonl --levels L0 --out flags --model zebra --model cow --base-url {url}");
    bench.complete(&words(&flags));
    let summary = read(&bench, "flags/summary.csv");
    assert_eq!(order(&summary, &["cow", "zebra"]), ["cow", "zebra"]);
}

#[test]
fn tables_are_divided_by_groups() {
    let mock = MockEndpoint::start([Answer::text("C")]);
    let url = mock.base_url();
    let bench = Bench::with_questions(2);
    bench.file(
        "models.toml",
        table("big", &url, "group = \"70 B & more\"")
            + &table("plain", &url, "")
            + &table("small", &url, "group = \"7-8B\"\nview = \"both\"")
            + &table("huge", &url, "group = \"70 B & more\""),
    );
    let run = complete(&bench, "");
    let parts = ["plain", "— 70 B & more", "big", "huge", "— 7-8B", "small"];
    let accuracy = between(&run.stdout, " accuracy in %", "run: ");
    assert_eq!(order(accuracy, &parts), parts, "{accuracy}");
    let full = bench.complete(&["report", "run", "--full"]);
    let levels = between(&full, "Accuracy in %", "without images: ");
    assert_eq!(order(levels, &parts), parts, "{full}");
    let tex = read(&bench, "run/tables.tex");
    let tex = between(&tex, "Accuracy in \\%", "\\bottomrule");
    let parts = [
        "plain",
        "\\multicolumn{4}{l}{\\textit{70 B \\& more}}",
        "big",
        "huge",
        "\\textit{7-8B}",
        "small",
        "small without images",
        "chance",
    ];
    let found = order(tex, &parts);
    assert_eq!(found.len(), parts.len(), "{tex}");
    assert_eq!(found[..6], parts[..6], "{tex}");
    let page = read(&bench, "run/report.html");
    let shown = between(&page, "Accuracy in % by level, with", "</table>");
    assert!(shown.contains("<tr class=\"group\"><th scope=\"rowgroup\" colspan="), "{shown}");
    // The model without images stands below the same model with them, and chance at the end.
    let rows = ["7-8B", "with noise", "without images", "guessing"];
    assert_eq!(order(between(shown, "7-8B", "</table>"), &rows), rows);
    let summary: Value = serde_json::from_str(&read(&bench, "run/summary.json")).unwrap();
    let listed = summary["run"]["models"].as_array().unwrap();
    assert_eq!(listed[0]["name"], "big");
    assert_eq!(listed[0]["group"], "70 B & more");
    assert!(listed[1].get("group").is_none());
    for row in summary["rows"].as_array().unwrap() {
        let group = match row["model"].as_str().unwrap() {
            "big" | "huge" => Some("70 B & more"),
            "small" => Some("7-8B"),
            _ => None,
        };
        assert_eq!(row["model_group"].as_str(), group, "{row}");
    }
    // A group decides no reply: another one asks nothing.
    let asked = mock.requests().len();
    let models = read(&bench, "models.toml").replace("group = \"7-8B\"\n", "");
    bench.file("models.toml", models);
    let run = complete(&bench, "");
    assert!(!run.stdout.contains("7-8B"), "{}", run.stdout);
    assert_eq!(mock.requests().len(), asked);
    bench.file("models.toml", table("big", &url, "group = \" \""));
    let called = bench.call(&words(RUN));
    insta::assert_snapshot!(called.messages(), @"
    exit code: 2
    error: models.toml, line 5: group: a text expected
    ");
    assert_eq!(records(&bench.path("run")).len(), asked);
}

#[test]
fn open_report_keeps_file_order() {
    let house = House::new();
    let mock = MockEndpoint::start([Answer::text("4")]);
    let url = mock.base_url();
    house.0.file("models.toml", table("zebra", &url, "group = \"striped\"") + &table("cow", &url, ""));
    let line = format!(
        "openeqa --questions questions.json --frames walks --num-frames 2 --image-size 32 --levels L0 --models models.toml --judge j --judge-base-url {url} --out run"
    );
    house.0.complete(&words(&line));
    let summary = fs::read_to_string(house.0.path("run/summary.csv")).unwrap();
    assert_eq!(order(&summary, &["zebra", "cow"]), ["cow", "zebra"]);
    assert!(summary.lines().next().unwrap().ends_with("model_group"));
    assert!(summary.contains(",striped"), "{summary}");
    let models = table("zebra", &url, "") + &table("cow", &url, "");
    house.0.file("models.toml", models);
    house.0.complete(&words(&line));
    let summary = fs::read_to_string(house.0.path("run/summary.csv")).unwrap();
    assert_eq!(order(&summary, &["zebra", "cow"]), ["zebra", "cow"]);
    assert!(!summary.contains("model_group"));
}
