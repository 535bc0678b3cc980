//! A run through the files of a Batch API.
use std::collections::BTreeSet;
use std::fs;
use std::path::PathBuf;

use crate::support::endpoint::{Answer, MockEndpoint};
use crate::support::run::{Bench, called, files, records, words};
use crate::support::table::check_rows;
use serde_json::{Value, json};

const QUESTIONS: usize = 4;

/// The run without its folder and its endpoint.
const RUN: &str = "--data set.jsonl --model m --blind-model m --levels L0,L3";

/// The run in its folder, at an endpoint that nobody serves, and more arguments.
fn args(more: &str) -> Vec<&str> {
    let place = words("--out run --base-url http://127.0.0.1:9/v1");
    [words(RUN), place, words(more)].concat()
}

fn export(bench: &Bench, more: &str) -> String {
    bench.complete(&[words("batch export"), args(more)].concat())
}

/// The lines of all input files.
fn requests(bench: &Bench) -> Vec<Value> {
    let mut paths: Vec<PathBuf> = files(&bench.path("run/batch"));
    paths.retain(|path| !path.ends_with("trials.jsonl"));
    paths.sort();
    paths
        .iter()
        .flat_map(|path| {
            let text = fs::read_to_string(path).unwrap();
            text.lines().map(|line| serde_json::from_str(line).unwrap()).collect::<Vec<Value>>()
        })
        .collect()
}

fn answer(request: &Value, reply: &str) -> String {
    let body = json!({
        "model": "m-1", "choices": [{"index": 0, "message": {"content": reply}, "finish_reason": "stop"}],
        "usage": {"prompt_tokens": 90, "completion_tokens": 1},
    });
    let response = json!({"status_code": 200, "request_id": "r", "body": body});
    json!({"id": "b", "custom_id": request["custom_id"], "response": response, "error": null}).to_string()
}

fn expired(request: &Value) -> String {
    let error = json!({"code": "batch_expired", "message": "too late"});
    json!({"id": "b", "custom_id": request["custom_id"], "response": null, "error": error}).to_string()
}

#[test]
fn exported_batches_return_in_any_order() {
    let bench = Bench::with_questions(QUESTIONS);
    let message = export(&bench, "--file-requests 5");
    // L0, L3 in both variants, and blind: 4 conditions of 4 questions.
    assert!(message.starts_with("16 requests in 4 files"), "{message}");
    let requests = requests(&bench);
    let ids: BTreeSet<&str> = requests.iter().map(|r| r["custom_id"].as_str().unwrap()).collect();
    assert_eq!(ids.len(), 16);
    for request in &requests {
        assert_eq!((&request["method"], &request["url"]), (&"POST".into(), &"/v1/chat/completions".into()));
        assert_eq!(request["body"]["model"], "m");
    }
    let seeing = requests.iter().filter(|r| r["body"]["messages"][0]["content"].is_array());
    assert_eq!(seeing.count(), 12);

    // An evaluation leaves alone what is out; so does a second export.
    let idle = bench.call(&args(""));
    insta::assert_snapshot!(idle.messages(), @"
    exit code: 1
     WARN 16 trials are waiting for a batch and not asked here; import the replies with batch run, batch fetch or
        batch import; batch cancel run ends what batch run has submitted, and frees it; or delete run/batch to ask
        here
    ");
    assert!(export(&bench, "").starts_with("0 requests in 0 files"));

    // Two expired, the rest in any order, a stranger among them.
    let mut output: Vec<String> = requests[2..].iter().map(|r| answer(r, "C")).collect();
    output.reverse();
    output.push(answer(&json!({"custom_id": "0".repeat(32)}), "C"));
    bench.file("out.jsonl", output.join("\n") + "\n\n");
    bench.file("errors.jsonl", requests[..2].iter().map(|r| expired(r) + "\n").collect::<String>());
    let back = bench.call(&["batch", "import", "run", "errors.jsonl", "out.jsonl"]);
    assert_eq!(back.code, Some(1), "{back:?}");
    assert!(back.stdout.starts_with("replies: 14 imported, 2 failed, 1 of another run\n"), "{back:?}");
    insta::assert_snapshot!(back.lines_with("answered"), @"
    exit code: 1
    ! run: incomplete: 14 of 16 trials answered, 2 failed. The same command asks the
    ");
    let again = bench.call(&["batch", "import", "run", "out.jsonl", "errors.jsonl"]);
    assert!(again.stdout.starts_with("replies: 0 imported, 0 failed, 16 imported before"), "{again:?}");
    for record in records(&bench.path("run")).iter().filter(|r| r["outcome"] != "failed") {
        assert_eq!((&record["outcome"], &record["via"]), (&"right".into(), &"batch".into()));
    }

    // What expired goes out again, and once more if it fails once more; in the end it is asked directly.
    assert!(export(&bench, "").starts_with("2 requests in 1 file; 14 already answered"));
    assert!(export(&bench, "").starts_with("0 requests in 0 files; 14 already answered, 2 waiting"));
    bench.call(&["batch", "import", "run", "errors.jsonl"]);
    let mock = MockEndpoint::start([Answer::text("C")]);
    let base = mock.base_url();
    let place = ["--resume", "run", "--base-url", &base];
    let done = bench.call(&[&words(RUN)[..], &place].concat());
    assert_eq!((done.code, mock.requests().len()), (Some(0), 2), "{done:?}");
}

#[test]
fn broken_files_are_named() {
    let bench = Bench::with_questions(QUESTIONS);
    export(&bench, "");
    let good = answer(&requests(&bench)[0], "C");
    bench.file("out.jsonl", format!("{good}\n{{\"custom\""));
    let broken = bench.call(&["batch", "import", "run", "out.jsonl"]);
    insta::assert_snapshot!(broken.messages(), @r#"
    exit code: 2
    error: out.jsonl, line 2: not a line of a Batch API's output: {"custom_id", "response", "error"} expected
    "#);
    assert_eq!(records(&bench.path("run")).len(), 1, "what came before it is kept");
    let rows = [
        ("batch import nowhere out.jsonl", "no run in this folder"),
        ("batch import run none.jsonl", "none.jsonl: cannot read"),
        ("batch export --model random --out x", "built in"),
    ];
    check_rows(rows, |(args, message)| {
        let called = bench.call(&words(args));
        assert_eq!(called.code, Some(2), "{args}");
        assert!(called.stderr.contains(message), "{called:?}");
    });
    let wrong = [words("batch export"), args("--file-size 1 --url v1")].concat();
    insta::assert_snapshot!(bench.call(&wrong).messages(), @"
    exit code: 2
    error: invalid value 'v1' for '--url <PATH>': a path expected, as /v1/chat/completions
    ");
}

/// Lines of each API, and probabilities in them, are what single requests are.
#[test]
fn probabilities_and_responses_come_through_batch() {
    let bench = Bench::with_questions(QUESTIONS);
    export(&bench, "--probabilities --wire responses");
    let requests = requests(&bench);
    let position = json!({"token": "C", "logprob": -0.1, "top_logprobs": [{"token": "A", "logprob": -3.0}]});
    let mut lines = String::new();
    for request in &requests {
        assert_eq!(request["url"], "/v1/responses");
        assert_eq!(request["body"]["top_logprobs"], 20);
        assert!(request["body"].get("stream").is_none());
        let part = json!({"type": "output_text", "text": "C", "logprobs": [position]});
        let body = json!({"status": "completed", "output": [{"type": "message", "content": [part]}]});
        let response = json!({"status_code": 200, "body": body});
        let line = json!({"custom_id": request["custom_id"], "response": response, "error": null});
        lines += &line.to_string();
        lines.push('\n');
    }
    bench.file("output.jsonl", lines);
    bench.complete(&words("batch import run output.jsonl"));
    let records = records(&bench.path("run"));
    assert_eq!(records.len(), requests.len());
    for record in &records {
        assert_eq!((&record["reply"], &record["finish"]), (&"C".into(), &"stop".into()));
        assert_eq!(record["options"]["token"], "C");
    }
    // A stream is no part of a file.
    let bench = Bench::with_questions(QUESTIONS);
    export(&bench, "--wire chat-stream");
    for request in self::requests(&bench) {
        assert_eq!(request["url"], "/v1/chat/completions");
        assert!(request["body"].get("stream").is_none());
    }
}

/// Azure has its own path for chat completions.
#[test]
fn batch_line_uses_vendor_path() {
    for (more, url) in [("", "/chat/completions"), ("--wire responses", "/v1/responses"), ("--url /v1/x", "/v1/x")] {
        let bench = Bench::with_questions(QUESTIONS);
        let place = words("--out run --base-url https://r.openai.azure.com/openai/v1");
        let line = [words("batch export"), words(RUN), place, words(more)].concat();
        let exported = called(bench.command(&line).env("AZURE_OPENAI_API_KEY", "none"));
        assert_eq!(exported.code, Some(0), "{exported:?}");
        let requests = requests(&bench);
        assert!(!requests.is_empty() && requests.iter().all(|one| one["url"] == url));
    }
}
