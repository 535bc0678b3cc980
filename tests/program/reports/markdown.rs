//! `report --markdown`: the findings and the table by level, for an issue or a README.

use std::fs;

use crate::support::house::House;
use crate::support::run::{Bench, words};
use crate::support::snapshot::{lines_with, redacted};
use serde_json::Value;

/// The lines of the only table in a text of Markdown.
fn table(text: &str) -> Vec<&str> {
    text.lines().filter(|line| line.starts_with('|')).collect()
}

#[test]
fn markdown_repeats_findings_safely() {
    let bench = Bench::new();
    bench.rooms("frames", 8, "160x120");
    bench.file("a|`b`<b>.jsonl", "{\"default\": \"A\"}\n");
    bench.complete(&words(
        "--model random --model observer --model script:a|`b`<b>.jsonl --data frames --levels L0,L5 --out run",
    ));
    let text = bench.complete(&words("report run --markdown"));
    let summary = fs::read(bench.path("run/summary.json")).unwrap();
    let summary: Value = serde_json::from_slice(&summary).unwrap();
    let findings = summary["findings"].as_array().unwrap();
    assert!(!findings.is_empty());
    // Without the signs that keep markup away, each finding is there in the words of the summary.
    let plain = text.replace('\\', "").replace("&#8203;", "");
    for finding in findings {
        for part in ["text", "detail"] {
            let words = finding[part].as_str().unwrap();
            assert!(plain.contains(words), "{words}: {plain}");
        }
    }
    let rows = table(&text);
    assert!(rows.len() > 4, "{text}");
    let bars = |row: &str| row.replace("\\|", "").matches('|').count();
    for row in &rows {
        assert_eq!(bars(row), bars(rows[0]), "{row}");
    }
    assert!(rows.iter().any(|row| row.contains("a\\|\\`b\\`\\<b\\>")), "{text}");
    assert!(!text.contains("<b>"), "{text}");
    // Nothing but Markdown is printed, and the folder has its report as ever.
    assert!(text.starts_with("### Seeing in the dark: run\n"), "{text}");
    assert!(!text.contains("report.html"), "{text}");
    let again = bench.complete(&words("report run"));
    assert!(again.contains("report.html"));
    let refused = bench.call(&words("report run --markdown --json"));
    assert_eq!(refused.code, Some(2), "{refused:?}");
}

#[test]
fn open_and_unlabelled_runs_have_markdown() {
    let bench = Bench::new();
    bench.rooms("frames", 2, "96x64");
    bench.complete(&words("--model random --data frames --ask home --levels L0,L3 --out own"));
    let text = bench.complete(&words("report own --markdown"));
    insta::assert_snapshot!(
        lines_with(&text, "without answers"),
        @"random · 50 questions without answers · 2 images · 250 replies, 0 failed · intervals by frame"
    );
    assert!(table(&text).len() > 2, "{text}");
    let house = House::new();
    house.0.file("a.jsonl", "{\"default\": \"an answer\"}\n");
    house.0.file("j.jsonl", "{\"default\": \"4\"}\n");
    let line = "--model script:a.jsonl --judge script:j.jsonl --levels L0,L3 --out run";
    assert_eq!(house.call(&words(line)).code, Some(0));
    let text = house.0.complete(&words("report run --markdown"));
    insta::assert_snapshot!(redacted(&text), @"
    ### Seeing in the dark: run

    OpenEQA by LLM-Match, marked by script:j.jsonl, protocol upstream · 6 of 6 answers scored

    Score in % with 95 % intervals (difference from L0)

    | model | light | L0 | L3 |
    | --- | --- | ---: | ---: |
    | script:a.jsonl | with noise | 75.0 (2.9–99.7) | 75.0 (0.0) (2.9–99.7) |

    Made by darkqa-eval [VERSION].
    ");
    // A mark of 4 is 75 %.
    assert!(table(&text).iter().any(|row| row.contains("| 75.0 (")), "{text}");
}
