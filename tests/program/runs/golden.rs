//! Whole runs of both experiments, pinned: a change of what is planned, keyed, made, read or scored that nobody meant
//! shows here.
//!
//! A failure shows the digest of this version. To write it down is to change the schema, or what is asked: that stands
//! in the CHANGELOG.

use std::fs;

use crate::support::house::House;
use crate::support::onnx;
use crate::support::run::{Bench, records, words};
use serde_json::Value;

/// The digest of all that a run holds but times, addresses and versions of libraries.
fn digest(bench: &Bench, run: &str) -> String {
    let folder = bench.path(run);
    let mut lines: Vec<String> = records(&folder)
        .into_iter()
        .map(|mut record| {
            record["latency_ms"] = Value::Null;
            record.to_string()
        })
        .collect();
    lines.sort();
    for file in ["questions.jsonl", "summary.csv", "tables.tex"] {
        lines.push(fs::read_to_string(folder.join(file)).unwrap());
    }
    let manifest = fs::read(folder.join("manifest.json")).unwrap();
    let manifest: Value = serde_json::from_slice(&manifest).unwrap();
    lines.extend(["identity", "columns", "counts"].map(|field| manifest[field].to_string()));
    blake3::hash(lines.join("\n").as_bytes()).to_hex()[..16].to_owned()
}

#[test]
fn an_evaluation_with_an_enhancer() {
    let bench = Bench::new();
    onnx::gain(2.0).write(&bench.path(""), "bright.onnx");
    bench.complete(&words(
        "--model random --blind-model random --data rooms:frames=4,size=96x72 --levels L0,L2,L4 \
         --llie bright.onnx --llie-anyway --llie-on both --shuffle-options --repeats 2 --out run",
    ));
    assert_eq!(digest(&bench, "run"), EVALUATION);
}

#[test]
fn custom_drop_under_two_profiles() {
    let bench = Bench::new();
    bench.complete(&words(
        "--model observer --data rooms:frames=4,size=160x120 --levels L0,3.3 \
         --profile paper,physical --max-side 120 --out run",
    ));
    assert_eq!(digest(&bench, "run"), READINGS);
}

#[test]
fn open_questions_with_marks_and_enhancer() {
    let house = House::new();
    onnx::gain(2.0).write(&house.0.path(""), "bright.onnx");
    house.0.file(
        "a.jsonl",
        "{\"question\": \"q1\", \"condition\": \"L2-noise\", \"reply\": \"grey\"}\n{\"default\": \"an answer\"}",
    );
    house.0.file("j.jsonl", "{\"question\": \"q1\", \"reply\": \"4\"}\n{\"default\": \"2\"}");
    let called = house.call(&words(
        "--model script:a.jsonl --blind-model script:a.jsonl --judge script:j.jsonl \
         --llie bright.onnx --llie-anyway --protocol tolerant --out run",
    ));
    assert_eq!(called.code, Some(0), "{called:?}");
    assert_eq!(digest(&house.0, "run"), OPENEQA);
}

const EVALUATION: &str = "08c5d4ff0e1991ff";
const READINGS: &str = "32b13a1062b74890";
const OPENEQA: &str = "993be9b76e08b0d4";
