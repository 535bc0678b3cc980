//! The command line as a contract: its help, and one clear line for each wrong word.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod support;

use serde_json::json;
use support::onnx;
use support::run::{Bench, called};

#[test]
fn the_help_is_as_it_was() {
    let bench = Bench::new();
    let help = called(bench.command(&["--help"]).env("COLUMNS", "110"));
    assert_eq!(help.code, Some(0));
    let help = help.stdout.replace("darkqa-eval.exe", "darkqa-eval");
    let long = help
        .lines()
        .map(str::trim_end)
        .collect::<Vec<_>>()
        .join("\n");
    insta::assert_snapshot!(long);
}

/// A frame with one question; `wrong` changes the question.
fn data(bench: &Bench, wrong: impl FnOnce(&mut serde_json::Value)) {
    let image = image::RgbImage::from_fn(8, 8, |x, y| {
        image::Rgb([(x * 30) as u8, (y * 30) as u8, 90])
    });
    std::fs::create_dir_all(bench.path("frames")).unwrap();
    image.save(bench.path("frames/a.png")).unwrap();
    let mut question = json!({"id": "q", "frame": "a.png", "question": "Is it?", "choices": ["yes", "no"], "answer": "no"});
    wrong(&mut question);
    bench.file("frames/questions.jsonl", question.to_string());
}

/// A call that must end with exit code 2 and one line that says all of `words`.
fn refused(bench: &Bench, call: &[&str], words: &[&str]) {
    let refused = bench.call(call);
    assert_eq!(refused.code, Some(2), "{call:?}: {refused:?}");
    assert_eq!(
        refused.stderr.trim_end().lines().count(),
        1,
        "{call:?}: {}",
        refused.stderr
    );
    assert!(
        refused.stderr.starts_with("error: "),
        "{call:?}: {}",
        refused.stderr
    );
    for word in words {
        assert!(
            refused.stderr.contains(word),
            "{call:?}: {word:?} is not in: {}",
            refused.stderr
        );
    }
    assert!(refused.stdout.is_empty());
    assert!(!bench.path("run").exists(), "{call:?} left a run behind");
}

#[test]
fn wrong_words_name_their_flag() {
    let bench = Bench::new();
    for (call, words) in [
        (&["--modle", "x"][..], &["--modle"][..]),
        (&[], &["--model", "random"]),
        (
            &["--model", "random", "--levels", "L7"],
            &["--levels", "\"L7\"", "L0, L1"],
        ),
        (&["--model", "random", "--limit", "0"], &["--limit"]),
        (
            &["--model", "random", "--data", "nowhere"],
            &["--data", "nowhere", "no such file"],
        ),
        (
            &["--model", "random", "--families", "smell"],
            &["--families", "smell", "room_type"],
        ),
        (
            &["--model", "random", "--config", "nowhere.toml"],
            &["nowhere.toml"],
        ),
        (
            &["--model", "random", "--resume", "nowhere"],
            &["--resume", "nowhere", "--out"],
        ),
        (
            &["--model", "random", "--out", "a", "--resume", "b"],
            &["--out", "--resume"],
        ),
        (
            &["--model", "random", "--model", "random"],
            &["--model", "twice"],
        ),
        (
            &["--model", "random", "--image", "webp"],
            &["--image", "webp"],
        ),
        (&["--model", "random", "--prompts", "nowhere"], &["nowhere"]),
        (&["--model", "script:nowhere.jsonl"], &["nowhere.jsonl"]),
    ] {
        refused(&bench, call, words);
    }
}

#[test]
fn a_remote_endpoint_needs_a_key() {
    let bench = Bench::new();
    refused(
        &bench,
        &["--model", "gpt-4o"],
        &[
            "OPENAI_API_KEY",
            "https://api.openai.com/v1",
            "--api-key-env",
            "--api-key-file",
        ],
    );
    refused(
        &bench,
        &["--model", "m", "--api-key-file", "nowhere"],
        &["nowhere"],
    );
    bench.file("key", "sk-secret-42\n");
    let call = [
        "--model",
        "m",
        "--base-url",
        "http://example.org/v1",
        "--api-key-file",
        "key",
    ];
    refused(&bench, &call, &["http://example.org", "--allow-http"]);
    assert!(!bench.call(&call).stderr.contains("sk-secret-42"));
}

#[test]
fn wrong_data_name_their_file() {
    let bench = Bench::new();
    let call = ["--data", "frames", "--model", "random", "--out", "run"];
    data(&bench, |question| question["answer"] = "maybe".into());
    refused(
        &bench,
        &call,
        &["questions.jsonl, line 1", "\"maybe\"", "choices"],
    );
    data(&bench, |question| question["choices"] = json!(["yes"]));
    refused(&bench, &call, &["questions.jsonl, line 1"]);
    data(&bench, |question| question["frame"] = "z.png".into());
    refused(
        &bench,
        &call,
        &["questions.jsonl", "\"z.png\"", "\"a.png\""],
    );
    data(&bench, |_| ());
    bench.file("frames/a.png", "not an image");
    refused(&bench, &call, &["a.png", "not an image"]);
    std::fs::remove_file(bench.path("frames/questions.jsonl")).unwrap();
    refused(&bench, &call, &["frames", "questions.jsonl", "--questions"]);
    bench.file("empty/readme.txt", "");
    refused(
        &bench,
        &["--data", "empty", "--model", "random"],
        &["empty", "frames.jsonl"],
    );
    bench.file("table.tsv", "a\tb\n1\t2\n");
    refused(
        &bench,
        &["--data", "table.tsv", "--model", "random"],
        &["table.tsv", "column"],
    );
}

#[test]
fn wrong_enhancers_name_their_file() {
    let bench = Bench::new();
    let call = |file: &'static str| ["--model", "random", "--out", "run", "--llie", file];
    refused(&bench, &call("nowhere.onnx"), &["nowhere.onnx"]);
    bench.file("text.onnx", "this is no model, whatever its name says");
    refused(&bench, &call("text.onnx"), &["text.onnx", "ONNX"]);
    onnx::no_image().write(&bench.path(""), "blind.onnx");
    refused(&bench, &call("blind.onnx"), &["blind.onnx", "output"]);
    onnx::wrong_rank().write(&bench.path(""), "rank.onnx");
    refused(&bench, &call("rank.onnx"), &["rank.onnx"]);
    onnx::identity().write(&bench.path(""), "fine.onnx");
    let missing = [
        "--model",
        "random",
        "--out",
        "run",
        "--llie",
        "fine.onnx",
        "--ort-lib",
        "no-such.so",
    ];
    refused(&bench, &missing, &["no-such.so"]);
    let twice = [
        "--model",
        "random",
        "--out",
        "run",
        "--llie",
        "fine.onnx",
        "--llie",
        "fine.onnx",
    ];
    refused(&bench, &twice, &["--llie", "fine"]);
}
