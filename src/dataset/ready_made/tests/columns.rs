//! Two columns that may hold the answers, and columns whose names a shell would change.

use serde_json::{Value, json};

use super::fixture::{base64, row, set};
use super::{map, open, read, refusal};
use crate::dataset::ready_made::SetArgs;

fn with(rows: Vec<Value>) -> (tempfile::TempDir, std::path::PathBuf) {
    let rows: Vec<_> = rows.into_iter().map(row).collect();
    set("set.json", &rows)
}

fn skipping() -> SetArgs {
    SetArgs {
        bad: Some(crate::dataset::SkipBad::default()),
        ..SetArgs::default()
    }
}

/// Forty rows whose answer is x, with the label of the number of each.
fn labelled(label: impl Fn(usize) -> Value) -> Vec<Value> {
    (0..40).map(|at| {
        json!({"id": at, "question": "?", "options": ["x", "y"], "answer": "x", "label": label(at), "image": base64(1)})
    }).collect()
}

#[test]
fn a_gap_does_not_make_a_column_give_way_to_another() {
    for gap in [json!(""), Value::Null, json!("z")] {
        let mut rows = labelled(|_| json!("B"));
        rows[7]["answer"] = gap.clone();
        let (_folder, path) = with(rows);
        let problem = refusal(&path, &skipping());
        assert!(
            problem.contains("object 1: the answers of \"answer\" and \"label\" differ, \"x\" and \"B\"; --map answer=answer or --map answer=label"),
            "{gap}: {problem}"
        );
        // The first column is taken where both agree, and its gap is left out.
        let mut rows = labelled(|_| json!("A"));
        rows[7]["answer"] = gap.clone();
        let (_folder, path) = with(rows);
        let problem = refusal(&path, &SetArgs::default());
        assert!(
            problem.contains("1 of 40 rows are broken"),
            "{gap}: {problem}"
        );
        let questions = read(&open(&path, &skipping()).unwrap());
        assert_eq!(questions.len(), 39);
        assert!(questions.iter().all(|question| question.4 == "x"));
        // The command in the problem names the other column, which has no gap.
        assert_eq!(
            open(&path, &map("answer=label")).unwrap().questions().len(),
            40
        );
    }
}

#[test]
fn a_gap_in_the_second_column_hides_no_difference() {
    let rows = labelled(|at| if at == 3 { Value::Null } else { json!("B") });
    let (_folder, path) = with(rows);
    assert!(refusal(&path, &skipping()).contains("\"label\" differ"));
}

#[test]
fn yes_and_no_in_two_columns_are_compared_where_both_say_something() {
    let rows = |other: &str, gap: Value| -> Vec<Value> {
        (0..40).map(|at| {
            let answer = if at == 5 { gap.clone() } else { json!("yes") };
            json!({"id": at, "question": "Is it red?", "answer": answer, "label": other, "image": base64(1)})
        }).collect()
    };
    let (_folder, path) = with(rows("no", json!("")));
    assert!(refusal(&path, &skipping()).contains("\"answer\" and \"label\" differ"));
    // Numbers mean no and yes where the other column states so.
    let (_folder, path) = with(rows("1", json!("yes")));
    assert_eq!(read(&open(&path, &skipping()).unwrap())[0].4, "yes");
    let (_folder, path) = with(rows("0", json!("yes")));
    assert!(refusal(&path, &skipping()).contains("differ"));
    // Whether somebody was right is no answer of theirs.
    let (_folder, path) = with(vec![
        json!({"question": "What?", "answer": "a chair", "correct": true, "image": base64(1)}),
    ]);
    assert!(refusal(&path, &skipping()).contains("\"answer\" and \"correct\" differ"));
}

#[test]
fn a_printed_command_can_be_pasted_whatever_the_name_of_a_column() {
    for name in [
        "Correct Answer",
        "correct answer's",
        "correct $answer (1)",
        "correct, answer",
        "correct: answer",
    ] {
        let (_folder, path) = with(vec![
            json!({"question": "?", "options": ["x", "y", "z"], name: 1, "image": base64(1)}),
        ]);
        let args = map(&format!("answer={name}:"));
        let problem = refusal(&path, &args);
        let (_, command) = problem.split_once("; --map ").unwrap();
        let (command, _) = command.split_once(" or --map ").unwrap();
        let mut shell = std::process::Command::new("sh");
        let said = shell
            .args(["-c", &format!("printf %s {command}")])
            .output()
            .unwrap();
        let pasted = String::from_utf8(said.stdout).unwrap();
        assert_eq!(
            read(&open(&path, &map(&pasted)).unwrap())[0].4,
            "y",
            "{pasted}"
        );
    }
    // A name with a comma is one column, and not two.
    let (_folder, path) = with(vec![
        json!({"question": "?", "the, options": ["x", "y"], "answer": "y", "image": base64(1)}),
    ]);
    assert_eq!(
        read(&open(&path, &map("options=the, options")).unwrap())[0].4,
        "y"
    );
}
