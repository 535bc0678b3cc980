//! `records.parquet`: the records of a run as a table for other programs.

#[path = "../../examples/accuracy.rs"]
mod accuracy;

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::Command;

use crate::support::endpoint::{Answer, MockEndpoint};
use crate::support::house::House;
use crate::support::parquet_file::{body, has_orders_of_types, metadata, rows};
use crate::support::run::{Bench, model_args, records, words};
use crate::support::snapshot::redacted;
use crate::support::tools::{skip, succeeds};
use serde_json::{Map, Value, json};

const NAME: &str = "records.parquet";

/// The replies and right ones of each row of `summary.csv` that is of one family and one reading, from a table of
/// records.
type Counts = BTreeMap<[String; 8], [u64; 3]>;

/// The counts of a summary, without chance, which is asked nothing.
fn of_summary(run: &Path) -> Counts {
    let mut table = csv::Reader::from_path(run.join("summary.csv")).unwrap();
    let rows = table.deserialize::<BTreeMap<String, String>>();
    rows.map(Result::unwrap)
        .filter(|row| row["model"] != "chance" && row["family"] != "all")
        .map(|row| {
            let columns = ["model", "view", "level", "variant", "enhancer", "family", "mode", "reading"];
            let number = |name: &str| row[name].parse::<u64>().unwrap();
            let counts = [number("n"), number("right"), number("failed")];
            (columns.map(|name| row[name].clone()), counts)
        })
        .collect()
}

/// The same counts of a table of records.
fn of_table(rows: &[Map<String, Value>]) -> Counts {
    let mut counts = Counts::new();
    for row in rows {
        let text = |name: &str| row[name].as_str().unwrap_or_default().to_owned();
        for (mode, right) in [("strict", "right"), ("lenient", "right_lenient")] {
            let place = [
                text("model"),
                text("view"),
                text("level"),
                text("variant"),
                text("enhancer"),
                text("family"),
                mode.to_owned(),
                text("reading"),
            ];
            let of_place = counts.entry(place).or_default();
            match &row[right] {
                Value::Bool(is_right) => {
                    of_place[0] += 1;
                    of_place[1] += u64::from(*is_right);
                }
                _ => of_place[2] += 1,
            }
        }
    }
    counts
}

/// A record as a row of the table has it.
fn flat(record: &Value) -> Map<String, Value> {
    let mut row = Map::new();
    for name in [
        "key",
        "question",
        "frame",
        "family",
        "model",
        "view",
        "condition",
        "level",
        "variant",
        "enhancer",
        "ev",
        "truth",
        "reply",
        "refusal",
        "served_model",
        "latency_ms",
        "attempts",
        "outcome",
        "reading",
    ] {
        row.insert(name.to_owned(), record[name].clone());
    }
    for (mode, end) in [("strict", ""), ("lenient", "_lenient")] {
        row.insert(mode.to_owned(), record[mode]["chosen"].clone());
        row.insert(format!("why{end}"), record[mode]["why"].clone());
        let chosen = record[mode]["chosen"].as_u64();
        let predicted = chosen.map(|chosen| record["choices"][chosen as usize].clone());
        row.insert(format!("predicted{end}"), json!(predicted));
    }
    for name in ["kind", "status", "message"] {
        row.insert(format!("failure_{name}"), record["failure"][name].clone());
    }
    for name in ["digest", "bytes", "width", "height", "format"] {
        row.insert(format!("image_{name}"), record["image"][name].clone());
    }
    for name in ["prompt_tokens", "completion_tokens"] {
        row.insert(name.to_owned(), record["usage"][name].clone());
    }
    row
}

/// Asserts that each trial of a run is a row with the values of its last record.
fn assert_rows_are_records(run: &Path) {
    let rows = rows(&run.join(NAME));
    let last: BTreeMap<String, Value> =
        records(run).into_iter().map(|record| (record["key"].to_string(), record)).collect();
    assert_eq!(rows.len(), last.len());
    for row in rows {
        for (name, value) in flat(&last[&row["key"].to_string()]) {
            assert_eq!(row[&name], value, "{name} of {row:?}");
        }
    }
}

#[test]
fn record_table_matches_the_summary() {
    let bench = Bench::new();
    bench.rooms("frames", 4, "120x90");
    bench.complete(&words(
        "--model observer --model random --blind-model random --data frames --levels L0,L3 \
         --profile paper,physical --repeats 2 --out run",
    ));
    let run = bench.path("run");
    assert_rows_are_records(&run);
    let rows = rows(&run.join(NAME));
    let summary = of_summary(&run);
    assert!(summary.len() > 40, "{}", summary.len());
    // The summary leaves out the control of the observer.
    let mut counted = of_table(&rows);
    counted.retain(|place, _| place[0] != "observer:other-room");
    assert_eq!(counted, summary);
    assert!(rows.iter().all(|row| row["via"] == "direct"));
    assert!(rows.iter().any(|row| row["shown_frame"].is_string()));
    assert!(rows.iter().any(|row| row["repeat"] == 1));
    assert!(rows.iter().all(|row| row["scene"].is_string()));
    // The rows stand in the order of the questions.
    let questions = fs::read_to_string(run.join("questions.jsonl")).unwrap();
    let questions = questions.lines().map(|line| {
        let question: Value = serde_json::from_str(line).unwrap();
        question["id"].clone()
    });
    let mut asked: Vec<Value> = rows.iter().map(|row| row["question"].clone()).collect();
    asked.dedup();
    assert_eq!(asked, questions.collect::<Vec<_>>());
    assert_eq!(metadata(&run.join(NAME))["darkqa.schema"], "darkqa.records/1");
}

#[test]
fn rebuilt_record_table_is_identical() {
    let bench = Bench::new();
    bench.rooms("frames", 6, "120x90");
    let args = "--model random --blind-model random --levels L0,L2 --data frames";
    bench.complete(&words(&format!("{args} --out whole")));
    let path = bench.path("whole/records.parquet");
    // Polars before 1.43 refuses another order, such as that of parquet 60 for floats.
    assert!(has_orders_of_types(&path));
    let first = fs::read(&path).unwrap();
    fs::remove_file(&path).unwrap();
    bench.complete(&words("report whole"));
    assert_eq!(fs::read(&path).unwrap(), first);
    for part in ["1/3", "2/3", "3/3"] {
        bench.complete(&words(&format!("{args} --out parts --shard {part}")));
    }
    bench.complete(&words("merge parts --out merged"));
    let merged = bench.path("merged/records.parquet");
    let timeless = |path: &Path| -> Vec<Map<String, Value>> {
        let mut rows = rows(path);
        for row in &mut rows {
            row.remove("latency_ms");
        }
        rows
    };
    assert_eq!(timeless(&merged), timeless(&path));
    // It stands in the order in which merge writes the records.
    let keys = |rows: Vec<Value>| -> Vec<Value> { rows.into_iter().map(|mut row| row["key"].take()).collect() };
    let table = rows(&merged).into_iter().map(Value::Object).collect();
    assert_eq!(keys(table), keys(records(&bench.path("merged"))));
    // The same parts, joined again in another order, are the same bytes of values.
    bench.complete(&words("merge parts/shard-3-of-3 parts/shard-1-of-3 parts/shard-2-of-3 --out again"));
    assert_eq!(body(&bench.path("again/records.parquet")), body(&merged));
}

#[test]
fn record_table_keeps_odd_texts() {
    let bench = Bench::with_questions(4);
    let refused = json!({"role": "assistant", "content": null, "refusal": "I won't \u{1b}[1m."});
    let endpoint = MockEndpoint::start([
        Answer::error(413, "invalid_image", "no such image"),
        Answer::message(&refused, "stop"),
        Answer::text("a \u{0}\u{1b}\n\"tab\t日本"),
        Answer::message_charged("C", 5_000_000_000),
    ]);
    let base_url = endpoint.base_url();
    let call = bench.call(&model_args(&base_url, "--data set.jsonl --levels L0 --concurrency 1 --out run"));
    insta::assert_snapshot!(call.messages(), @"
    exit code: 1
     WARN m: a trial about a.png failed: http://127.0.0.1:[PORT]/v1 answered 413: no such image (send smaller
        images: --image max-side=N, or --image jpeg:95)
     WARN run/records.parquet: numbers that are too large for the column prompt_tokens, and are null in it: 1;
        records.jsonl has them
    ");
    let rows = rows(&bench.path("run/records.parquet"));
    let all = records(&bench.path("run"));
    assert_eq!(rows.len(), 4);
    for row in &rows {
        let record = all.iter().find(|record| record["key"] == row["key"]);
        let mut expected = flat(record.unwrap());
        if expected["prompt_tokens"] == 5_000_000_000_u64 {
            expected.insert("prompt_tokens".to_owned(), Value::Null);
        }
        for (name, value) in expected {
            assert_eq!(row[&name], value, "{name}");
        }
    }
    let failed: Vec<_> = rows.iter().filter(|row| row["outcome"] == "failed").collect();
    assert_eq!(failed.len(), 1);
    assert_eq!(failed[0]["failure_status"], 413);
    for name in ["right", "right_lenient", "strict", "predicted", "reply", "finish"] {
        assert!(failed[0][name].is_null(), "{name}: {failed:?}");
    }
    // The trial that failed is asked again, and its row has the reply.
    bench.complete(&model_args(&base_url, "--data set.jsonl --levels L0 --concurrency 1 --out run"));
    assert_eq!(records(&bench.path("run")).len(), 5);
    assert_eq!(of_table(&self::rows(&bench.path("run/records.parquet"))), of_summary(&bench.path("run")));
}

#[test]
fn outdated_record_table_is_noticed() {
    let bench = Bench::new();
    bench.rooms("frames", 2, "120x90");
    let args = "--model random --levels L0 --data frames --out run";
    bench.complete(&words(&format!("{args} --no-parquet")));
    let path = bench.path("run/records.parquet");
    assert!(!path.exists());
    bench.complete(&words("report run"));
    let whole = fs::read(&path).unwrap();
    // A record more, as a killed process leaves it.
    let log = bench.path("run/records.jsonl");
    let mut lines = fs::read_to_string(&log).unwrap();
    let first = lines.lines().next().unwrap().to_owned();
    lines += &first;
    lines.push('\n');
    fs::write(&log, &lines).unwrap();
    let kept = bench.call(&words("report run --no-parquet"));
    insta::assert_snapshot!(kept.messages(), @"
    exit code: 0
     WARN run/records.parquet: not made from the records as they are now, and left as it is (--no-parquet); report
        without --no-parquet writes it again
    ");
    assert_eq!(fs::read(&path).unwrap(), whole);
    let length = |path: &Path| metadata(path)["darkqa.log_bytes"].clone();
    assert_ne!(length(&path), lines.len().to_string());
    let report = bench.call(&words("report run"));
    assert_eq!(report.stderr, "");
    assert_eq!(length(&path), lines.len().to_string());
    assert_rows_are_records(&bench.path("run"));
    // What is no such file is replaced, too.
    fs::write(&path, "PAR1 not at all PAR1").unwrap();
    bench.complete(&words("report run"));
    assert_rows_are_records(&bench.path("run"));
}

#[test]
fn open_record_table_has_marks() {
    let house = House::new();
    house.0.file(
        "a.jsonl",
        "{\"question\": \"q1\", \"reply\": \"grey\"}\n{\"question\": \"q2\", \"reply\": \" \"}\n{\"default\": \"an answer. Cut\"}",
    );
    house.0.file("j.jsonl", "{\"question\": \"q1\", \"reply\": \"4\"}\n{\"default\": \"2\"}");
    let called = house.call(&words("--model script:a.jsonl --judge script:j.jsonl --levels L0,L2 --out run"));
    assert_eq!(called.code, Some(0), "{called:?}");
    let run = house.0.path("run");
    let rows = rows(&run.join(NAME));
    let all = records(&run);
    let answers = all.iter().filter(|record| record["step"] == "answer").count();
    assert_eq!(rows.len(), answers);
    assert!(answers < all.len());
    for row in &rows {
        let expected = match row["question"].as_str().unwrap() {
            "q1" => json!(["marked", "grey", 4, 0.75, "script:j", "brown"]),
            "q2" => json!(["null", null, null, 0.0, null, "Near the café's door"]),
            "q3" => json!(["marked", "an answer.", 2, 0.25, "script:j", "No"]),
            other => panic!("{other}"),
        };
        let columns = ["outcome", "predicted", "mark", "score", "judge", "answer"];
        let mut found = Value::from_iter(columns.map(|name| row[name].clone()));
        if let Some(judge) = found[4].as_str() {
            assert!(judge.starts_with("script:j"), "{judge}");
            found[4] = json!("script:j");
        }
        assert_eq!(found, expected);
        assert_eq!(row["image_count"], 3);
    }
    assert_eq!(metadata(&run.join(NAME))["darkqa.schema"], "darkqa.openeqa-records/1");
}

/// Skipped where Python has no DuckDB.
#[test]
fn duckdb_counts_as_the_summary_does() {
    let query = "select model, view, coalesce(level, ''), variant, coalesce(enhancer, ''), family, 'strict', coalesce(reading, ''), \
                 count(\"right\"), count(*) filter (\"right\"), count(*) filter (\"right\" is null) \
                 from 'run/records.parquet' group by all";
    let script = format!(
        "import json, duckdb\nprint(json.dumps([(row[:8], row[8:]) for row in duckdb.sql({}).fetchall()]))",
        json!(query)
    );
    let python = std::env::var("PYTHON").unwrap_or_else(|_| "python3".to_owned());
    if !succeeds(&python, &["-c", "import duckdb"]) {
        skip(&format!("{python} has no duckdb"));
        return;
    }
    let bench = Bench::new();
    bench.rooms("frames", 4, "120x90");
    bench.complete(&words("--model random --blind-model random --data frames --levels L0,L3 --out run"));
    let output = Command::new(python).args(["-c", &script]).current_dir(bench.path("")).output().unwrap();
    assert!(output.status.success(), "{output:?}");
    let counted: Vec<([String; 8], [u64; 3])> = serde_json::from_slice(&output.stdout).unwrap();
    let counted = Counts::from_iter(counted);
    let mut summary = of_summary(&bench.path("run"));
    summary.retain(|place, _| place[6] == "strict");
    assert_eq!(counted, summary);
}

/// The example and the summary of a run agree on every model, level and variant.
#[test]
fn example_computes_accuracy_of_summary() {
    let run = Path::new(env!("CARGO_MANIFEST_DIR")).join("results/reference");
    let scores = accuracy::accuracy(&run).unwrap();
    let mut expected = BTreeMap::<[String; 3], accuracy::Score>::new();
    for (row, [replies, right, _]) in of_summary(&run) {
        let [model, _, level, variant, enhancer, _, mode, _] = row;
        if mode == "strict" && enhancer.is_empty() && !level.is_empty() {
            let score = expected.entry([model, level, variant]).or_default();
            score.replies += replies as usize;
            score.right += right as usize;
        }
    }
    assert!(expected.len() >= 3, "{expected:?}");
    // Controls of the observer are no rows of the summary.
    for (subject, score) in expected {
        assert_eq!(scores.get(&subject), Some(&score), "{subject:?}");
    }
}

#[test]
fn exported_records_match_table() {
    let run = Path::new(env!("CARGO_MANIFEST_DIR")).join("results/reference");
    let records = darkqa_eval::StoredRun::open(&run).unwrap().records().unwrap();
    assert!(records.columns().any(|column| column == "right_lenient"));
    let records: Vec<_> = records.map(Result::unwrap).collect();
    let first = &records[0];
    assert_eq!(first.text("key").unwrap().map(str::len), Some(32));
    assert_eq!(first.number("attempts").unwrap(), Some(1.0));
    let problem = first.text("levels").unwrap_err().to_string();
    insta::assert_snapshot!(redacted(&problem), @"levels: no such column of records; did you mean level?");
    let problem = first.number("level").unwrap_err().to_string();
    insta::assert_snapshot!(redacted(&problem), @"level: the column holds no numbers");
    assert!(darkqa_eval::StoredRun::open("no-such-run").is_err());
}
