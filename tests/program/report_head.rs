//! What a report opens with in the terminal, in Markdown and as JSON.

use crate::support::run::{Bench, words};
use serde_json::Value;

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
