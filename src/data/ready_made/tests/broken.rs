//! Broken files and rows: errors name them, and nothing panics.

use std::fs;

use serde_json::{Map, Value, json};

use super::fixture::{base64, bytes, row, set};
use super::{open, refusal};
use crate::ready_made::SetArgs;
use darkqa_base::types::FrameId;

/// Values of unexpected types.
fn damages() -> Vec<Value> {
    vec![
        Value::Null,
        json!(""),
        json!(7),
        json!(true),
        json!([]),
        json!([[["x"]]]),
        json!({"bytes": null, "path": null}),
        json!({"a": {"b": 1}}),
        json!("x".repeat(1 << 20)),
        json!("no base64! ".repeat(9)),
        json!("\u{202e}\u{0}\u{1b}[31m"),
    ]
}

fn good(id: i64) -> Map<String, Value> {
    row(
        json!({"id": id, "question": "What is it?", "options": ["x", "y"], "answer": "x", "category": "c", "hint": "h", "image": base64(1)}),
    )
}

#[test]
fn row_with_any_damaged_column_is_handled() {
    for column in ["id", "question", "options", "answer", "category", "hint", "image"] {
        for damage in damages() {
            for form in ["json", "jsonl", "csv", "tsv"] {
                let mut bad = good(2);
                let is_plain = !damage.is_object() || form.starts_with("json");
                if !is_plain {
                    continue;
                }
                bad.insert(column.to_owned(), damage.clone());
                let (_folder, path) = set(&format!("set.{form}"), &[good(1), bad, good(3)]);
                match open(&path, &SetArgs::default()) {
                    Ok(dataset) => {
                        for frame in dataset.frames() {
                            let shown = dataset.picture(frame).and_then(|picture| picture.decode());
                            if let Err(e) = shown {
                                assert!(e.to_string().contains("set."), "{column} {form}: {e}");
                            }
                        }
                    }
                    Err(e) => {
                        let text = e.to_string();
                        assert!(text.contains("set.") && text.len() < 3000, "{column} {form}: {text}");
                    }
                }
            }
        }
    }
}

#[test]
fn damaged_parquet_file_is_an_error() {
    let rows: Vec<_> = (0..20).map(|id| row(json!({"id": id, "question": "?", "options": ["x", "y"], "answer": "x", "image": {"bytes": base64(id as u8), "path": null}}))).collect();
    let (_folder, path) = set("set.parquet", &rows);
    let whole = fs::read(&path).unwrap();
    for cut in [0, 3, 4, 100, whole.len() / 2, whole.len() - 1] {
        let copy = path.with_file_name(format!("cut{cut}.parquet"));
        fs::write(&copy, &whole[..cut]).unwrap();
        let problem = refusal(&copy, &SetArgs::default());
        assert!(problem.contains("not a whole Parquet file"), "{cut}: {problem}");
    }
    for at in (0..whole.len()).step_by(29) {
        let copy = path.with_file_name(format!("flipped{at}.parquet"));
        let mut bytes = whole.clone();
        bytes[at] ^= 0x55;
        fs::write(&copy, &bytes).unwrap();
        // Any result is allowed, but no panic. A damaged byte of an image is found only when it is decoded.
        if let Ok(dataset) = open(&copy, &SetArgs::default()) {
            for frame in dataset.frames() {
                let _ = dataset.picture(frame).and_then(|picture| picture.decode());
            }
        }
    }
}

#[test]
fn errors_in_text_files_name_the_line() {
    let (folder, _) = set("set.json", &[]);
    for (name, content, message) in [
        ("a.jsonl", &b"{\"id\": 1}\n{\n"[..], "a.jsonl, line 2: EOF"),
        ("a.json", b"[{\"id\": 1}, {\"id\"", "the file ends at byte"),
        ("b.json", b"3", "neither a list nor an object"),
        ("c.json", b"[1, 2]", "is not an object"),
        ("a.tsv", b"index\tquestion\n1\ta\tstray\n", "a.tsv, line 2: 3 cells, but the header has 2"),
        (
            "b.tsv",
            b"index\tquestion\n1\ta\xff\n",
            "b.tsv, line 2: column \"question\": byte 2 of the cell is not UTF-8",
        ),
        ("c.csv", b"question,question\na,b\n", "two columns are called"),
        ("d.csv", b"", "no questions in it"),
        (
            "e.parquet",
            b"version https://git-lfs.github.com/spec/v1\noid sha256:1\nsize 5\n",
            "only its pointer: git lfs pull",
        ),
        ("f.txt", b"x", "not a file of questions"),
    ] {
        let path = folder.path().join(name);
        fs::write(&path, content).unwrap();
        let problem = refusal(&path, &SetArgs::default());
        assert!(problem.contains(message), "{name}: {problem}");
    }
}

fn question(id: usize, image: &str) -> Map<String, Value> {
    row(json!({"id": id, "question": "?", "options": ["x", "y"], "answer": "x", "image": image}))
}

#[test]
fn unusable_images_are_left_out_with_skip_bad() {
    for image in ["none.png", &"QUJD".repeat(40), &"QUJD".repeat(200)[1..]] {
        let whole = base64(1);
        let rows: Vec<_> = (0..40).map(|id| question(id, if id == 7 { image } else { &whole })).collect();
        let (_folder, path) = set("set.tsv", &rows);
        let skip = SetArgs { bad: Some(crate::SkipBad::default()), ..SetArgs::default() };
        let dataset = open(&path, &skip).unwrap();
        assert_eq!(dataset.questions().len(), 39, "{image}");
    }
    let (_folder, path) = set("set.tsv", &[question(1, &"QUJD".repeat(2000)[1..])]);
    let problem = refusal(&path, &SetArgs::default());
    assert!(problem.contains("base64 that is cut or damaged"), "{problem}");
    assert!(problem.len() < 400, "{problem}");
    assert!(problem.ends_with("; --skip bad leaves such rows out"));
}

#[test]
fn skip_bad_is_not_advised_twice() {
    let (_folder, path) = set("set.tsv", &[question(1, &"QUJD".repeat(2000)[1..])]);
    let skip = SetArgs { bad: Some(crate::SkipBad::default()), ..SetArgs::default() };
    let problem = refusal(&path, &skip);
    assert!(!problem.contains("leaves such rows out"), "{problem}");
}

#[test]
fn missing_quotes_in_csv_are_named() {
    let row = |id: &str, question: &str| format!("{id},a.png,{question},x,y,A\n");
    let head = "id,image,question,A,B,answer\n".to_owned();
    let (good, open_quote) = (row("1", "Which?"), row("2", "\"Which?"));
    for (rows, is_refused) in [
        ([&*good, &open_quote, &good], true),
        ([&open_quote, &good, &open_quote], true),
        ([&good, &row("2", "\"Which \"\"one\"\",\nor not?\""), &good], false),
        ([&good, &row("2", "A 5\" screen?"), &good], false),
        ([&good, &row("2", "\"Which\" one?"), &good], false),
    ] {
        let (_folder, path) = set("set.csv", &[]);
        std::fs::write(&path, head.clone() + &rows.concat()).unwrap();
        let problem = refusal(&path, &SetArgs::default());
        let is_named = problem.contains("its closing quote is missing");
        assert_eq!(is_named, is_refused, "{rows:?}: {problem}");
    }
}

#[test]
fn csv_may_have_tabs() {
    let (_folder, path) = set("set.tsv", &[question(1, &base64(1))]);
    let csv = path.with_extension("csv");
    std::fs::rename(path, &csv).unwrap();
    assert_eq!(open(&csv, &SetArgs::default()).unwrap().questions().len(), 1);
}

#[test]
fn lines_of_windows_are_counted() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("set.csv");
    let rows = ["image,question,A,B,answer", "a.png,\"Is it\r\nred?\",x,y,A", "a.png,Is it?,x,x,B"];
    for ending in ["\n", "\r\n"] {
        std::fs::write(&path, rows.join(ending) + ending).unwrap();
        let problem = refusal(&path, &SetArgs::default());
        assert!(problem.contains("the first: line 4: "), "{problem}");
    }
}

#[test]
fn backslash_in_path_is_named() {
    let (folder, path) = set("set.json", &[question(1, "images\\a.png")]);
    std::fs::create_dir(folder.path().join("images")).unwrap();
    std::fs::write(folder.path().join("images/a.png"), "").unwrap();
    let problem = refusal(&path, &SetArgs::default());
    assert!(problem.contains("; it is named \"images/a.png\": write this in the data;"), "{problem}");
}

#[test]
fn message_names_the_file_once() {
    let broken = question(1, "none.png");
    let other = row(json!({"id": 2, "question": "?", "options": ["x", "y"], "answer": "z", "image": base64(1)}));
    let skip = SetArgs { bad: Some(crate::SkipBad::default()), ..SetArgs::default() };
    for bad in [broken, other] {
        let (folder, path) = set("set.json", &[question(3, &base64(2)), bad]);
        for place in [&path, folder.path()] {
            let problem = refusal(place, &skip);
            assert_eq!(problem.matches("set.json").count(), 1, "{problem}");
        }
    }
}

#[test]
fn nan_in_json_is_named() {
    for name in ["set.jsonl", "set.json"] {
        for number in ["NaN", "-Infinity"] {
            let (_folder, path) = set(name, &[question(7, "a.png")]);
            let text = std::fs::read_to_string(&path).unwrap();
            std::fs::write(&path, text.replace('7', number)).unwrap();
            let problem = refusal(&path, &SetArgs::default());
            assert!(problem.contains("write null"), "{problem}");
        }
    }
}

fn by_index(index: u8) -> Map<String, Value> {
    row(
        json!({"id": index, "question": "?", "options": ["x", "y"], "correct_choice_idx": index, "image": base64(1 + index)}),
    )
}

/// As in A-OKVQA, MathVista and LLaVA's lists of conversations.
#[test]
fn columns_by_index_and_in_lists_are_read() {
    let (_folder, path) = set("set.jsonl", &[by_index(0), by_index(1)]);
    let dataset = open(&path, &SetArgs::default()).unwrap();
    assert_eq!(dataset.questions()[1].choices.truth(), Some(1));
    let turns = json!([{"value": "Which? (A) x (B) y"}, {"value": "B"}]);
    let listed = row(json!({"id": 1, "conversations": turns, "image": base64(1)}));
    let (_folder, path) = set("set.jsonl", &[listed]);
    let map = "question=conversations.0.value,answer=conversations.1.value";
    let args = SetArgs { map: vec![map.parse().unwrap()], ..SetArgs::default() };
    let dataset = open(&path, &args).unwrap();
    assert_eq!(dataset.questions()[0].choices.truth(), Some(1));
    let with_pixels = row(
        json!({"id": 1, "question": "?", "options": ["x", "y"], "answer": "x", "image": "none.png", "pixels": bytes(1)}),
    );
    let (_folder, path) = set("set.parquet", &[with_pixels]);
    let problem = refusal(&path, &SetArgs::default());
    assert!(problem.contains("image=pixels"), "{problem}");
}

#[test]
fn outside_paths_and_invalid_images_are_errors() {
    for (image, message) in [
        ("../secret.png", "lies outside"),
        ("/etc/hostname", "lies outside"),
        ("https://example.org/0.png", "download them first"),
        ("none.png", "no such file"),
        ("17", "no row with an image has the id 17"),
    ] {
        for form in ["tsv", "jsonl", "parquet"] {
            let (_folder, path) = set(&format!("set.{form}"), &[question(1, image)]);
            let problem = refusal(&path, &SetArgs::default());
            assert!(problem.contains(message), "{form}: {problem}");
        }
    }
    for (cell, message) in [(base64(1)[..80].to_owned(), "not a"), ("QUJD".repeat(40), "not an image")] {
        let (_folder, path) = set("set.tsv", &[question(1, &cell)]);
        let dataset = open(&path, &SetArgs::default()).unwrap();
        let picture = dataset.picture(&FrameId("1".into())).and_then(|picture| picture.decode());
        let problem = picture.unwrap_err().to_string();
        assert!(problem.contains("set.tsv, line 2: ") && problem.contains(message), "{problem}");
    }
}

#[test]
fn changed_file_is_an_error() {
    let (_folder, path) = set("set.tsv", &[question(1, &base64(1))]);
    let dataset = open(&path, &SetArgs::default()).unwrap();
    super::fixture::write(&path, &[question(1, &base64(2))]);
    let problem = dataset.picture(&FrameId("1".into())).unwrap_err().to_string();
    assert!(problem.contains("the image has changed since the file was opened"), "{problem}");
}

fn line(image: &str) -> String {
    json!({"file_name": image, "question": "?", "options": ["x", "y"], "answer": "x"}).to_string()
}

#[test]
fn malicious_archives_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    for (name, entries, message) in [
        ("a.zip", vec![("../a.png", "x".to_owned())], "leads out of the file"),
        ("b.zip", vec![("/etc/a.png", "x".to_owned())], "leads out of the file"),
        ("c.zip", vec![("metadata.jsonl", line("../a.png"))], "lies outside"),
        ("d.zip", vec![("metadata.jsonl", line("/etc/hostname"))], "lies outside"),
        ("e.zip", vec![("metadata.jsonl", line("none.png"))], "no such file: \"none.png\""),
        ("f.zip", vec![("a.txt", String::new())], "no file of questions in it"),
    ] {
        let path = folder.path().join(name);
        let entries: Vec<(&str, &[u8])> = entries.iter().map(|(name, text)| (*name, text.as_bytes())).collect();
        super::shapes::pack(&path, &entries);
        let problem = refusal(&path, &SetArgs::default());
        assert!(problem.contains(message), "{name}: {problem}");
    }
    let path = folder.path().join("g.zip");
    fs::write(&path, b"PK no").unwrap();
    assert!(refusal(&path, &SetArgs::default()).contains("not a whole ZIP file"));
    let path = folder.path().join("h.jsonl.gz");
    fs::write(&path, b"no gzip").unwrap();
    assert!(refusal(&path, &SetArgs::default()).contains("cannot be unpacked"));
}
