//! Levels other than the paper's: their order, thresholds and areas over EV, and a table of many levels.

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::fs;

use serde_json::{Value, json};

use crate::support::frames::png;
use crate::support::run::{Bench, records, words};
use crate::support::snapshot::redacted;

/// Number of frames, each with one question: enough replies and clusters for a threshold.
const FRAMES: usize = 32;

/// Frames with questions, and a scripted model that answers rightly but at these conditions.
fn bench(wrong: &[&str]) -> Bench {
    let bench = Bench::new();
    let (mut questions, mut replies) = (String::new(), String::new());
    for frame in 0..FRAMES {
        bench.file(&format!("frames/{frame}.png"), png(40 + frame as u8));
        let question = json!({
            "id": format!("q{frame}"), "frame": format!("{frame}.png"), "family": "presence",
            "question": format!("Is there thing {frame}?"), "choices": ["yes", "no"], "answer": "yes",
        });
        let _ = writeln!(questions, "{question}");
        for condition in wrong {
            let reply = json!({"question": format!("q{frame}"), "condition": condition, "reply": "no"});
            let _ = writeln!(replies, "{reply}");
        }
    }
    let _ = writeln!(replies, "{}", json!({"default": "yes"}));
    bench.file("frames/questions.jsonl", questions);
    bench.file("m.jsonl", replies);
    bench
}

/// The rows of a table of the run, each with the names of its columns.
fn rows(bench: &Bench, file: &str) -> Vec<Vec<(String, String)>> {
    let table = fs::read_to_string(bench.path("run").join(file)).unwrap();
    let mut lines = table.lines();
    let head: Vec<&str> = lines.next().unwrap().split(',').collect();
    lines
        .map(|line| {
            head.iter().zip(line.split(',')).map(|(name, cell)| ((*name).to_owned(), cell.to_owned())).collect()
        })
        .collect()
}

fn cell<'r>(row: &'r [(String, String)], name: &str) -> &'r str {
    let found = row.iter().find(|(column, _)| column == name);
    found.map_or("", |(_, cell)| cell)
}

#[test]
fn drop_range_has_ev_threshold() {
    let bench = bench(&["L4-noise", "E10-noise", "E11-noise"]);
    let line = "--model script:m.jsonl --data frames --variant noise --out run --levels";
    let text = bench.complete(&[words(line), vec!["0..10:1.25,11"]].concat());
    let names = ["L0", "E1.25", "E2.5", "E3.75", "E5", "E6.25", "L4", "E8.75", "E10", "E11"];
    let conditions: BTreeSet<String> =
        records(&bench.path("run")).iter().map(|record| record["condition"].as_str().unwrap().to_owned()).collect();
    let expected = names.map(|name| match name {
        "L0" => name.to_owned(),
        name => format!("{name}-noise"),
    });
    assert_eq!(conditions, BTreeSet::from(expected));
    let thresholds = rows(&bench, "thresholds.csv");
    let all = thresholds.iter().find(|row| cell(row, "family") == "all");
    let all = all.unwrap();
    assert_eq!(cell(all, "darkest_ev"), "11");
    // Right to 6.25 EV, wrong at 7.5, right at 8.75, wrong at 10 and 11. The fit that never rises has 1/2 at 7.5 and
    // 8.75; the middle of 1 and chance, 3/4, lies between 6.25 and 7.5.
    let threshold: f64 = cell(all, "threshold_ev").parse().unwrap();
    assert!((threshold - 6.875).abs() < 1e-3, "{threshold}");
    // The levels are side by side in the order of their light, in blocks that fit the line.
    let (_, table) = text.split_once("accuracy in %").unwrap();
    let heads = table.split_whitespace().filter(|word| names.contains(word));
    assert_eq!(heads.collect::<Vec<_>>(), names, "{text}");
    let widest = table.lines().map(|line| line.chars().count()).max();
    assert!(widest <= Some(80), "{text}");
}

#[test]
fn levels_without_l0_have_no_threshold() {
    let bench = bench(&["E13.5-noise"]);
    let line = "--model script:m.jsonl --data frames --variant noise --out run --levels";
    let text = bench.complete(&[words(line), vec!["11..16:2.5"]].concat());
    assert!(text.contains("E11 ") && text.contains("E16 "), "{text}");
    assert!(!text.contains("NaN") && !text.contains("inf"), "{text}");
    assert!(!bench.path("run/thresholds.csv").exists());
    let summary = rows(&bench, "summary.csv");
    let of = |level: &str| {
        let row = summary
            .iter()
            .find(|row| cell(row, "level") == level && cell(row, "family") == "all" && cell(row, "mode") == "strict");
        cell(row.unwrap(), "value").parse::<f64>().unwrap()
    };
    let accuracies = ["E11", "E13.5", "E16"].map(|level| of(level).to_string());
    assert_eq!(accuracies, ["1", "0", "1"]);
}

#[test]
fn single_profile_names_open_questions() {
    let bench = bench(&[]);
    let line = "--model script:m.jsonl --data frames --limit 2";
    let ratio = "signal-to-noise ratio is the same at every level";
    for (more, readings, is_said, is_constant) in [
        ("--out one", json!(["paper"]), true, true),
        ("--out single", json!(["paper"]), true, false),
        ("--out ev --variant ev", json!([]), false, false),
        ("--out physical --profile physical", json!(["physical"]), true, false),
        ("--out two --profile paper,physical", json!(["paper", "physical"]), false, true),
    ] {
        let reading = if more.contains("--profile physical") { "physical" } else { "paper" };
        let said = format!("One noise profile was run ({reading}).");
        let levels = if more.ends_with("single") { "--levels L0,L3" } else { "--levels L0,L3,12" };
        let text = bench.complete(&[words(line), words(more), words(levels)].concat());
        let folder = bench.path(more.split(' ').nth(1).unwrap());
        let page = fs::read_to_string(folder.join("report.html")).unwrap();
        let summary = fs::read(folder.join("summary.json")).unwrap();
        let summary: Value = serde_json::from_slice(&summary).unwrap();
        assert_eq!(summary["readings"], readings);
        assert_eq!([text.matches(&said).count(), page.matches(&said).count()], [usize::from(is_said); 2], "{text}");
        let heads = [&text, &page].map(|shown| shown.contains(&format!("With noise (paper) the {ratio}")));
        assert_eq!(heads, [is_constant; 2], "{more}: {text}");
        let few = [&text, &page].map(|shown| shown.contains("at most nine codes (12 EV)"));
        assert_eq!(few, [levels.contains("12"); 2], "{more}: {text}");
    }
}

#[test]
fn findings_are_listed_per_profile() {
    let bench = bench(&[
        "L3-noise",
        "L4-noise",
        "L5-noise",
        "L3-noise@eld",
        "L4-noise@eld",
        "L5-noise@eld",
        "L5-noise@physical",
    ]);
    let line = "--model script:m.jsonl --data frames --levels L0,L3-L5 --out";
    // One reading first, the others added later: only what is missing is asked.
    let text = bench.complete(&[words(line), vec!["run"]].concat());
    assert!(!text.contains("Does each finding hold"), "{text}");
    assert!(!bench.path("run/readings.csv").exists());
    let first = records(&bench.path("run"));
    assert_eq!(first.len(), FRAMES * (1 + 3 + 3));
    let all = ["run", "--profile", "paper,eld,physical", "--full"];
    let text = bench.complete(&[words(line), all.to_vec()].concat());
    let records = records(&bench.path("run"));
    assert_eq!(records.len(), FRAMES * (1 + 3 + 3 * 3));
    assert_eq!(records[..first.len()], first);
    let of_kind = |kind: &str| {
        records.iter().map(|record| record["condition"].as_str()).filter(|name| name.unwrap().ends_with(kind)).count()
    };
    assert_eq!(of_kind("-ev"), FRAMES * 3);
    assert_eq!(of_kind("@eld"), FRAMES * 3);
    let table = rows(&bench, "readings.csv");
    let find = |finding: &str, levels: &str, reading: &str| {
        let mut rows = table.iter();
        let is = |row: &&Vec<(String, String)>| {
            (cell(row, "finding"), cell(row, "levels"), cell(row, "reading")) == (finding, levels, reading)
        };
        rows.find(is).cloned().unwrap()
    };
    for (reading, effect, verdict) in [("paper", 1.0, "holds"), ("eld", 1.0, "holds"), ("physical", 1.0 / 3.0, "holds")]
    {
        let row = find("noise_compounds", "L3;L4;L5", reading);
        let found: f64 = cell(&row, "effect").parse().unwrap();
        assert!((found - effect).abs() < 1e-9, "{row:?}");
        assert_eq!((cell(&row, "verdict"), cell(&row, "n")), (verdict, "32"));
        assert_eq!(cell(&row, "holds"), "under all");
    }
    let row = find("noise_compounds", "L4", "physical");
    assert_eq!([cell(&row, "verdict"), cell(&row, "holds")], ["open", "under some"]);
    for part in [
        "Does each finding hold under every noise profile?",
        "2 of 2 findings about noise hold under all 3 noise profiles",
        "Noise compounds the drop: holds under paper, eld, physical.",
        "the break (threshold EV)",
    ] {
        assert!(text.contains(part), "{part}: {text}");
    }
    let page = fs::read_to_string(bench.path("run/report.html")).unwrap();
    let words = "Noise compounds the drop at L4: holds under paper, eld; open under physical";
    assert!(page.contains(words), "no words on the page");
}

#[test]
fn dry_run_counts_each_profile() {
    let bench = bench(&[]);
    let line = "--model gpt-4o --data frames --levels L0,L5 --dry-run --out run";
    let one = bench.complete(&words(line));
    assert!(!one.contains("requests by reading"), "{one}");
    let two = bench.complete(&[words(line), words("--profile paper,level")].concat());
    let found = two.lines().find(|line| line.starts_with("requests by reading: "));
    let found = found.unwrap();
    insta::assert_snapshot!(redacted(found), @"
    requests by reading: shared by all (L0, exposure drop, blind) 64 ($0.0488), paper 32 ($0.0244), level 32
        ($0.0244)
    ");
}
