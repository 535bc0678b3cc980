//! No cell of a CSV file is one that a spreadsheet runs as a formula, whoever named a family or a model.

use std::fs;

use crate::support::endpoint::{Answer, MockEndpoint};
use crate::support::run::{Bench, files, words};

/// A family and a model that a spreadsheet would run.
const FAMILY: &str = "=HYPERLINK(\"http://x\",\"y\")";
const MODEL: &str = "+1-cmd|x";

/// The cells of all CSV files below a folder, each with its file.
fn cells(bench: &Bench, folder: &str) -> Vec<(String, String)> {
    let mut cells = Vec::new();
    for path in files(&bench.path(folder)) {
        if path.extension().is_none_or(|ending| ending != "csv") {
            continue;
        }
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        let mut reader = csv::ReaderBuilder::new();
        let mut reader = reader.has_headers(false).from_path(&path).unwrap();
        for row in reader.records() {
            let row = row.unwrap();
            cells.extend(row.iter().map(|cell| (name.clone(), cell.to_owned())));
        }
    }
    cells
}

#[test]
fn formulas_stay_text() {
    let bench = Bench::with_questions(12);
    let set = fs::read_to_string(bench.path("set.jsonl")).unwrap();
    let family = serde_json::to_string(FAMILY).unwrap();
    bench.file("set.jsonl", set.replace("\"color\"", &family));
    let endpoint = MockEndpoint::answering(|_| Answer::text("A"));
    let line = "--data set.jsonl --levels L0,L5 --out run";
    let models = ["--model", MODEL, "--model", "@SUM(A1)", "--base-url", &endpoint.base_url()];
    bench.complete(&[&models[..], &words(line)].concat());
    bench.complete(&words("site run --out site"));
    for folder in ["run", "site"] {
        let cells = cells(&bench, folder);
        assert!(cells.len() > 30, "{folder}: {cells:?}");
        for (file, cell) in &cells {
            let runs = cell.starts_with(['=', '+', '-', '@', '\t', '\r']);
            assert!(!runs || cell.parse::<f64>().is_ok(), "{folder}/{file}: {cell:?}");
        }
    }
    let cells = cells(&bench, "run");
    // The text is there behind its apostrophe, and negative numbers are numbers.
    let has = |text: &str| cells.iter().any(|(_, cell)| cell == text);
    for text in [FAMILY, MODEL] {
        assert!(has(&format!("'{text}")), "{text}");
        assert!(!has(text), "{text}");
    }
    let is_negative = |cell: &str| cell.parse::<f64>().is_ok_and(|number| number < 0.0);
    assert!(cells.iter().any(|(_, cell)| is_negative(cell)));
    // JSON is no spreadsheet: the name is as it was given.
    let summary = fs::read_to_string(bench.path("run/summary.json")).unwrap();
    assert!(summary.contains(&family), "{summary}");
    assert!(!summary.contains("\"'="));
}

#[test]
fn exported_set_reads_back_unchanged() {
    let bench = Bench::with_questions(2);
    let set = fs::read_to_string(bench.path("set.jsonl")).unwrap();
    bench.file("set.jsonl", set.replace("\"red\"", "\"-4\"").replace("\"blue\"", "\"=1+1\""));
    bench.complete(&words("export vlmevalkit set.jsonl --levels L0 --out sets"));
    let table = fs::read_dir(bench.path("sets")).unwrap().next().unwrap();
    let table = table.unwrap().path();
    let table = table.to_string_lossy();
    let run = format!("--model random --data {table} --levels L0 --out back");
    bench.complete(&words(&run));
    let questions = fs::read_to_string(bench.path("back/questions.jsonl")).unwrap();
    assert!(questions.contains("\"-4\"") && questions.contains("\"=1+1\""), "{questions}");
}
