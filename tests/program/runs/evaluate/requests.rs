//! Requests of an evaluation: the words and images that are sent, and where the API key is not.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;

use serde_json::{Value, json};

use super::text;
use crate::support::endpoint::{Answer, MockEndpoint};
use crate::support::run::{Bench, called, files, model_args, records, words};
use crate::support::snapshot::lines_with;

#[test]
fn words_are_equal_in_all_conditions() {
    let bench = Bench::with_frames();
    let endpoint = MockEndpoint::start([Answer::text("A")]);
    let url = endpoint.base_url();
    bench.complete(&model_args(&url, "--data frames --levels L0,L5 --out run"));
    let mut by_text = BTreeMap::<String, Vec<String>>::new();
    for request in endpoint.requests() {
        let content = request.json()["messages"][0]["content"].clone();
        assert_eq!((&content[0]["type"], &content[1]["type"]), (&json!("text"), &json!("image_url")));
        let image = text(&content[1]["image_url"], "url").to_owned();
        by_text.entry(text(&content[0], "text").to_owned()).or_default().push(image);
    }
    assert_eq!(by_text.len(), 3);
    assert!(
        by_text.keys().any(|text| text.contains("Is there a \"lamp\" {{here}}?\nA. yes\nB. no\n")),
        "{:?}",
        by_text.keys()
    );
    for images in by_text.values() {
        let different: BTreeSet<&String> = images.iter().collect();
        assert_eq!((images.len(), different.len()), (3, 3), "L0, L5-ev, L5-noise");
    }
}

#[test]
fn the_untouched_file_itself_is_sent() {
    use base64::Engine as _;
    let bench = Bench::with_frames();
    let endpoint = MockEndpoint::start([Answer::text("A")]);
    let url = endpoint.base_url();
    bench.complete(&model_args(&url, "--data frames --levels L0 --limit 1 --out run"));
    let request = endpoint.requests()[0].json();
    let url = text(&request["messages"][0]["content"][1]["image_url"], "url").to_owned();
    let sent =
        base64::engine::general_purpose::STANDARD.decode(url.strip_prefix("data:image/png;base64,").unwrap()).unwrap();
    assert_eq!(sent, fs::read(bench.path("frames/a.png")).unwrap());
}

#[test]
fn a_blind_model_sees_words_alone() {
    let bench = Bench::with_frames();
    let endpoint = MockEndpoint::start([Answer::text("A")]);
    let url = endpoint.base_url();
    let line = format!("--data frames --model random --blind-model gpt --base-url {url} --levels L0 --out run --full");
    let table = bench.complete(&words(&line));
    insta::assert_snapshot!(lines_with(&table, "without images"), @"gpt without images: 33.3 [1.3–98.7], n 3, unparsed 0, failed 0");
    let requests = endpoint.requests();
    assert_eq!(requests.len(), 3, "once a question, not once a condition");
    assert!(requests.iter().all(|request| !String::from_utf8_lossy(&request.body).contains("image_url")));
    let blind = records(&bench.path("run")).into_iter().find(|record| record["view"] == "blind").unwrap();
    assert_eq!((&blind["condition"], &blind["image"], &blind["level"]), (&Value::Null, &Value::Null, &Value::Null));
}

#[test]
fn the_key_is_nowhere() {
    const KEY: &str = "sk-very-secret-0123456789";
    let bench = Bench::with_frames();
    let echo = Answer::error(400, "bad", &format!("your key {KEY} may not do that"));
    let endpoint = MockEndpoint::start([Answer::text(&format!("A {KEY}")), echo, Answer::text("B")]);
    let url = endpoint.base_url();
    let mut command = bench.command(&model_args(&url, "--data frames --levels L0 --concurrency 1 --out run"));
    let run = called(command.env("OPENAI_API_KEY", KEY).env("RUST_LOG", "trace"));
    assert_eq!(endpoint.requests()[0].header("authorization"), Some(format!("Bearer {KEY}").as_str()));
    assert!(!run.stderr.contains(KEY) && !run.stdout.contains(KEY), "{run:?}");
    for file in files(&bench.path("run")) {
        let content = fs::read(&file).unwrap();
        assert!(!String::from_utf8_lossy(&content).contains(KEY), "{}", file.display());
    }
}
