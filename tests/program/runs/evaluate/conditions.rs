//! Data, conditions and images of an evaluation: the same trials on every machine.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

use serde_json::{Value, json};

use super::text;
use crate::support::frames::png;
use crate::support::onnx;
use crate::support::run::{Bench, records, words};
use crate::support::snapshot::lines_with;
use crate::support::table::check_rows;

#[test]
fn built_in_rooms_run_without_anything() {
    let bench = Bench::new();
    let args = words("--model observer --blind-model observer --out run --full");
    let table = bench.complete(&args);
    assert!(
        table.contains("untouched")
            && table.contains("with noise")
            && table.contains("observer without images")
            && table.contains("chance: "),
        "{table}"
    );
    let (records, blind): (Vec<Value>, Vec<Value>) = records(&bench.path("run"))
        .into_iter()
        .filter(|record| record["model"] == "observer")
        .partition(|record| record["view"] == "image");
    assert_eq!(records.len(), blind.len() * 11);
    assert!(blind.len() >= 12, "{}", blind.len());
    let right = |condition: &str| {
        records
            .iter()
            .filter(|record| record["condition"] == condition)
            .filter(|record| record["outcome"] == "right")
            .count()
    };
    assert!(right("L0") * 10 >= blind.len() * 9, "{table}");
    let conditions: BTreeSet<&str> = records.iter().map(|record| text(record, "condition")).collect();
    assert_eq!(conditions.len(), 11);
    let manifest: Value = serde_json::from_slice(&fs::read(bench.path("run/manifest.json")).unwrap()).unwrap();
    assert_eq!(
        (&manifest["status"], &manifest["counts"]["answered"]),
        // Eleven conditions and none, and the observer's control in the eleven.
        (&json!("complete"), &json!(blind.len() * 23))
    );
}

#[test]
fn every_condition_runs_raw_and_enhanced() {
    let bench = Bench::with_frames();
    onnx::gain(3.0).write(&bench.path(""), "bright.onnx");
    onnx::gamma(0.5).write(&bench.path(""), "curve.onnx");
    let args = words("--data frames --model random --llie bright.onnx --llie curve.onnx --llie-anyway --out run");
    let table = bench.complete(&args);
    insta::assert_snapshot!(lines_with(&table, "with noise "), @"
    with noise            0.0   33.3   66.7   66.7   33.3   33.3   −65.4 +98.4
    with noise + bright         33.3   66.7    0.0   33.3   33.3   −65.4 +98.4
    with noise + curve          33.3   66.7   33.3   66.7   33.3   −65.4 +65.4
    ");
    let records = records(&bench.path("run"));
    // L0, five of each variant, five for each enhancer on noise.
    assert_eq!(records.len(), 3 * (1 + 5 + 5 + 5 + 5));
    let digest = |condition: &str, frame: &str| {
        let of = |record: &&Value| text(record, "condition") == condition && text(record, "frame") == frame;
        let digests: BTreeSet<String> =
            records.iter().filter(of).map(|record| record["image"]["digest"].to_string()).collect();
        assert_eq!(digests.len(), 1, "one image for all questions of {condition}");
        digests.into_iter().next().unwrap()
    };
    let digests: BTreeSet<String> =
        ["L0", "L1-ev", "L1-noise", "L1-noise+bright", "L1-noise+curve"].iter().map(|c| digest(c, "b.png")).collect();
    assert_eq!(digests.len(), 5, "five different images");
}

#[test]
fn threads_and_order_change_no_byte() {
    let bench = Bench::with_frames();
    let images = |run: &str, threads: &str, concurrency: &str| {
        bench.complete(&words(&format!(
            "--data frames --model random --threads {threads} --concurrency {concurrency} \
             --out {run}"
        )));
        let digests: BTreeMap<String, String> = records(&bench.path(run))
            .iter()
            .map(|r| (r["key"].to_string(), r["image"]["digest"].to_string()))
            .collect();
        (digests, fs::read(bench.path(run).join("summary.csv")).unwrap())
    };
    assert_eq!(images("one", "1", "1"), images("many", "5", "16"));
}

#[test]
fn parallel_enhancement_keeps_images() {
    let bench = Bench::new();
    bench.rooms("frames", 8, "160x96");
    let images = |run: &str, threads: &str| -> BTreeMap<String, String> {
        bench.complete(&words(&format!(
            "--data frames --model random --levels L3 --llie lift --llie gray-gain \
             --threads {threads} --out {run}"
        )));
        let records = records(&bench.path(run));
        records.iter().map(|r| (r["key"].to_string(), r["image"]["digest"].to_string())).collect()
    };
    let one = images("one", "1");
    assert!(one.len() > 24, "{}", one.len());
    assert_eq!(one, images("many", "3"));
    let notes = |run: &str| -> Value {
        let text = fs::read(bench.path(run).join("manifest.json")).unwrap();
        let mut manifest: Value = serde_json::from_slice(&text).unwrap();
        for note in manifest["enhancers"].as_object_mut().unwrap().values_mut() {
            assert_ne!(note.as_object_mut().unwrap().remove("latency"), None);
        }
        manifest["enhancers"].take()
    };
    // What became of them is counted together; only their times differ.
    assert_eq!(notes("one"), notes("many"));
}

#[test]
fn the_reference_run_is_made_again() {
    let bench = Bench::new();
    bench.complete(&words("--model observer --data rooms:frames=12,size=320x240 --levels L0,L3 --out run"));
    let reference = Path::new(env!("CARGO_MANIFEST_DIR")).join("results/reference");
    let by_key = |run: &Path| -> BTreeMap<String, Value> {
        records(run).into_iter().map(|record| (record["key"].to_string(), record)).collect()
    };
    // Trials, choices, replies and the very files that were sent, whatever machine made them.
    assert_eq!(by_key(&bench.path("run")), by_key(&reference));
    let names = ["summary.csv", "comparisons.csv", "thresholds.csv", "figures/accuracy.svg"];
    check_rows(names, |name| {
        let file = |run: &Path| fs::read_to_string(run.join(name)).unwrap();
        assert_eq!(file(&bench.path("run")), file(&reference), "{name}");
    });
}

#[test]
fn ready_made_sets_are_read() {
    use base64::Engine as _;
    let bench = Bench::new();
    bench.file("set/one.png", png(20));
    bench.file("set/paths.tsv", "index\tquestion\thint\tA\tB\tC\tanswer\tcategory\timage_path\n1\t\"What,\nnow?\"\tLook closely.\tred\t\tblue\tC\tcolor\tone.png\n2\tAnd?\t\tyes\tno\t\tA\tOCR\tone.png\n");
    let file = base64::engine::general_purpose::STANDARD.encode(png(50));
    bench.file(
        "set/base64.tsv",
        format!("index\timage\tquestion\tA\tB\tanswer\n7\t{file}\tWhat?\tred\tblue\tB\n8\t7\tAnd?\tyes\tno\tA\n"),
    );
    bench.file("set/lines.jsonl", "{\"id\":1,\"image\":\"one.png\",\"question\":\"What?\",\"choices\":[\"red\",\"blue\"],\"answer\":\"blue\",\"family\":\"color\"}\n");
    bench.file("script.jsonl", "{\"default\":\"B\"}\n");
    let rows = [("paths.tsv", 2, 1), ("base64.tsv", 2, 1), ("lines.jsonl", 1, 1)];
    check_rows(rows, |(set, n, right)| {
        bench.complete(&words(&format!("--data set/{set} --model script:script.jsonl --levels L0,L3 --out {set}")));
        let records = records(&bench.path(set));
        assert_eq!(records.len(), n * 3, "{set}");
        let seen = records.iter().filter(|r| r["condition"] == "L3-noise" && r["outcome"] == "right").count();
        assert_eq!(seen, right, "{set}");
        assert!(records.iter().all(|record| record["image"]["width"] == 24), "{set}");
    });
    let of_paths = records(&bench.path("paths.tsv"));
    let first = of_paths.iter().find(|record| record["question"] == "1").unwrap();
    assert_eq!(first["choices"], json!(["red", "blue"]), "an empty cell is no choice");
}

#[test]
fn equal_scripts_are_two_models() {
    let bench = Bench::with_frames();
    for script in ["one.jsonl", "two.jsonl"] {
        bench.file(script, "{\"default\":\"A\"}\n");
    }
    bench.complete(&words("--data frames --model script:one.jsonl --model script:two.jsonl --levels L0 --out run"));
    assert_eq!(records(&bench.path("run")).len(), 6);
}
