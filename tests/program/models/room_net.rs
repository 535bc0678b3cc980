//! The built-in model that sees, `--model room-net`.

use std::fs;
use std::path::PathBuf;

use serde_json::Value;

use crate::support::run::{Bench, assert_same_products, records, words};

/// A folder with 12 rooms that the network has not learned from, and its questions about them.
fn rooms() -> Bench {
    let bench = Bench::new();
    bench.rooms("frames", 12, "192x144");
    bench.complete(&words("questions frames --out frames/questions.jsonl"));
    bench
}

/// Asks the model about `frames`; the records.
fn ask(bench: &Bench, more: &str, run: &str) -> Vec<Value> {
    let flags = format!("--model room-net --data frames {more} --out {run}");
    bench.complete(&words(&flags));
    records(&bench.path(run))
}

/// The images of the rooms, in the order of their names.
fn images(bench: &Bench) -> Vec<PathBuf> {
    let frames = fs::read_to_string(bench.path("frames/frames.jsonl")).unwrap();
    frames
        .lines()
        .map(|line| {
            let frame: Value = serde_json::from_str(line).unwrap();
            bench.path("frames").join(frame["rgb"].as_str().unwrap())
        })
        .collect()
}

/// The share of right answers less that of guessing, and the number of guesses.
fn gain(records: &[Value]) -> (f64, usize) {
    let n = records.len() as f64;
    let right = records.iter().filter(|record| record["outcome"] == "right");
    let chance = records.iter().map(|record| 1.0 / record["choices"].as_array().unwrap().len() as f64);
    let guesses = records.iter().filter(|record| record["finish"]["other"] == "guess");
    let gain = (right.count() as f64 - chance.sum::<f64>()) / n;
    (gain, guesses.count())
}

#[test]
fn room_net_knows_only_rooms() {
    let bench = rooms();
    let (seen, _) = gain(&ask(&bench, "--levels L0", "right"));
    assert!(seen > 0.4, "{seen}");
    let (blind, guesses) = gain(&ask(&bench, "--blind", "blind"));
    assert!(blind.abs() < 0.15, "{blind}");
    assert_eq!(guesses, records(&bench.path("blind")).len());

    // Each frame has the image of the room of the next type: two frames further on.
    let paths = images(&bench);
    let files: Vec<Vec<u8>> = paths.iter().map(|path| fs::read(path).unwrap()).collect();
    for (path, file) in paths.iter().zip(files.iter().cycle().skip(2)) {
        fs::write(path, file).unwrap();
    }
    let (other, _) = gain(&ask(&bench, "--levels L0", "other"));
    assert!(other < 0.15, "{other}");

    for path in &paths {
        image::RgbImage::new(192, 144).save(path).unwrap();
    }
    let (black, guesses) = gain(&ask(&bench, "--levels L0", "black"));
    assert!(black < 0.15, "{black}");
    assert!(guesses > 0, "it finds no thing whose colour is asked");
}

#[test]
fn threads_keep_room_net_answers() {
    let bench = rooms();
    let flags = "--levels L0,L3 --llie lift";
    ask(&bench, &format!("{flags} --threads 1"), "one");
    ask(&bench, &format!("{flags} --threads 3 --concurrency 16"), "many");
    assert!(assert_same_products(&bench.path("one"), &bench.path("many")) > 8);
}

#[test]
fn unloadable_runtime_is_named() {
    let bench = Bench::new();
    let called = bench.call(&words("--model room-net --out run --llie-options ort-lib=no-such.so"));
    insta::assert_snapshot!(called.messages(), @"
    exit code: 2
    error: ONNX Runtime: [TMP]/no-such.so cannot be read: [OS ERROR]; name a library of 1.17 or later with
        --llie-options ort-lib=FILE or ORT_DYLIB_PATH, or leave both out to search for one
    ");
    assert!(!bench.path("run").exists());
    // Without images it needs none.
    bench.complete(&words("--model room-net --blind --out run --llie-options ort-lib=no-such.so"));
}

#[test]
fn it_refuses_open_questions() {
    let bench = Bench::new();
    let called = bench.call(&words("--model room-net --ask home --out run"));
    insta::assert_snapshot!(called.messages(), @"
    exit code: 2
    error: --model: room-net cannot be asked with --ask: it answers by the rules that make questions, and none
        made these; models at an endpoint, random and script:FILE can
    ");
    assert_ne!(called.code, Some(0));
}
