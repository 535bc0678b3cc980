//! Rows with several images.

use serde_json::{Map, Value, json};

use super::super::settings::SeveralImages;
use super::fixture::{bytes, row, set};
use super::{SetArgs, open, refusal};

fn send() -> SetArgs {
    SetArgs { multi_image: Some(SeveralImages::Send), ..SetArgs::default() }
}

/// Id and text of a question, and the name and the red value of each of its images.
type SeenQuestion = (String, String, Vec<(String, u8)>);

/// Each question with the red values of its images, from every format with embedded images.
fn shown(rows: &[Map<String, Value>]) -> Vec<SeenQuestion> {
    let mut all = ["set.parquet", "set.json", "set.jsonl"].map(|name| {
        let (_folder, path) = set(name, rows);
        let dataset = open(&path, &send()).unwrap();
        let mut questions: Vec<_> = dataset
            .questions()
            .iter()
            .map(|question| {
                let frames = dataset.shown_frames(&question.frame).iter().map(|frame| {
                    let picture = dataset.picture(frame).unwrap().decode().unwrap();
                    (frame.0.clone(), picture.samples()[0])
                });
                (question.id.0.clone(), question.text.clone(), frames.collect())
            })
            .collect();
        questions.sort();
        questions
    });
    assert!(all.iter().all(|questions| *questions == all[0]));
    std::mem::take(&mut all[0])
}

fn rows() -> Vec<Map<String, Value>> {
    let fields = json!([
        {"id": "7", "question": "Is <image 1> or <image 2> red?", "choices": ["x", "y"], "answer": "x", "image_1": bytes(1), "image_2": bytes(2)},
        {"id": "3", "question": "<image 1>?", "choices": ["x", "y"], "answer": "y", "image_1": bytes(2), "image_2": null},
        {"id": "40", "question": "Alike?", "choices": ["x", "y"], "answer": "y", "image_1": bytes(5), "image_2": bytes(5)},
    ]);
    fields.as_array().unwrap().iter().cloned().map(row).collect()
}

fn image(name: &str, red: u8) -> (String, u8) {
    (name.to_owned(), red)
}

#[test]
fn images_are_named_by_the_lowest_row_id() {
    let expected = [
        ("3".to_owned(), "?".to_owned(), vec![image("3", 2)]),
        ("40".to_owned(), "Alike?".to_owned(), vec![image("40#1", 5), image("40#1", 5)]),
        ("7".to_owned(), "Is <image 1> or <image 2> red?".to_owned(), vec![image("7#1", 1), image("3", 2)]),
    ];
    assert_eq!(shown(&rows()), expected);
    let backwards: Vec<_> = rows().into_iter().rev().collect();
    assert_eq!(shown(&backwards), expected);
}

#[test]
fn id_that_looks_like_an_image_number_does_not_clash() {
    let mut rows = rows();
    rows.push(row(
        json!({"id": "7#1", "question": "Red?", "choices": ["x", "y"], "answer": "x", "image_1": bytes(9), "image_2": null}),
    ));
    let found = shown(&rows);
    let images = |id: &str| &found.iter().find(|question| question.0 == id).unwrap().2;
    assert_eq!([images("7#1")[0].1, images("7")[0].1], [9, 1]);
    assert_ne!(images("7#1")[0].0, images("7")[0].0);
}

#[test]
fn content_ids_depend_on_all_images() {
    let fields = json!([
        {"question": "?", "choices": ["x", "y"], "answer": "x", "image": [bytes(1), bytes(2)]},
        {"question": "?", "choices": ["x", "y"], "answer": "x", "image": [bytes(1), bytes(3)]},
        {"question": "?", "choices": ["x", "y"], "answer": "x", "image": [bytes(2), bytes(1)]},
        {"question": "?", "choices": ["x", "y"], "answer": "y", "image": [bytes(1)]},
    ]);
    let rows: Vec<_> = fields.as_array().unwrap().iter().cloned().map(row).collect();
    let found = shown(&rows);
    assert_eq!(found.len(), 4);
    assert!(found.iter().all(|question| question.0.len() == 12));
}

#[test]
fn mark_without_image_makes_a_bad_row() {
    let mut rows = rows();
    let more = (0..60).map(|id| {
        json!({"id": format!("m{id}"), "question": "?", "choices": ["x", "y"], "answer": "x", "image_1": bytes(id), "image_2": null})
    });
    rows.extend(more.map(row));
    rows.push(row(
        json!({"id": "9", "question": "Is <image 3> red?", "choices": ["x", "y"], "answer": "x", "image_1": bytes(1), "image_2": bytes(2)}),
    ));
    let (_folder, path) = set("set.parquet", &rows);
    let problem = refusal(&path, &send());
    assert!(
        problem.contains("1 of 64 rows are broken")
            && problem.contains("\"<image 3>\" is not an image of the row, which shows 2"),
        "{problem}"
    );
    let args = SetArgs { bad: Some(crate::SkipBad::default()), ..send() };
    let summary = open(&path, &args).unwrap().summary().join("\n");
    assert!(summary.contains("2 questions show 2 images, all in one request"), "{summary}");
}
