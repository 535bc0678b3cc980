//! What a report opens with in the terminal, in Markdown and as JSON, and the training data of enhancers.

use std::fs;

use crate::support::run::{Bench, words};
use serde_json::{Value, json};

/// A run with `lift`.
fn enhanced(bench: &Bench) {
    bench.rooms("frames", 12, "96x64");
    bench.complete(&words(
        "--model observer --data frames --levels L0,L3 --llie lift --out run",
    ));
}

/// The parts of a text from the first line that contains each mark on.
fn has_in_order(text: &str, marks: &[&str]) {
    let mut rest = text;
    for mark in marks {
        let at = rest.find(mark);
        rest = &rest[at.unwrap_or_else(|| panic!("{mark} in {text}"))..];
    }
}

#[test]
fn every_length_and_every_syntax_combine() {
    let bench = Bench::new();
    enhanced(&bench);
    let report = |flags: &str| bench.complete(&words(&format!("report run {flags}")));
    let groups = ["Darkness", "Noise", "Enhancers"];
    has_in_order(&report(""), &groups);
    assert!(report("").contains("accuracy in %"));
    has_in_order(&report("--findings"), &groups);
    assert!(!report("--findings").contains("accuracy in %"));
    has_in_order(&report("--full"), &groups);
    for (flags, folded, tables) in [
        ("--markdown", 1, 1),
        ("--markdown --findings", 0, 0),
        ("--markdown --full", 0, 2),
    ] {
        let text = report(flags);
        has_in_order(&text, &groups);
        assert_eq!(text.matches("<details>").count(), folded, "{text}");
        let found = text.matches("\n| --- |").count();
        assert!(found.min(2) == tables, "{flags}: {text}");
    }
    for (flags, has_rows, has_tables) in [
        ("--json", true, false),
        ("--json --findings", false, false),
        ("--json --full", true, true),
    ] {
        let value: Value = serde_json::from_str(&report(flags)).unwrap();
        assert!(value["findings"].is_array(), "{flags}");
        assert_eq!(value["rows"].is_array(), has_rows, "{flags}");
        assert_eq!(value["tables"]["pooled"].is_array(), has_tables, "{flags}");
    }
    for flags in ["--full --findings", "--json --markdown"] {
        let refused = bench.call(&words(&format!("report run {flags}")));
        assert_eq!(refused.code, Some(2), "{refused:?}");
    }
}

#[test]
fn training_data_of_an_enhancer_are_next_to_its_results() {
    let bench = Bench::new();
    enhanced(&bench);
    let trained = "lift: trained on this program's synthesis";
    let in_sentence = "lift at L3: no effect detected (trained on this program's synthesis).";
    let check = || {
        let text = bench.complete(&words("report run")).replace("\n ", "");
        assert!(text.contains(trained), "{text}");
        let findings = bench.complete(&words("report run --json --findings"));
        let findings: Value = serde_json::from_str(&findings).unwrap();
        let findings = findings["findings"].as_array().unwrap();
        assert!(
            findings
                .iter()
                .any(|finding| { finding["text"] == in_sentence }),
            "{findings:?}"
        );
        let markdown = bench.complete(&words("report run --markdown"));
        assert!(markdown.contains(trained), "{markdown}");
        for file in ["report.html", "tables.tex"] {
            let text = fs::read_to_string(bench.path(&format!("run/{file}"))).unwrap();
            let text = text.replace("&#x27;", "'");
            assert!(text.contains(trained), "{file}");
        }
    };
    check();
    // A run of an earlier version has the digest of the enhancer, and no statement about its training.
    let path = bench.path("run/manifest.json");
    let mut manifest: Value = serde_json::from_slice(&fs::read(&path).unwrap()).unwrap();
    let lines = &mut manifest["enhancers"]["lift"]["convention"];
    let lines = lines.as_array_mut().unwrap();
    let before = lines.len();
    lines.retain(|line| line["key"] != json!("trained_on"));
    assert_eq!(lines.len() + 1, before);
    fs::write(&path, manifest.to_string()).unwrap();
    check();
}
