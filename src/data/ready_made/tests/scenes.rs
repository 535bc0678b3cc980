//! Scenes of the frames of a set.

use std::fs;
use std::path::PathBuf;

use serde_json::{Map, Value, json};

use super::fixture::{png, row, set};
use super::{map, open, refusal};
use crate::{DataSource, Dataset, SetArgs};

/// Six rows about three images, with a column of scenes.
fn rows(column: &str, scenes: [Value; 6]) -> Vec<Map<String, Value>> {
    scenes.into_iter().enumerate().map(|(number, scene)| {
        row(json!({
            "id": format!("q{number}"), "image": format!("{}.png", number / 2), "question": format!("Is it {number}?"),
            "choices": ["yes", "no"], "answer": "yes", column: scene,
        }))
    }).collect()
}

fn made(name: &str, rows: &[Map<String, Value>]) -> (tempfile::TempDir, PathBuf) {
    let (folder, path) = set(name, rows);
    for name in ["0.png", "1.png", "2.png"] {
        fs::write(folder.path().join(name), png(name.as_bytes()[0])).unwrap();
    }
    (folder, path)
}

/// Scene of each frame with a question.
fn scenes(dataset: &Dataset) -> Vec<String> {
    dataset.questions().iter().step_by(2).map(|question| dataset.scene(&question.frame)).collect()
}

const TWO: [&str; 6] = ["a", "a", "a", "a", "b", "b"];

#[test]
fn scene_column_is_read_in_every_format() {
    for name in ["set.jsonl", "set.json", "set.tsv", "set.csv", "set.parquet"] {
        let (_folder, path) = made(name, &rows("Scene", TWO.map(|scene| json!(scene))));
        let read = open(&path, &SetArgs::default()).unwrap();
        assert_eq!(scenes(&read), ["a", "a", "b"], "{name}");
        let summary = read.summary().join("\n");
        assert!(summary.contains("scene = Scene: 2 scenes of 3 images"), "{summary}");
    }
    let (_folder, path) = made("set.jsonl", &rows("house", [3, 3, 3, 3, 4, 4].map(|n| json!(n))));
    assert_eq!(scenes(&open(&path, &SetArgs::default()).unwrap()), ["", "", ""]);
    assert_eq!(scenes(&open(&path, &map("scene=house")).unwrap()), ["3", "3", "4"]);
}

#[test]
fn questions_assign_scenes_to_frames() {
    let rows = rows("scene", TWO.map(|scene| json!(scene)));
    let rows: Vec<Map<String, Value>> = rows
        .into_iter()
        .map(|mut row| {
            let image = row.remove("image").unwrap();
            row.insert("frame".to_owned(), image);
            row
        })
        .collect();
    let (folder, _path) = made("questions.jsonl", &rows);
    let place = DataSource::Path(folder.path().to_owned());
    let read = place.open(None, &SetArgs::default()).unwrap();
    assert_eq!(scenes(&read), ["a", "a", "b"]);
    // The set is still in this program's own format.
    assert_eq!(read.printed_summary().count(), 0);
}

#[test]
fn some_frames_may_have_no_scene() {
    let some = [json!("a"), json!("a"), json!(" "), Value::Null, json!("b"), Value::Null];
    let (_folder, path) = made("set.jsonl", &rows("scene", some));
    let read = open(&path, &map("id=id")).unwrap();
    assert_eq!(scenes(&read), ["a", "", "b"]);
    let summary = read.summary().join("\n");
    assert!(summary.contains("2 scenes of 3 images, 1 image without a scene"), "{summary}");
}

#[test]
fn contradictory_scenes_are_refused_or_ignored() {
    let two = ["a", "b", "a", "a", "b", "b"].map(|scene| json!(scene));
    let (_folder, path) = made("set.jsonl", &rows("scene", two));
    let problem = refusal(&path, &SetArgs::default());
    assert!(
        problem.contains("line 2: the image \"0.png\" is of the scene \"b\" here and of \"a\" before; an image has one scene (--map scene=")
            && problem.len() < 250,
        "{problem}"
    );
    assert_eq!(scenes(&open(&path, &map("scene=")).unwrap()), ["", "", ""]);
    // A column of a foreign set that has this name by coincidence.
    let mut foreign = rows("scene", ["a", "b", "a", "a", "b", "b"].map(|scene| json!(scene)));
    for row in &mut foreign {
        row.insert("source".to_owned(), json!("web"));
    }
    let (_folder, path) = made("set.jsonl", &foreign);
    let read = open(&path, &SetArgs::default()).unwrap();
    assert_eq!(scenes(&read), ["", "", ""]);
    let summary = read.summary().join("\n");
    assert!(summary.contains("scene is not used as the scene: the image \"0.png\" is of"), "{summary}");
}
