//! Rows by name, families of several configurations, sets in ZIP files, and contradictory rows.

use std::fs;
use std::io::Write as _;
use std::path::PathBuf;

use base64::Engine as _;
use serde_json::{Map, Value, json};

use super::super::settings::LeaveOut;
use super::fixture::{base64, png, row, set};
use super::{open, read, refusal};
use crate::ready_made::SetArgs;
use crate::{DataSource, Dataset};
use darkqa_base::error::Result;

fn question(fields: Value) -> Value {
    let mut row = row(fields);
    row.entry("question").or_insert(json!("?"));
    row.entry("options").or_insert(json!(["x", "y"]));
    row.entry("answer").or_insert(json!("x"));
    row.entry("image").or_insert(json!(base64(1)));
    Value::Object(row)
}

fn written(text: &str) -> (tempfile::TempDir, std::path::PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("set.json");
    fs::write(&path, text).unwrap();
    (folder, path)
}

#[test]
fn names_of_rows_become_ids() {
    let text = json!({"q7": question(json!({})), "q2": question(json!({"question": "Which?"}))}).to_string();
    let (_folder, path) = written(&text);
    let dataset = open(&path, &SetArgs::default()).unwrap();
    let mut ids: Vec<String> = read(&dataset).into_iter().map(|read| read.0).collect();
    ids.sort();
    assert_eq!(ids, ["q2", "q7"]);
    let summary = dataset.summary().join("\n");
    assert!(summary.contains("id = id") && summary.contains("the names of the rows"), "{summary}");
    // A column of ids takes precedence.
    let text =
        json!({"q7": question(json!({"question_id": 1})), "q2": question(json!({"question_id": 2}))}).to_string();
    let (_folder, path) = written(&text);
    let dataset = open(&path, &SetArgs::default()).unwrap();
    let mut ids: Vec<String> = read(&dataset).into_iter().map(|read| read.0).collect();
    ids.sort();
    assert_eq!(ids, ["1", "2"]);
    assert!(!dataset.summary().join("\n").contains("the names of the rows"));
}

#[test]
fn family_column_varies_among_asked_questions() {
    // The types differ only in omitted rows.
    let rows = [
        json!({"id": 1, "category": "choice", "topic": "cups"}),
        json!({"id": 2, "category": "choice", "topic": "balls"}),
        json!({"id": 3, "category": "open", "topic": "balls", "options": "[]", "answer": "7"}),
    ];
    let rows: Vec<_> = rows.into_iter().map(|fields| row(question(fields))).collect();
    let (_folder, path) = set("set.json", &rows);
    let args = SetArgs { open: Some(LeaveOut::Skip), ..SetArgs::default() };
    let families: Vec<String> = read(&open(&path, &args).unwrap()).into_iter().map(|read| read.1).collect();
    assert_eq!(families, ["cups", "balls"]);
}

fn choice_row(id: i64) -> [Map<String, Value>; 1] {
    [row(question(json!({"id": id, "category": "choice"})))]
}

#[test]
fn configuration_is_the_family_if_no_column_varies() {
    let (folder, path) = set("art/test.jsonl", &choice_row(1));
    super::fixture::write(&folder.path().join("music.jsonl"), &choice_row(2));
    let card = "---\nconfigs:\n- config_name: Art\n  data_files: art/test.jsonl\n- config_name: Music\n  data_files: music.jsonl\n---\n";
    fs::write(folder.path().join("README.md"), card).unwrap();
    let args = SetArgs { config_name: Some("all".to_owned()), split: Some("all".to_owned()), ..SetArgs::default() };
    let dataset = open(folder.path(), &args).unwrap();
    let families: Vec<String> = read(&dataset).into_iter().map(|read| read.1).collect();
    assert_eq!(families, ["Art", "Music"]);
    assert!(dataset.summary()[0].contains("in 2 families (by configuration)"), "{:?}", dataset.summary());
    // A column given by the user takes precedence, and so does any column if there is only one configuration.
    let mapped = SetArgs { map: vec!["family=category".parse().unwrap()], ..args };
    assert_eq!(read(&open(folder.path(), &mapped).unwrap())[0].1, "choice");
    assert_eq!(read(&open(&path, &SetArgs::default()).unwrap())[0].1, "choice");
}

/// A ZIP file with these files.
fn zip(files: &[(&str, &[u8])]) -> (tempfile::TempDir, std::path::PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("set.zip");
    let mut zip = zip::ZipWriter::new(fs::File::create(&path).unwrap());
    for (name, bytes) in files {
        zip.start_file(*name, zip::write::SimpleFileOptions::default()).unwrap();
        zip.write_all(bytes).unwrap();
    }
    zip.finish().unwrap();
    (folder, path)
}

#[test]
fn zip_file_has_its_own_name_and_map() {
    let table = b"nr,frage,bild,A,B,richtig\n1,Which?,0,x,y,B\n";
    let info = br#"{"name": "Probe", "map": "id=nr,question=frage,image=images/{bild}.png,answer=richtig"}"#;
    let image = png(3);
    let files: &[(&str, &[u8])] = &[("set.csv", table), ("dataset.json", info), ("images/0.png", &image)];
    let (_folder, path) = zip(files);
    let dataset = open(&path, &SetArgs::default()).unwrap();
    assert_eq!((dataset.name(), dataset.title(), read(&dataset)[0].4.as_str()), ("Probe", "Probe", "y"));
    let (_folder, path) = zip(&[files[0], ("dataset.json", b"{\"map\": \"colour=x\"}"), files[2]]);
    let problem = refusal(&path, &SetArgs::default());
    assert!(problem.contains("dataset.json") && problem.contains("one of the roles"), "{problem}");
}

#[test]
fn ambiguous_image_in_zip_is_refused() {
    let table = b"id,question,image,A,B,answer\n1,Which?,images/0.png,x,y,B\n";
    let (near, top) = (png(3), png(5));
    let metadata: (&str, &[u8]) = ("data/metadata.csv", table);
    for (name, image, red) in [("data/images/0.png", &near, 3), ("images/0.png", &top, 5)] {
        let (_folder, path) = zip(&[(name, image), metadata]);
        assert_eq!(read(&open(&path, &SetArgs::default()).unwrap())[0].5, red);
    }
    let (_folder, path) = zip(&[("data/images/0.png", &near), ("images/0.png", &top), metadata]);
    let problem = refusal(&path, &SetArgs::default());
    assert!(
        problem.contains("may be \"data/images/0.png\" or \"images/0.png\"") && problem.contains("line 2"),
        "{problem}"
    );
}

fn rows_with_answers(answers: [&str; 2]) -> Vec<Map<String, Value>> {
    (0..40)
        .map(|at| {
            let answer = answers.get(at).unwrap_or(&"x");
            let text = if at < 2 { "Which?".to_owned() } else { format!("{at}?") };
            row(question(json!({"question": text, "answer": answer})))
        })
        .collect()
}

#[test]
fn equal_rows_with_different_answers_are_refused() {
    let (_folder, path) = set("set.jsonl", &rows_with_answers(["x", "y"]));
    let problem = refusal(&path, &SetArgs::default());
    assert!(
        problem.contains("2 of 40 rows are broken")
            && problem.contains("line 1 (\"x\")")
            && problem.contains("line 2 (\"y\") ask the same of the same image, and their answers differ; --skip bad"),
        "{problem}"
    );
    let skip = SetArgs { bad: Some(crate::SkipBad::default()), ..SetArgs::default() };
    let dataset = open(&path, &skip).unwrap();
    assert_eq!(dataset.questions().len(), 38);
    assert!(dataset.summary().join("\n").contains("left out: 2 of 40 rows"));
    // An exact repeat is asked again, with a note.
    let (_folder, path) = set("set.jsonl", &rows_with_answers(["x", "x"]));
    let dataset = open(&path, &SetArgs::default()).unwrap();
    assert_eq!(dataset.questions().len(), 40);
    assert!(dataset.summary().join("\n").contains("that repeat an earlier one, with its image and options: 1;"));
}

fn open_with_images(rows: &[Map<String, Value>], args: &SetArgs) -> Result<Dataset> {
    let (folder, path) = set("set.jsonl", rows);
    for (name, colour) in [("a.png", 1), ("b.png", 2)] {
        fs::write(folder.path().join(name), png(colour)).unwrap();
    }
    open(&path, args)
}

fn rows_ending_with(same: &Value, last: [(&Value, &str); 3]) -> Vec<Map<String, Value>> {
    (0..60)
        .map(|at: usize| {
            let last = at.checked_sub(38).and_then(|at| last.get(at));
            let (image, answer) = last.copied().unwrap_or((same, "x"));
            let text = last.map_or_else(|| format!("{at}?"), |_| "Which?".to_owned());
            let fields = json!({"id": at, "question": text, "answer": answer, "image": image});
            row(question(fields))
        })
        .collect()
}

#[test]
fn contradictions_are_found_with_ids_too() {
    let skip = SetArgs { bad: Some(crate::SkipBad::default()), ..SetArgs::default() };
    let strict = SetArgs::default();
    // Images of the rows 39 to 41, in cells and in files.
    for [same, other] in [[json!(base64(1)), json!(base64(2))], [json!("a.png"), json!("b.png")]] {
        let differ = [(&same, "x"), (&same, "x"), (&same, "y")];
        let problem = open_with_images(&rows_ending_with(&same, differ), &strict).unwrap_err().to_string();
        assert!(
            problem.contains("3 of 60 rows are broken")
                && problem.contains("line 39 (\"x\")")
                && problem.contains("line 41 (\"y\") ask the same of the same image"),
            "{problem}"
        );
        let kept = open_with_images(&rows_ending_with(&same, differ), &skip).unwrap();
        let ids: Vec<&str> = kept.questions().iter().map(|kept| &*kept.id.0).collect();
        assert_eq!(ids.len(), 57);
        assert!(!ids.iter().any(|id| ["38", "39", "40"].contains(id)));
        // With another image or the same answer there is no contradiction.
        for fine in [[(&same, "x"), (&same, "x"), (&other, "y")], [(&same, "y"), (&same, "y"), (&same, "y")]] {
            assert_eq!(open_with_images(&rows_ending_with(&same, fine), &strict).unwrap().questions().len(), 60);
        }
    }
}

#[test]
fn dataset_json_maps_columns_of_questions() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    fs::write(root.join("0.png"), png(9)).unwrap();
    let line = json!({"id": "a", "frame": "0.png", "frage": "Which?", "choices": ["x", "y"], "answer": "y"});
    fs::write(root.join("questions.jsonl"), line.to_string()).unwrap();
    assert!(refusal(folder.path(), &SetArgs::default()).contains("no question among its columns"));
    fs::write(root.join("dataset.json"), r#"{"schema": "darkqa.dataset/1", "map": "question=frage"}"#).unwrap();
    let found = read(&open(folder.path(), &SetArgs::default()).unwrap());
    assert_eq!((found[0].2.as_str(), found[0].4.as_str(), found[0].5), ("Which?", "y", 9));
}

#[test]
fn bmp_image_is_read() {
    let mut file = std::io::Cursor::new(Vec::new());
    let image = image::RgbImage::from_fn(8, 8, |x, _| image::Rgb([7, x as u8, 0]));
    image.write_to(&mut file, image::ImageFormat::Bmp).unwrap();
    let text = base64::engine::general_purpose::STANDARD.encode(file.into_inner());
    let (_folder, path) = set("set.jsonl", &[row(question(json!({"image": text})))]);
    let dataset = open(&path, &SetArgs::default()).unwrap();
    assert_eq!(read(&dataset)[0].5, 7);
    assert!(dataset.summary().join("\n").contains("BMP 1"));
    let (_folder, path) = set(
        "set.jsonl",
        &[row(question(
            json!({"image": base64::engine::general_purpose::STANDARD.encode([b"GIF89a".as_slice(), &[1; 90]].concat())}),
        ))],
    );
    let dataset = open(&path, &SetArgs::default()).unwrap();
    let frame = dataset.frames().next().unwrap();
    let problem = dataset.picture(frame).and_then(|picture| picture.decode()).unwrap_err().to_string();
    assert!(problem.contains("line 1") && problem.contains("a GIF image, which is not read"), "{problem}");
}

fn numbered_row(id: i64) -> [Map<String, Value>; 1] {
    [row(question(json!({"id": id, "image": format!("{id}.png")})))]
}

fn open_joined(paths: &[&PathBuf]) -> Result<Dataset> {
    let paths = paths.iter().map(|path| (*path).clone()).collect();
    let place = DataSource::Files(paths);
    place.open(None, &SetArgs::default())
}

#[test]
fn several_files_are_joined_in_order() {
    let (folder, path) = set("b/one.csv", &numbered_row(1));
    let second = folder.path().join("a/two.tsv");
    fs::create_dir(second.parent().unwrap()).unwrap();
    super::fixture::write(&second, &numbered_row(2));
    fs::write(path.with_file_name("1.png"), png(1)).unwrap();
    fs::write(second.with_file_name("2.png"), png(2)).unwrap();
    let both = read(&open_joined(&[&path, &second]).unwrap());
    let ids: Vec<(&str, u8)> = both.iter().map(|read| (read.0.as_str(), read.5)).collect();
    assert_eq!(ids, [("1", 1), ("2", 2)]);
    let turned = read(&open_joined(&[&second, &path]).unwrap());
    assert_eq!(turned[0].0, "2");
    // Other columns, a folder, and the same file again are refused.
    let other = folder.path().join("b/other.csv");
    super::fixture::write(&other, &[row(question(json!({"id": 3, "hint": "h"})))]);
    let problem = open_joined(&[&path, &other]).unwrap_err().to_string();
    assert!(
        problem.contains("other.csv")
            && problem.contains("\"hint\" is in")
            && problem.contains("have the same columns"),
        "{problem}"
    );
    let problem = refusal(&folder.path().join("b/*.csv"), &SetArgs::default());
    assert!(problem.contains("\"hint\" is in"), "{problem}");
    for wrong in [&folder.path().to_owned(), &path] {
        let problem = open_joined(&[&path, wrong]).unwrap_err().to_string();
        assert!(problem.contains("--data"), "{problem}");
    }
}
