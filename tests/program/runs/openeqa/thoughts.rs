//! Thoughts in answers and in replies of the judge, and marks in other forms.

use std::collections::BTreeSet;

use serde_json::{Value, json};

use crate::support::endpoint::{Answer, MockEndpoint};
use crate::support::house::House;
use crate::support::run::{records, words};
use crate::support::table::check_rows;

/// The file of the answers of six people to one question.
fn six_answers(house: &House) {
    let answers: Vec<Value> = (1..=6)
        .map(|person| json!({"question_id": "q1", "answer": format!("brown {person}"), "annotator": person}))
        .collect();
    house.0.file("people.json", json!(answers).to_string());
}

/// The command that has a judge at an endpoint mark them.
fn judged_by<'a>(base_url: &'a str, more: &'a str) -> Vec<&'a str> {
    let line = "--answers human=people.json --judge j --out run --concurrency 1 --judge-base-url";
    [words(line), vec![base_url], words(more)].concat()
}

#[test]
fn judges_see_answers_without_thoughts() {
    check_rows(["upstream", "tolerant"], |protocol| {
        let house = House::new();
        let replies = [
            json!({"question": "q1", "reply": "<ponder>It is dark. It could be black.</ponder>\nbrown"}),
            json!({"question": "q2", "reply": "<think>It is dark. At the door"}),
            json!({"question": "q3", "reply": "<|begin_of_box|>No<|end_of_box|>"}),
        ];
        house.0.file("a.jsonl", replies.map(|line| line.to_string()).join("\n"));
        house.0.file("j.jsonl", "{\"default\": \"<think>Your mark: 1</think>\\nYour mark: 5\"}");
        let line = format!("--model script:a.jsonl --judge script:j.jsonl --levels L0 --protocol {protocol} --out run");
        let called = house.call(&words(&line));
        assert_eq!(called.code, Some(0), "{called:?}");
        let records = records(&house.0.path("run"));
        let judged: BTreeSet<&str> = records.iter().filter_map(|record| record["judged"].as_str()).collect();
        assert_eq!(judged, BTreeSet::from(["No", "brown"]));
        let is_raw = |record: &Value| record["reply"].as_str().unwrap().starts_with('<');
        assert!(records.iter().all(is_raw), "stored as they came");
        let marks: BTreeSet<i64> = records.iter().filter_map(|record| record[protocol].as_i64()).collect();
        assert_eq!(marks, BTreeSet::from([5]));
        insta::allow_duplicates! { insta::assert_snapshot!(called.lines_with("without an answer"), @r#"
        exit code: 0
        1 without an answer (none in a file, only thoughts, no "A:" of a blind model):
        "#); }
    });
}

/// The remedy of the warning: the stored replies are read, and none is asked for again.
#[test]
fn unread_marks_name_the_tolerant_protocol() {
    let house = House::new();
    six_answers(&house);
    let judge = MockEndpoint::answering(|_| Answer::text("{\"mark\": 4}"));
    let base = judge.base_url();
    let called = house.call(&judged_by(&base, ""));
    assert_eq!(called.code, Some(1), "{called:?}");
    insta::assert_snapshot!(called.messages(), @"
    exit code: 1
     WARN 5 of the first 5 replies of the judge have no mark that is read: the same command with --protocol
        tolerant reads most of them; only answers that the upstream protocol shortened are judged again
    ");
    let again = house.call(&judged_by(&base, "--protocol tolerant"));
    assert_eq!((again.code, judge.requests().len()), (Some(0), 6), "{again:?}");
    assert!(!again.messages().contains("have no mark"), "{again:?}");
    let summary = house.read("run/summary.json");
    assert_eq!(summary["rows"][0]["value"], json!(0.75));
}

#[test]
fn judges_cut_in_their_thoughts_name_the_limit() {
    let house = House::new();
    six_answers(&house);
    let message = json!({"role": "assistant", "content": "<think>Is it a 4? Your mark: 1"});
    let judge = MockEndpoint::answering(move |_| Answer::message(&message, "length"));
    let called = house.call(&judged_by(&judge.base_url(), ""));
    insta::assert_snapshot!(called.messages(), @"
    exit code: 1
     WARN 5 of the first 5 replies of the judge have no mark that is read: most of them were cut at the token
        limit: a judge that thinks or explains first needs a larger --judge-max-tokens
    ");
}

#[test]
fn read_marks_get_no_warning() {
    let house = House::new();
    six_answers(&house);
    let judge = MockEndpoint::answering(|_| Answer::text("Your mark: 4"));
    let called = house.call(&judged_by(&judge.base_url(), ""));
    assert_eq!(called.code, Some(0), "{called:?}");
    assert!(!called.messages().contains("no mark"), "{called:?}");
}
