//! Groups of questions that are scored together.

use std::fs;

use serde_json::{Map, Value, json};

use super::super::settings::LeaveOut;
use super::fixture::{png, row, set};
use super::{map, open, refusal};
use crate::{Dataset, SetArgs};

/// Six rows about three images, with numbers from 1 and two columns that form a group together. The last row is an open
/// question.
fn rows() -> Vec<Map<String, Value>> {
    (1..=6).map(|number| {
        let answer = if number == 6 { "seven" } else { "yes" };
        row(json!({
            "nr": number, "image": format!("{}.png", (number - 1) / 2), "question": format!("Is it {number}?"), "answer": answer,
            "set": format!("s{}", number / 4), "figure": if number == 3 { Value::Null } else { json!(number % 2) },
        }))
    }).collect()
}

fn made(rows: &[Map<String, Value>]) -> (tempfile::TempDir, std::path::PathBuf) {
    let (folder, path) = set("set.jsonl", rows);
    for name in ["0.png", "1.png", "2.png"] {
        fs::write(folder.path().join(name), png(name.as_bytes()[0])).unwrap();
    }
    (folder, path)
}

/// Name and size of the group of each question.
fn groups(dataset: &Dataset) -> Vec<Option<(&str, usize)>> {
    dataset
        .questions()
        .iter()
        .map(|question| {
            let group = question.group.as_ref();
            group.map(|group| (&*group.name, group.size))
        })
        .collect()
}

fn with(text: &str) -> SetArgs {
    SetArgs { open: Some(LeaveOut::Skip), ..map(text) }
}

#[test]
fn groups_follow_column_template_or_run_of_numbers() {
    let (_folder, path) = made(&rows());
    // There are no groups by default.
    assert_eq!(groups(&open(&path, &with("id=nr")).unwrap()), [None; 5]);
    let by_image = open(&path, &with("id=nr,group=image")).unwrap();
    assert_eq!(groups(&by_image)[..3], [Some(("0.png", 2)), Some(("0.png", 2)), Some(("1.png", 2))]);
    // The open question is left out, and its group is incomplete.
    assert_eq!(groups(&by_image)[4], Some(("2.png", 2)));
    let summary = by_image.summary().join("\n");
    assert!(
        summary.contains("group = image: 3 groups of 2 questions, 1 with questions that are left out, never complete"),
        "{summary}"
    );
    let template = open(&path, &with("id=nr,group={set}_{figure}")).unwrap();
    assert_eq!(groups(&template), [Some(("s0_1", 1)), Some(("s0_0", 1)), None, Some(("s1_0", 2)), Some(("s1_1", 1))]);
    let summary = template.summary().join("\n");
    assert!(
        summary.contains("group = {set}_{figure}: 4 groups of 1 to 2 questions, 3 of one question, 1 with questions that are left out, never complete; 1 question without a group"),
        "{summary}"
    );
    let alone = open(&path, &with("id=nr,group={nr:1}")).unwrap();
    let summary = alone.summary().join("\n");
    assert!(
        summary.contains(
            "5 groups of one question, so that the strict score is accuracy, 1 more of which every question is left out"
        ),
        "{summary}"
    );
    let from_one: Vec<&str> = vec!["0", "0", "1", "1", "2"];
    let runs = open(&path, &with("id=nr,group={nr:2 from 1}")).unwrap();
    let names: Vec<&str> = groups(&runs).into_iter().flatten().map(|(name, _)| name).collect();
    assert_eq!(names, from_one);
    let from_nought = open(&path, &with("id=nr,group={nr:2}")).unwrap();
    assert_ne!(groups(&from_nought), groups(&runs));
    assert!(from_nought.summary().join("\n").contains("about several images"));
}

#[test]
fn invalid_group_error_names_expected() {
    let (_folder, path) = made(&rows());
    for (text, message) in [
        ("group=figures", "names the column \"figures\", which is not there"),
        ("group={set}_{Figure}", "did you mean \"figure\"?"),
        ("group={set", "'}' is missing"),
        ("group={nr:two}", "{COLUMN:2} or {COLUMN:2 from 1} expected"),
        ("group={nr:0}", "{COLUMN:2} or {COLUMN:2 from 1} expected"),
    ] {
        let problem = refusal(&path, &with(text));
        assert!(problem.contains(message), "{text}: {problem}");
    }
}

fn foreign_question(id: &str) -> Map<String, Value> {
    let mut row = stored_question(id);
    row.remove("group_size");
    row.insert("level".to_owned(), json!("easy"));
    row
}

fn stored_question(id: &str) -> Map<String, Value> {
    row(json!({
        "id": id, "image": "0.png", "family": "f", "question": "?", "choices": ["x", "y"], "answer": "x", "group": "g", "group_size": 3,
    }))
}

#[test]
fn stored_questions_keep_their_groups() {
    // Some questions of a run, from a group of three.
    let (_folder, path) = made(&[stored_question("a"), stored_question("b")]);
    let dataset = open(&path, &SetArgs::default()).unwrap();
    assert_eq!(groups(&dataset), [Some(("g", 3)); 2]);
    let off = open(&path, &map("group=")).unwrap();
    assert_eq!(groups(&off), [None; 2]);
    // A column with this name in a foreign set does not make groups.
    let (_folder, path) = made(&[foreign_question("a"), foreign_question("b")]);
    assert_eq!(groups(&open(&path, &SetArgs::default()).unwrap()), [None; 2]);
}

fn open_preset(name: &str, path: &std::path::Path, args: &SetArgs) -> Dataset {
    let place = crate::parse_data_source(&format!("{name}:{}", path.display())).unwrap();
    place.open(None, args).unwrap()
}

fn mme_question(number: usize) -> Map<String, Value> {
    row(json!({
        "question_id": format!("{}.png", number / 2), "image": format!("{}.png", number / 2), "question": format!("Is it {number}?"),
        "answer": "Yes", "category": "colour",
    }))
}

#[test]
fn presets_have_groups() {
    let rows: Vec<Map<String, Value>> = (0..4).map(mme_question).collect();
    let (_folder, path) = made(&rows);
    let dataset = open_preset("mme", &path, &SetArgs::default());
    assert_eq!(groups(&dataset)[0], Some(("colour_0.png", 2)));
    let own = open_preset("mme", &path, &map("group=question"));
    assert_eq!(groups(&own)[0], Some(("Is it 0?", 1)));
    // Without the column, a note says that there are no groups.
    let without = rows.into_iter().map(|mut row| {
        row.remove("question_id");
        row
    });
    let (_folder, path) = made(&without.collect::<Vec<_>>());
    let dataset = open_preset("mme", &path, &SetArgs::default());
    assert_eq!(groups(&dataset), [None; 4]);
    let summary = dataset.summary().join("\n");
    assert!(summary.contains("no groups: MME scores questions together by {category}_{question_id} or"), "{summary}");
}
