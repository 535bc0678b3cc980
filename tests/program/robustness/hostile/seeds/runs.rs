//! Folders that the program writes and reads again: runs, parts, plans, batches, image stores, answers of people.

use std::fs;
use std::process::Stdio;

use serde_json::{Value, json};

use crate::robustness::hostile::process::program;
use crate::support::batches::{Course, MockBatches};
use crate::support::process::{signal, wait_until};
use crate::support::run::{Bench, files, records, words};

pub(super) fn make(bench: &Bench) {
    let set = "--data set.jsonl --levels L0,L3 --no-parquet";
    bench.complete(&words(&format!("{set} --model random --blind-model random --out run")));
    bench.complete(&words(&format!("{set} --model script:script.jsonl --out other")));
    for part in ["1/2", "2/2"] {
        bench.complete(&words(&format!("{set} --model random --out parts --shard {part}")));
    }
    bench.complete(&words("plan --data set.jsonl --levels L0,L3 --model random --out planned"));
    bench.complete(&words(
        "--data frames --model random --levels L0,L3 --llie lift --images-cache store --no-parquet --out cached",
    ));
    bench.complete(&words("synthesize asked --levels L3 --variant ev --out dark"));
    bench.complete(&words("synthesize a.png --levels L3 --variant ev --out made"));
    bench.complete(&words("report run --out old --no-parquet"));
    bench.complete(&words("bundle run --out sent.zip"));
    fs::create_dir_all(bench.path("site")).unwrap();
    batches(bench);
    submitted(bench);
    let answers = records(&bench.path("run")).into_iter().filter_map(|record| {
        let condition = record["condition"].as_str()?;
        let answer = json!({"question": record["question"], "condition": condition, "person": 1, "answer": "C"});
        Some(format!("{answer}\n"))
    });
    bench.file("answers.jsonl", answers.collect::<String>());
    walked(bench);
    for run in ["run", "other", "parts", "cached", "batched", "submitted", "walked"] {
        without_products(bench, run);
    }
}

/// A run whose trials wait for a batch, and the output of this batch.
fn batches(bench: &Bench) {
    let line = "batch export --data set.jsonl --model m --levels L0,L3 --out batched --base-url http://127.0.0.1:9/v1";
    bench.complete(&words(line));
    let mut requests: Vec<Value> = Vec::new();
    for path in files(&bench.path("batched/batch")) {
        let text = fs::read_to_string(path).unwrap();
        let lines = text.lines().map(|line| serde_json::from_str(line).unwrap());
        requests.extend(lines.filter(|line: &Value| line.get("custom_id").is_some()));
    }
    assert!(requests.len() > 3);
    let output: String = requests
        .iter()
        .map(|request| {
            let body = json!({
                "model": "m-1", "choices": [{"message": {"content": "C"}, "finish_reason": "stop"}],
                "usage": {"prompt_tokens": 90, "completion_tokens": 1},
            });
            let response = json!({"status_code": 200, "request_id": "r", "body": body});
            let line = json!({"id": "b", "custom_id": request["custom_id"], "response": response, "error": null});
            format!("{line}\n")
        })
        .collect();
    bench.file("output.jsonl", &output);
    bench.file("reply/GET-files-id-content.jsonl", output);
}

/// A run whose batches were submitted and have not ended.
fn submitted(bench: &Bench) {
    let mock = MockBatches::start([Course::of("in_progress")]);
    let url = mock.base_url();
    let line = "batch run --data set.jsonl --model m --levels L0 --out submitted --poll 0.02 --no-scout --base-url";
    let mut command = program(&bench.path(""));
    command.args(words(line)).arg(&url);
    command.stdout(Stdio::null()).stderr(Stdio::null());
    let mut process = command.spawn().unwrap();
    wait_until(|| mock.count("GET batches/id") > 1);
    signal(&process, "-TERM");
    process.wait().unwrap();
    let address = url.trim_start_matches("http://").trim_end_matches("/v1");
    without_products(bench, "submitted");
    for path in files(&bench.path("submitted")) {
        let text = fs::read_to_string(&path).unwrap();
        fs::write(&path, text.replace(address, "127.0.0.1:PORTS")).unwrap();
    }
}

/// A run of open questions.
fn walked(bench: &Bench) {
    bench.complete(&words(
        "openeqa --questions questions.json --frames walks --num-frames 2 --image-size 32 --levels L0,L3 --model script:script.jsonl --judge script:judge.jsonl --out walked",
    ));
}

/// Removes what a run writes and never reads.
fn without_products(bench: &Bench, run: &str) {
    for path in files(&bench.path(run)) {
        let ending = path.extension().unwrap_or_default().to_string_lossy();
        if ["svg", "csv", "tex", "html", "parquet", "md"].contains(&&*ending) {
            fs::remove_file(path).unwrap();
        }
    }
}
