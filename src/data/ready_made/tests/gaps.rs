//! Rows with missing or repeated values do not change how other rows are read.

use serde_json::{Map, Value, json};

use super::super::settings::LeaveOut;
use super::fixture::{base64, row, set, write};
use super::{open, read, refusal};
use crate::ready_made::SetArgs;

fn with(rows: Vec<Value>) -> (tempfile::TempDir, std::path::PathBuf) {
    let rows: Vec<_> = rows.into_iter().map(row).collect();
    set("set.json", &rows)
}

fn skipping() -> SetArgs {
    SetArgs { bad: Some(crate::SkipBad::default()), open: Some(LeaveOut::Skip), ..SetArgs::default() }
}

fn question_with_answer(answer: i64) -> Value {
    json!({"question": "?", "options": ["a", "b", "c", "d"], "answer": answer, "image": base64(answer as u8)})
}

#[test]
fn broken_row_does_not_decide_the_answer_format() {
    let rows = (0..39).map(|n| question_with_answer(1 + n % 3)).chain([question_with_answer(9)]);
    let (_folder, path) = with(rows.collect());
    let problem = refusal(&path, &skipping());
    assert!(problem.contains("index0 or as index1"), "{problem}");
}

#[test]
fn yes_no_question_without_answer_is_bad() {
    let question = |answer: Value| json!({"question": "Is it?", "answer": answer, "image": base64(1)});
    let (_folder, path) = with(vec![question(json!("yes")), question(Value::Null)]);
    let problem = refusal(&path, &skipping());
    assert!(problem.contains("1 of 2 rows are broken") && problem.contains("at most 5 %"), "{problem}");
    let (_folder, path) = with(vec![question(Value::Null), question(json!(""))]);
    let problem = refusal(&path, &skipping());
    assert!(problem.contains("no answer in any row"), "{problem}");
}

#[test]
fn row_without_options_and_answer_is_bad() {
    let full = json!({"question": "Which?", "A": "x", "B": "y", "answer": "A", "image": base64(1)});
    let short = json!({"question": "Which?", "image": base64(2)});
    let (_folder, path) = with(vec![full, short]);
    let problem = refusal(&path, &skipping());
    assert!(
        problem.contains("1 of 2 rows are broken; the first: ")
            && problem.contains("object 2: no answer (column \"answer\")"),
        "{problem}"
    );
}

#[test]
fn empty_option_list_is_no_options_but_none_is_one() {
    let (_folder, path) = with(vec![
        json!({"question": "Which?", "options": "['x', 'y']", "answer": "B", "image": base64(1)}),
        json!({"question": "How many?", "options": "[]", "answer": "7", "image": base64(2)}),
    ]);
    assert_eq!(read(&open(&path, &skipping()).unwrap()).len(), 1);
    let (_folder, path) =
        with(vec![json!({"question": "Which?", "A": "x", "B": "None", "C": "n/a", "answer": "A", "image": base64(1)})]);
    assert_eq!(read(&open(&path, &skipping()).unwrap())[0].3, ["x", "None"]);
}

#[test]
fn unnumbered_image_column_joins_numbered_ones() {
    let (_folder, path) = with(vec![
        json!({"question": "?", "options": ["x", "y"], "answer": "x", "image": base64(1), "image_2": base64(2)}),
    ]);
    assert!(refusal(&path, &skipping()).contains("1 of 1 rows show 2 images"));
}

fn question_about(id: i64, image: &str) -> Map<String, Value> {
    row(json!({"index": id, "question": format!("{id}?"), "options": ["x", "y"], "answer": "x", "image": image}))
}

#[test]
fn row_reference_stays_in_the_same_file() {
    let (folder, first) = set("a.tsv", &[question_about(1, &base64(1)), question_about(2, "1")]);
    write(&first.with_file_name("b.tsv"), &[question_about(1, &base64(3)), question_about(4, "1")]);
    let dataset = open(&folder.path().join("*.tsv"), &skipping()).unwrap();
    let reds: Vec<u8> = read(&dataset).into_iter().map(|read| read.5).collect();
    assert_eq!(reds, [1, 1, 3, 3]);
}

fn question_with_id(id: &str, red: u8) -> Map<String, Value> {
    row(json!({"index": id, "question": "?", "options": ["x", "y"], "answer": "x", "image": base64(red)}))
}

#[test]
fn ids_that_differ_only_in_space_are_not_unique() {
    let (_folder, path) = set("set.csv", &[question_with_id("1", 1), question_with_id("1 ", 2)]);
    let reds: Vec<u8> = read(&open(&path, &skipping()).unwrap()).into_iter().map(|read| read.5).collect();
    assert_eq!(reds, [1, 2]);
}

#[test]
fn preset_config_is_ignored_for_a_single_file() {
    let (_folder, path) = with(vec![
        json!({"question": "?", "options": "['x', 'y']", "answer": "A", "image_1": base64(1), "image_2": null}),
    ]);
    let place = crate::parse_data_source(&format!("mmmu:{}", path.display())).unwrap();
    let dataset = place.open(None, &SetArgs::default()).unwrap();
    assert_eq!(dataset.questions().len(), 1);
}
