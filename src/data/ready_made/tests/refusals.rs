//! Ambiguous data are refused, with a flag that resolves the ambiguity.

use serde_json::{Value, json};

use super::fixture::{base64, row, set};
use super::{map, open, read, refusal};
use crate::ready_made::SetArgs;

/// A set with these fields in each row, and a question and an image.
fn with(fields: &[Value]) -> (tempfile::TempDir, std::path::PathBuf) {
    let rows: Vec<_> = fields
        .iter()
        .map(|fields| {
            let mut row = row(fields.clone());
            row.entry("question").or_insert(json!("What is it?"));
            row.entry("image").or_insert(json!(base64(1)));
            row
        })
        .collect();
    set("set.json", &rows)
}

fn answer_read_as(path: &std::path::Path, format: &str) -> String {
    read(&open(path, &map(format)).unwrap())[0].4.clone()
}

#[test]
fn ambiguous_answer_format_is_refused() {
    let numbers = json!({"options": ["red", "green", "blue"], "answer": 1});
    let (_folder, path) = with(&[numbers.clone(), numbers.clone()]);
    let problem = refusal(&path, &SetArgs::default());
    assert!(problem.contains("object 1: the answer \"1\" may be read as index0 or as index1"), "{problem}");
    assert!(problem.contains("--map answer=answer:index0 or --map answer=answer:index1"), "{problem}");
    assert_eq!(
        (answer_read_as(&path, "answer=answer:index0"), answer_read_as(&path, "answer=answer:index1")),
        ("green".into(), "red".into())
    );
    // A row that fits only one format decides for all rows.
    let (_folder, path) = with(&[numbers, json!({"options": ["red", "green"], "answer": 0})]);
    assert_eq!(read(&open(&path, &SetArgs::default()).unwrap())[0].4, "green");
}

#[test]
fn differing_columns_of_a_role_are_refused() {
    let (_folder, path) = with(&[json!({"options": ["B", "A"], "choices": ["x", "y"], "answer": "A"})]);
    let problem = refusal(&path, &SetArgs::default());
    assert!(problem.contains("--map options=options or --map options=choices"), "{problem}");
    let problem = refusal(&path, &map("options=options"));
    assert!(problem.contains("as letter or as text"), "{problem}");
    assert_eq!(read(&open(&path, &map("options=options,answer=answer:text")).unwrap())[0].4, "A");
    let (_folder, path) = with(&[json!({"options": ["x", "y"], "answer": "x", "label": "B"})]);
    let problem = refusal(&path, &SetArgs::default());
    assert!(problem.contains("--map answer=answer or --map answer=label"), "{problem}");
    let (_folder, path) =
        with(&[json!({"options": ["A. x", "B. y"], "choices": ["x", "y"], "answer": "x", "label": "A"})]);
    assert_eq!(read(&open(&path, &SetArgs::default()).unwrap())[0].4, "x");
    // A column that fits no format is not an answer column.
    let (_folder, path) = with(&[json!({"options": ["x", "y"], "answer": "x", "target": "the chair"})]);
    assert_eq!(read(&open(&path, &SetArgs::default()).unwrap())[0].4, "x");
}

#[test]
fn error_for_missing_role_lists_columns() {
    let (folder, path) = set("set.json", &[row(json!({"nr": 0, "frage": "?", "bild": "0"}))]);
    let problem = refusal(&path, &SetArgs::default());
    assert!(
        problem.contains("no question among its columns")
            && problem.contains("frage")
            && problem.contains("number   0"),
        "{problem}"
    );
    let problem = refusal(&path, &map("question=Frage"));
    assert!(problem.contains("did you mean \"frage\"?"), "{problem}");
    std::fs::write(&path, json!({"info": {"v": 1}, "items": [{"frage": "?"}]}).to_string()).unwrap();
    let problem = refusal(&path, &SetArgs::default());
    assert!(
        problem.contains("--read rows=items") && problem.contains("frage") && problem.contains("--map question="),
        "{problem}"
    );
    drop(folder);
    let wide = row(json!({"Question_0": "?", "Question_1": "?", "Image_0": base64(1)}));
    let (_folder, path) = set("set.json", &[wide]);
    assert!(refusal(&path, &SetArgs::default()).contains("Question_0, Question_1; one question per row"));
    let (_folder, path) =
        set("set.json", &[row(json!({"id": 1, "question": "?", "options": ["x", "y"], "answer": "x"}))]);
    let problem = refusal(&path, &SetArgs::default());
    assert!(
        problem.contains("no image in 1 of 1 rows") && problem.contains("--map image='images/{id}.jpg'"),
        "{problem}"
    );
}

#[test]
fn split_without_answers_is_an_error() {
    let (_folder, path) =
        with(&[json!({"options": ["x", "y"], "answer": null}), json!({"options": ["x", "y"], "answer": ""})]);
    assert!(refusal(&path, &SetArgs::default()).contains("no answer in any row"));
    let (_folder, path) = with(&[json!({"options": ["x", "y"]})]);
    assert!(refusal(&path, &SetArgs::default()).contains("no answers among its columns"));
    let (_folder, path) = with(&[
        json!({"options": ["x", "y"], "answer": ["x", "y"]}),
        json!({"options": ["x", "y"], "answer": "['x', 'y']"}),
    ]);
    let problem = refusal(&path, &SetArgs::default());
    assert!(
        problem.contains("2 of 2 rows have several true options") && problem.contains("--skip several"),
        "{problem}"
    );
}

#[test]
fn bad_rows_are_left_out_up_to_a_share() {
    let good = json!({"options": ["x", "y"], "answer": "x"});
    let mut rows = vec![good; 39];
    rows.push(json!({"options": ["x", "y"], "answer": "z"}));
    let (_folder, path) = with(&rows);
    let problem = refusal(&path, &SetArgs::default());
    assert!(
        problem.contains("1 of 40 rows are broken; the first: ") && problem.contains("object 40: the answer \"z\""),
        "{problem}"
    );
    let skip = SetArgs { bad: Some(crate::SkipBad::default()), ..SetArgs::default() };
    assert_eq!(open(&path, &skip).unwrap().questions().len(), 39);
    let (_folder, path) = with(&rows[30..]);
    let problem = refusal(&path, &skip);
    assert!(problem.contains("at most 5 %") && problem.contains("--skip bad=10%"), "{problem}");
    let raised = SetArgs { bad: "skip:10%".parse().ok(), ..SetArgs::default() };
    assert_eq!(open(&path, &raised).unwrap().questions().len(), 9);
}

#[test]
fn questions_alone_name_their_columns() {
    let (_folder, path) = with(&[json!({"question_type": "is there", "verdict": "yes"})]);
    let problem = refusal(&path, &SetArgs::default());
    assert!(
        problem.contains("neither options nor answers among its columns")
            && problem.contains("--map answer=COLUMN those of yes/no questions")
            && problem.contains("verdict"),
        "{problem}"
    );
    assert_eq!(answer_read_as(&path, "answer=verdict"), "yes");
}

#[test]
fn lower_case_letters_are_read_as_told() {
    let (_folder, path) = with(&[json!({"options": ["x", "y"], "answer": "b"})]);
    assert!(refusal(&path, &SetArgs::default()).contains("neither by letter nor by text"));
    assert_eq!(answer_read_as(&path, "answer=answer:letter"), "y");
}

#[test]
fn separator_of_options_is_proposed() {
    for (options, split) in [
        ("red|blue, dark", "options:split(|)"),
        ("red; blue", "options:split(;)"),
        ("A. red\nB. blue", r"options:split(\n)"),
    ] {
        let (_folder, path) = with(&[json!({"options": options, "answer": "red"})]);
        let problem = refusal(&path, &SetArgs::default());
        assert!(problem.contains(split), "{problem}");
        assert_eq!(answer_read_as(&path, &format!("options={split}")), "red");
    }
}

#[test]
fn column_of_image_numbers_is_proposed() {
    let rows = [row(json!({"id": 1, "imageId": 7, "question": "?", "options": ["x", "y"], "answer": "x"}))];
    let (_folder, path) = set("set.json", &rows);
    let problem = refusal(&path, &SetArgs::default());
    assert!(problem.contains("--map image='images/{imageId}.jpg'"), "{problem}");
}
