//! Letters in the text of a question (options, or labels of things in the image), and objects with options by letter.

use serde_json::{Value, json};

use super::fixture::{base64, row, set};
use super::{Read, map, open, read, refusal};
use crate::ready_made::SetArgs;

fn asked(question: &str, answer: impl Into<Value>) -> Value {
    let answer = answer.into();
    json!({"question": question, "answer": answer, "image": base64(1)})
}

fn with(rows: Vec<Value>) -> (tempfile::TempDir, std::path::PathBuf) {
    let rows: Vec<_> = rows.into_iter().map(row).collect();
    set("set.json", &rows)
}

#[test]
fn line_after_last_option_belongs_to_question() {
    let text = "Which colour?\n(A) red\n(B) green\n(C) pink\n(D) blue\n";
    for (ending, question) in
        [("Answer with the letter.", "Which colour?"), ("Look twice.", "Which colour?\nLook twice.")]
    {
        let (_folder, path) = with(vec![asked(&format!("{text}{ending}"), json!("D"))]);
        let found = read(&open(&path, &SetArgs::default()).unwrap());
        assert_eq!(found[0].3, ["red", "green", "pink", "blue"]);
        assert_eq!((found[0].2.as_str(), found[0].4.as_str()), (question, "blue"));
    }
    let kept = SetArgs { keep_instructions: true, ..SetArgs::default() };
    let (_folder, path) = with(vec![asked(&format!("{text}Answer with the letter."), json!("D"))]);
    let found = read(&open(&path, &kept).unwrap());
    assert_eq!((found[0].2.as_str(), found[0].4.as_str()), ("Which colour?\nAnswer with the letter.", "blue"));
    let (_folder, path) = with(vec![asked("Which? (A) red (B) blue Answer with care", json!("B"))]);
    let problem = refusal(&path, &SetArgs::default());
    assert!(problem.contains("object 1: it is not clear where the last option ends"), "{problem}");
}

#[test]
fn letters_of_things_in_the_image_are_not_options() {
    let rows = vec![
        asked("Is person (A) left of person (B)?", json!("yes")),
        asked("Is person (A) left of person (B) or near?", json!("no")),
        asked("Is it a cup?", json!("no")),
    ];
    let (_folder, path) = with(rows);
    let found = read(&open(&path, &SetArgs::default()).unwrap());
    let texts: Vec<(&str, &str)> = found.iter().map(|read| (read.2.as_str(), read.4.as_str())).collect();
    assert_eq!(
        texts,
        [
            ("Is person (A) left of person (B)?", "yes"),
            ("Is person (A) left of person (B) or near?", "no"),
            ("Is it a cup?", "no"),
        ]
    );
    // “Yes” and “no” with letters are options.
    let (_folder, path) = with(vec![asked("Is it? (A) no (B) yes", json!("yes"))]);
    assert_eq!(read(&open(&path, &SetArgs::default()).unwrap())[0].3, ["no", "yes"]);
}

#[test]
fn numbers_do_not_identify_lettered_options() {
    let (_folder, path) = with(vec![asked("Which? (A) red (B) blue (C) pink", json!(0))]);
    let problem = refusal(&path, &SetArgs::default());
    assert!(problem.contains("not one of the options"), "{problem}");
    assert_eq!(read(&open(&path, &map("answer=answer:index0")).unwrap())[0].4, "red");
}

#[test]
fn empty_options_map_keeps_the_whole_question() {
    let text = "Which is redder? (A) the cup (B) the ball";
    let (_folder, path) = with(vec![asked(text, json!("yes"))]);
    let found = read(&open(&path, &map("options=")).unwrap());
    assert_eq!((found[0].2.as_str(), found[0].3.as_slice()), (text, &["yes".to_owned(), "no".to_owned()][..]));
    let (_folder, path) = with(vec![asked(text, json!("A"))]);
    assert!(refusal(&path, &map("options=")).contains("no options in 1 of 1 rows"));
    assert_eq!(read(&open(&path, &SetArgs::default()).unwrap())[0].4, "the cup");
}

fn open_with_options(options: &Value) -> Result<Read, String> {
    let (_folder, path) = with(vec![json!({"question": "?", "options": options, "answer": "B", "image": base64(1)})]);
    open(&path, &SetArgs::default()).map(|dataset| read(&dataset)[0].clone()).map_err(|e| e.to_string())
}

#[test]
fn object_with_letter_keys_has_options() {
    for options in [
        json!({"A": "red", "B": "green", "C": null}),
        json!({"b": "green", "a": "red"}),
        json!("{\"B\": \"green\", \"A\": \"red\"}"),
        json!("{'A': 'red', 'B': 'green', 'C': None}"),
        json!({"A": "A. red", "B": "B. green"}),
    ] {
        let found = open_with_options(&options).unwrap();
        assert_eq!(
            (found.3.as_slice(), found.4.as_str()),
            (&["red".to_owned(), "green".to_owned()][..], "green"),
            "{options}"
        );
    }
    for (options, message) in [
        (json!({"A": "red", "C": "green"}), "have C where B is expected"),
        (json!({"B": "red", "C": "green"}), "have B where A is expected"),
        (json!({"A": "red", "a": "green"}), "have A where B is expected"),
        (json!({"A": "red", "which": "green"}), "have the name \"which\""),
        (json!({"A": "red", "B": ["green"]}), "hold no text at B"),
    ] {
        let problem = open_with_options(&options).unwrap_err();
        assert!(problem.contains(message) && problem.contains("object 1"), "{options}: {problem}");
    }
}

#[test]
fn text_list_with_one_image_is_one_image() {
    for form in ["tsv", "csv", "json", "parquet"] {
        let embedded = [format!("[\"{}\"]", base64(4)), format!("['{}']", base64(4))];
        let paths = ["[\"images/1.png\"]".to_owned(), "['images/1.png']".to_owned()];
        for image in embedded.into_iter().chain(paths) {
            let (folder, path) = set(
                &format!("set.{form}"),
                &[row(json!({"question": "?", "options": "['x', 'y']", "answer": "x", "image": image}))],
            );
            std::fs::create_dir(folder.path().join("images")).unwrap();
            std::fs::write(folder.path().join("images/1.png"), super::fixture::png(4)).unwrap();
            let dataset = open(&path, &SetArgs::default()).unwrap_or_else(|e| panic!("{form} {image}: {e}"));
            assert_eq!(read(&dataset)[0].5, 4, "{form}");
        }
    }
    let (_folder, path) = set(
        "set.tsv",
        &[row(json!({"question": "?", "options": "['x', 'y']", "answer": "x", "image": "['1.png', '2.png']"}))],
    );
    let args = SetArgs { bad: Some(crate::SkipBad::default()), ..SetArgs::default() };
    assert!(refusal(&path, &args).contains("1 of 1 rows show 2 images"));
}
