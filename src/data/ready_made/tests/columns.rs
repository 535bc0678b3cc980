//! Sets with several answer columns, and column names that need quotes in a shell.

use serde_json::{Value, json};

use super::fixture::{base64, row, set};
use super::{map, open, read, refusal};
use crate::ready_made::SetArgs;

fn with(rows: Vec<Value>) -> (tempfile::TempDir, std::path::PathBuf) {
    let rows: Vec<_> = rows.into_iter().map(row).collect();
    set("set.json", &rows)
}

fn skipping() -> SetArgs {
    SetArgs { bad: Some(crate::SkipBad::default()), ..SetArgs::default() }
}

/// Forty rows with the answer x, and a label made from the number of the row.
fn labelled(label: impl Fn(usize) -> Value) -> Vec<Value> {
    (0..40).map(|at| {
        json!({"id": at, "question": "?", "options": ["x", "y"], "answer": "x", "label": label(at), "image": base64(1)})
    }).collect()
}

#[test]
fn answer_column_with_a_gap_is_kept() {
    for gap in [json!(""), Value::Null, json!("z")] {
        let mut rows = labelled(|_| json!("B"));
        rows[7]["answer"] = gap.clone();
        let (_folder, path) = with(rows);
        let problem = refusal(&path, &skipping());
        assert!(
            problem.contains("object 1: the answers of \"answer\" and \"label\" differ, \"x\" and \"B\"; --map answer=answer or --map answer=label"),
            "{gap}: {problem}"
        );
        // If both columns agree, the first is used, and the row without its answer is left out.
        let mut rows = labelled(|_| json!("A"));
        rows[7]["answer"] = gap.clone();
        let (_folder, path) = with(rows);
        let problem = refusal(&path, &SetArgs::default());
        assert!(problem.contains("1 of 40 rows are broken"), "{gap}: {problem}");
        let questions = read(&open(&path, &skipping()).unwrap());
        assert_eq!(questions.len(), 39);
        assert!(questions.iter().all(|question| question.4 == "x"));
        // The flag in the message names the other column, which has no gap.
        assert_eq!(open(&path, &map("answer=label")).unwrap().questions().len(), 40);
    }
}

#[test]
fn gap_in_second_column_hides_no_difference() {
    let rows = labelled(|at| if at == 3 { Value::Null } else { json!("B") });
    let (_folder, path) = with(rows);
    assert!(refusal(&path, &skipping()).contains("\"label\" differ"));
}

fn rows(other: &str, gap: &Value) -> Vec<Value> {
    (0..40)
        .map(|at| (at, if at == 5 { gap.clone() } else { json!("yes") }))
        .map(|(at, answer)| json!({"id": at, "question": "Is it red?", "answer": answer, "label": other, "image": base64(1)}))
        .collect()
}

#[test]
fn yes_no_columns_are_compared_where_both_have_answers() {
    let (_folder, path) = with(rows("no", &json!("")));
    assert!(refusal(&path, &skipping()).contains("\"answer\" and \"label\" differ"));
    // Numbers mean no and yes if they agree with the other column.
    let (_folder, path) = with(rows("1", &json!("yes")));
    assert_eq!(read(&open(&path, &skipping()).unwrap())[0].4, "yes");
    let (_folder, path) = with(rows("0", &json!("yes")));
    assert!(refusal(&path, &skipping()).contains("differ"));
    // A column of correctness is not an answer column.
    let (_folder, path) =
        with(vec![json!({"question": "What?", "answer": "a chair", "correct": true, "image": base64(1)})]);
    assert!(refusal(&path, &skipping()).contains("\"answer\" and \"correct\" differ"));
}

#[test]
fn printed_flags_are_quoted_for_the_shell() {
    for name in ["Correct Answer", "correct answer's", "correct $answer (1)", "correct, answer", "correct: answer"] {
        let (_folder, path) =
            with(vec![json!({"question": "?", "options": ["x", "y", "z"], name: 1, "image": base64(1)})]);
        let args = map(&format!("answer={name}:"));
        let problem = refusal(&path, &args);
        let (_, command) = problem.split_once("; --map ").unwrap();
        let (command, _) = command.split_once(" or --map ").unwrap();
        let mut shell = std::process::Command::new("sh");
        let output = shell.args(["-c", &format!("printf %s {command}")]).output().unwrap();
        let pasted = String::from_utf8(output.stdout).unwrap();
        assert_eq!(read(&open(&path, &map(&pasted)).unwrap())[0].4, "y", "{pasted}");
    }
    // A name with a comma is one column.
    let (_folder, path) =
        with(vec![json!({"question": "?", "the, options": ["x", "y"], "answer": "y", "image": base64(1)})]);
    assert_eq!(read(&open(&path, &map("options=the, options")).unwrap())[0].4, "y");
}
