//! Prompts for answers and marks: upstream's, byte for byte.

use std::collections::BTreeSet;

use serde_json::{Value, json};

use super::{images, sent};
use crate::support::endpoint::{Answer, MockEndpoint};
use crate::support::house::House;
use crate::support::run::words;

/// Upstream's prompt for an answer with images, up to them.
const VISION: &str = "You are an intelligent question answering agent. I will ask you questions about an indoor space and you must provide an answer.\n\
You will be shown a set of images that have been collected from a single location.\n\
Given a user query, you must output `text` to answer to the question asked by the user.\n";

/// The text of a request, with a mark for each image.
fn prompt_text(request: &Value) -> String {
    let content = &request["messages"][0]["content"];
    if let Some(text) = content.as_str() {
        return text.to_owned();
    }
    content.as_array().unwrap().iter().map(|part| part["text"].as_str().unwrap_or("[image]")).collect()
}

fn check_prompts(requests: &[Value]) {
    let queries = ["What colour is it?", "Where's the {sofa}?", "Is it “safe”?"];
    for (request, query) in requests.iter().zip(queries) {
        assert_eq!(prompt_text(request), format!("{VISION}[image][image][image]User Query: {query}"));
        let fields: Vec<&str> = request.as_object().unwrap().keys().map(|key| &**key).collect();
        assert_eq!(
            fields.into_iter().collect::<BTreeSet<_>>(),
            ["model", "temperature", "seed", "max_tokens", "messages"].into()
        );
        assert_eq!(
            json!([request["model"], request["temperature"], request["seed"], request["max_tokens"]]),
            json!(["m", 0.2, 1234, 128])
        );
    }
    // Frames 0, 2 and 4 of five; of two: 0, round-half-even(0.5) = 0, and 1.
    let greys = |request: &Value| -> Vec<u8> {
        let images = images(request);
        assert!(images.iter().all(|image| image.dimensions() == (48, 32)));
        images.iter().map(|image| image.get_pixel(9, 9)[0]).collect()
    };
    assert_eq!(greys(&requests[0]), [100, 140, 180]);
    assert_eq!(greys(&requests[2]), [100, 100, 120]);
}

fn check_judge_prompts(requests: &[Value]) {
    let ends = [
        "Your Turn:\nQuestion: What colour is it?\nAnswer: brown\nResponse: It's brown.",
        "Your Turn:\nQuestion: Where's the {sofa}?\nAnswer: Near the café's door\nExtra Answers: ['By the stairs', \"it's here\", \
         '\"both\" it\\'s', '日本']\nResponse: Near it",
        "Your Turn:\nQuestion: Is it “safe”?\nAnswer: No\nResponse: No",
    ];
    for (request, end) in requests.iter().zip(ends) {
        let prompt = prompt_text(request);
        assert!(prompt.ends_with(end), "{prompt}");
        assert!(prompt.starts_with("You are an AI assistant who will help me to evaluate the response"));
        assert_eq!(
            json!([request["model"], request["temperature"], request["seed"], request["max_tokens"]]),
            json!(["j", 0.2, 1234, 32])
        );
    }
}

#[test]
fn prompts_match_upstream() {
    let house = House::new();
    let model = MockEndpoint::start([Answer::text("It's brown. It may"), Answer::text("Near it"), Answer::text("No")]);
    let judge = MockEndpoint::start([Answer::text("5"), Answer::text("Your mark: 3"), Answer::text("1")]);
    let called = house.call(&words(&format!(
        "--model m --base-url {} --judge j --judge-base-url {} --levels L0 --concurrency 1 --out run",
        model.base_url(),
        judge.base_url()
    )));
    assert_eq!(called.code, Some(0), "{called:?}");
    let (answers, marks) = (sent(&model), sent(&judge));
    assert_eq!((answers.len(), marks.len()), (3, 3));
    check_prompts(&answers);
    check_judge_prompts(&marks);
    assert_eq!(
        house.read("run/upstream/m-L0.json"),
        json!([
            {"question_id": "q1", "answer": "It's brown. It may"},
            {"question_id": "q2", "answer": "Near it"},
            {"question_id": "q3", "answer": "No"},
        ])
    );
    assert_eq!(house.read("run/upstream/m-L0-j-metrics.json"), json!({"q1": 5, "q2": 3, "q3": 1}));
    insta::assert_snapshot!(called.lines_with("cut after"), @"
    exit code: 0
    1 cut after their last full stop before they were judged, as upstream does
    ");
}

#[test]
fn blind_models_follow_upstream() {
    let house = House::new();
    let model = MockEndpoint::start([
        Answer::text("A: a bed\nExplanation: x"),
        Answer::text("I cannot see."),
        Answer::text("A: yes"),
    ]);
    let line =
        format!("--blind-model m --base-url {} --concurrency 1 --judge script:j.jsonl --out run", model.base_url());
    let called = house.call(&words(&line));
    assert_eq!(called.code, Some(2), "{called:?}");
    house.0.file("j.jsonl", "{\"default\": \"5\"}");
    let called = house.call(&words(&line));
    assert_eq!(called.code, Some(0), "{called:?}");
    let request = model.requests()[0].json();
    let prompt = request["messages"][0]["content"].as_str().unwrap();
    assert!(prompt.ends_with("\n\nQ: What colour is it?"), "{prompt}");
    // Two marks of 5 and an answer that is none.
    insta::assert_snapshot!(called, @r#"
    exit code: 0
    stdout:
    OpenEQA by LLM-Match, marked by script:j.jsonl, protocol upstream
    3 of 3 answers scored
    1 without an answer (none in a file, only thoughts, no "A:" of a blind model):
     scored 0, unjudged

    Score in % (LLM-Match, marked by script:j.jsonl, protocol upstream): mean (difference from L0), and how far
        the widest 95 % interval over 2 episodes reaches down and up
    m without images: 66.7 [1.3–99.7], n 3
    run: run
    report: run/report.html
    "#);
    assert_eq!(house.read("run/upstream/m-blind.json")[1]["answer"], Value::Null);
    assert_eq!(house.read("run/upstream/m-blind-script_j.jsonl-metrics.json")["q2"], 0);
}
