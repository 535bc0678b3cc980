//! Sets of users and recent benchmarks: read, or refused with a map that reads them.

use serde_json::{Map, Value, json};

use super::fixture::{base64, bytes, png, row, set};
use super::{map, open, read, refusal};
use crate::ready_made::SetArgs;

/// The `--map` flag in an error message, as a user pastes it.
fn map_in(problem: &str) -> SetArgs {
    let (_, flag) = problem.split_once("--map ").unwrap();
    let value = flag.split([' ', '\n']).next().unwrap();
    map(value.trim_matches(['\'', ',', ';', '.']))
}

/// Choices and true choice of the first question.
fn first(path: &std::path::Path, args: &SetArgs) -> (String, Vec<String>, String) {
    let (_, _, text, choices, truth, _) = read(&open(path, args).unwrap()).swap_remove(0);
    (text, choices, truth)
}

fn words(words: &[&str]) -> Vec<String> {
    words.iter().map(ToString::to_string).collect()
}

#[test]
fn error_for_conversations_suggests_a_map() {
    let question = "<image>\nWhich room?\nA. hall\nB. attic";
    for turns in [
        json!([{"from": "human", "value": question}, {"from": "gpt", "value": "B"}]),
        json!([
            {"role": "system", "content": "Be brief."},
            {"role": "user", "content": [{"type": "text", "text": question}]},
            {"role": "assistant", "content": "B"},
        ]),
    ] {
        for (form, cell) in [("json", turns.clone()), ("csv", json!(turns.to_string()))] {
            let rows = [row(json!({"id": 1, "image": base64(9), "turns": cell}))];
            let (_folder, path) = set(&format!("set.{form}"), &rows);
            let problem = refusal(&path, &SetArgs::default());
            assert!(problem.contains("conversations"), "{problem}");
            let expected = ("Which room?".to_owned(), words(&["hall", "attic"]), "attic".to_owned());
            assert_eq!(first(&path, &map_in(&problem)), expected, "{form}: {problem}");
            // A list is neither an empty question nor a question as JSON text.
            let problem = refusal(&path, &map("question=turns,answer=id"));
            assert!(!problem.contains("is empty") && problem.contains("--map question=turns."), "{problem}");
        }
    }
}

#[test]
fn empty_question_map_asks_the_question_in_the_image() {
    let rows = [row(json!({"id": "1", "image": base64(9), "options": "['x', 'y']", "answer": "B", "subject": "Art"}))];
    let (_folder, path) = set("set.json", &rows);
    let problem = refusal(&path, &SetArgs::default());
    assert!(problem.contains("stands in the image"), "{problem}");
    let (text, choices, truth) = first(&path, &map_in(&problem));
    assert_eq!(text, "Answer the question in the image.");
    assert_eq!((choices, truth.as_str()), (words(&["x", "y"]), "y"));
}

#[test]
fn question_column_with_unknown_name_is_suggested() {
    let rows = [row(
        json!({"bild": "a text", "frage": "What is it?", "image": base64(9), "options": ["x", "y"], "answer": "x"}),
    )];
    let (_folder, path) = set("set.json", &rows);
    let problem = refusal(&path, &SetArgs::default());
    assert_eq!(first(&path, &map_in(&problem)).0, "What is it?", "{problem}");
}

fn question_with_image_in(column: &str) -> Map<String, Value> {
    let mut fields =
        row(json!({"pid": "1", "question": "?", "image": "images/1.jpg", "choices": ["x", "y"], "answer": "y"}));
    fields.insert(column.to_owned(), bytes(77));
    fields
}

#[test]
fn image_data_is_preferred_to_a_path() {
    let (_folder, path) = set("set.parquet", &[question_with_image_in("decoded_image")]);
    assert_eq!(read(&open(&path, &SetArgs::default()).unwrap())[0].5, 77);
    // A column without a known name is suggested.
    let (_folder, path) = set("set.parquet", &[question_with_image_in("pixels")]);
    let problem = refusal(&path, &SetArgs::default());
    assert_eq!(read(&open(&path, &map_in(&problem)).unwrap())[0].5, 77, "{problem}");
}

fn question_with_index_in(column: &str, at: usize) -> Map<String, Value> {
    let mut fields = row(
        json!({"question_id": at.to_string(), "question": "?", "image": base64(at as u8), "choices": ["x", "y", "z"], "answer": ""}),
    );
    fields.insert(column.to_owned(), json!(at));
    fields
}

#[test]
fn index_answers_are_read_or_suggested() {
    for form in ["json", "csv", "tsv", "parquet"] {
        let rows = [question_with_index_in("correct_choice_idx", 2), question_with_index_in("correct_choice_idx", 0)];
        let (_folder, path) = set(&format!("set.{form}"), &rows);
        let args = if form == "json" { SetArgs::default() } else { map("question=question") };
        match open(&path, &args) {
            Ok(dataset) => assert_eq!(read(&dataset)[0].4, "z", "{form}"),
            Err(e) => panic!("{form}: {e}"),
        }
    }
    let rows = [question_with_index_in("richtig", 2), question_with_index_in("richtig", 0)];
    let (_folder, path) = set("set.json", &rows);
    let problem = refusal(&path, &SetArgs::default());
    assert!(problem.contains("--map answer=richtig:index0"), "{problem}");
    assert_eq!(first(&path, &map_in(&problem)).2, "z");
}

#[test]
fn template_has_a_number_width() {
    let fields = row(json!({"image_id": 42, "question": "?", "options": ["x", "y"], "answer": "x"}));
    let (folder, path) = set("set.json", &[fields]);
    std::fs::create_dir(folder.path().join("val")).unwrap();
    std::fs::write(folder.path().join("val/000000000042.png"), png(5)).unwrap();
    for template in ["val/{image_id:012}.png", "val/{image_id:012d}.png"] {
        let args = map(&format!("image={template}"));
        assert_eq!(read(&open(&path, &args).unwrap())[0].5, 5, "{template}");
    }
    for (template, message) in [
        ("val/{image_id:099}.png", "a width of at most 64"),
        ("val/{image_id:x}.png", "image_id:x"),
        ("val/{image_id", "'}' is missing"),
    ] {
        let problem = refusal(&path, &map(&format!("image={template}")));
        assert!(problem.contains(message), "{problem}");
    }
}

#[test]
fn options_are_trimmed_and_on_one_line() {
    let clean = words(&["red", "dark blue"]);
    for fields in [
        json!({"options": ["red \n", "dark\r\nblue\t"], "answer": "red"}),
        json!({"A": " red\r\n", "B": "dark\nblue ", "answer": "A"}),
        json!({"options": {"A": "red ", "B": "dark \n blue"}, "answer": "A"}),
        json!({"options": ["A. red \n", "B. dark\nblue"], "answer": "red "}),
    ] {
        let mut fields = row(fields);
        fields.insert("question".to_owned(), json!("?"));
        fields.insert("image".to_owned(), json!(base64(9)));
        let (_folder, path) = set("set.json", &[fields]);
        let (_, choices, truth) = first(&path, &SetArgs::default());
        assert_eq!((choices, truth.as_str()), (clean.clone(), "red"));
    }
}

/// Values that are too long for a message.
#[test]
fn messages_excerpt_long_values() {
    let long = "lorem ipsum ".repeat(500);
    let unbroken = "x".repeat(5000);
    let good = json!({"id": "1", "question": "?", "image": base64(9), "options": ["x", "y"], "answer": "x"});
    let cut = base64(9).repeat(20)[..1301].to_owned();
    for (column, value) in [
        ("answer", json!(long)),
        ("options", json!([long, unbroken])),
        ("options", json!(long)),
        ("options", json!({"A": long, unbroken.clone(): "y"})),
        ("image", json!(cut)),
        ("image", json!(format!("/9j/{cut}"))),
        ("image", json!(format!("data:image/png;base64,{cut}"))),
        ("image", json!(unbroken)),
        ("image", json!(long)),
        ("image", json!(format!("../{}", "a/".repeat(600)))),
        ("question", json!([long, {"a": unbroken}])),
        ("id", Value::Null),
    ] {
        let mut bad = row(good.clone());
        bad.insert(column.to_owned(), value);
        for args in [SetArgs::default(), map("question=question,image=image")] {
            let (_folder, path) = set("set.json", &[bad.clone()]);
            let problem = refusal(&path, &args);
            let longest = problem.lines().map(|line| line.chars().count()).max();
            assert!(longest <= Some(620) && problem.len() < 2000, "{column}: {problem}");
            assert!(!(column == "image" && problem.contains("no such file")), "{problem}");
        }
    }
}
