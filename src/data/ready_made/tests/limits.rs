//! Files that would fill the memory or the disk, and invalid flags and cards.

use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use serde_json::json;

use super::fixture::{base64, row, set};
use super::{open, read, refusal};
use crate::Dataset;
use crate::ready_made::SetArgs;
use darkqa_base::error::Result;

fn file(name: &str, bytes: &[u8]) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    fs::write(&path, bytes).unwrap();
    (folder, path)
}

fn question() -> serde_json::Map<String, serde_json::Value> {
    row(json!({"question": "?", "options": "['x', 'y']", "answer": "x", "image": base64(1)}))
}

#[test]
fn too_many_columns_are_an_error() {
    let header: Vec<String> = (0..5000).map(|at| format!("c{at}")).collect();
    for (name, text) in [
        ("set.csv", header.join(",") + "\n1\n"),
        ("set.jsonl", header.iter().fold(String::new(), |text, name| text + &format!("{{{name:?}: 1}}\n"))),
        (
            "set.json",
            format!("[{}]", header.iter().map(|name| format!("{{{name:?}: 1}}")).collect::<Vec<_>>().join(",")),
        ),
    ] {
        let (_folder, path) = file(name, text.as_bytes());
        let problem = refusal(&path, &SetArgs::default());
        assert!(problem.contains(name) && problem.contains("more than 4096 columns"), "{problem}");
    }
}

#[test]
fn unterminated_record_is_an_error() {
    let mut text = b"question,answer\nWhich?,x\n\"What".to_vec();
    text.resize(70 << 20, b'x');
    let (_folder, path) = file("set.csv", &text);
    let problem = refusal(&path, &SetArgs::default());
    assert!(
        problem.contains("set.csv, record 2, line 3") && problem.contains("more than 64 MB; is a quote missing"),
        "{problem}"
    );
}

fn with_long_row(length: usize) -> (tempfile::TempDir, PathBuf) {
    let mut long = question();
    long.insert("evidence".to_owned(), json!("x".repeat(length)));
    set("set.parquet", &[question(), question(), long])
}

#[test]
fn huge_parquet_row_is_an_error() {
    let (_folder, path) = with_long_row((64 << 20) + 1);
    let problem = refusal(&path, &SetArgs::default());
    assert!(
        problem.contains("set.parquet, row 3: more than 64 MB in a row") && !problem.contains("not a whole"),
        "{problem}"
    );
    let (_folder, path) = with_long_row(1 << 20);
    assert_eq!(open(&path, &SetArgs::default()).unwrap().questions().len(), 3);
}

#[test]
fn row_with_a_million_values_is_refused() {
    let values = "0,".repeat(1_100_000);
    for (name, text) in [
        ("set.jsonl", format!("{{\"question\": [{values}0]}}\n")),
        ("set.json", format!("[{{\"question\": [{values}0]}}]")),
    ] {
        let (_folder, path) = file(name, text.as_bytes());
        let problem = refusal(&path, &SetArgs::default());
        assert!(problem.contains("more than 1048576 values in a row") && problem.contains(" 1"), "{problem}");
    }
    // Commas in a string do not count.
    let mut rows = question();
    rows.insert("evidence".to_owned(), json!(values));
    let (_folder, path) = set("set.jsonl", &[rows]);
    assert_eq!(open(&path, &SetArgs::default()).unwrap().questions().len(), 1);
    let deep = format!("{{\"question\": {}{}}}\n", "[".repeat(100_000), "]".repeat(100_000));
    let (_folder, path) = file("set.jsonl", deep.as_bytes());
    assert!(refusal(&path, &SetArgs::default()).contains("recursion limit"));
}

#[test]
fn decompression_bomb_is_refused() {
    let mut packed = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    let zeros = vec![b' '; 1 << 24];
    for _ in 0..65 {
        packed.write_all(&zeros).unwrap();
    }
    let (_folder, path) = file("set.csv.gz", &packed.finish().unwrap());
    let problem = refusal(&path, &SetArgs::default());
    assert!(problem.contains("set.csv.gz") && problem.contains("unpacks to more than 1"), "{problem}");
}

#[test]
fn rows_flag_is_refused_for_other_files() {
    let args = SetArgs { rows: Some("items".to_owned()), ..SetArgs::default() };
    for name in ["set.csv", "set.jsonl", "set.parquet"] {
        let (_folder, path) = set(name, &[question()]);
        let problem = refusal(&path, &args);
        assert!(problem.contains("--read rows") && problem.contains(name), "{problem}");
    }
}

fn open_with_card(folder: &Path, text: &str) -> Result<Dataset> {
    fs::write(folder.join("README.md"), format!("---\nconfigs:\n{text}---\n")).unwrap();
    open(folder, &SetArgs::default())
}

#[test]
fn card_with_split_fields_and_folder_is_read() {
    let (folder, path) = set("data/inner/test-a.csv", &[question()]);
    super::fixture::write(&path.with_file_name("train-a.csv"), &[question(), question()]);
    let mapping = "- config_name: default\n  data_files:\n    test: data/inner/test-*\n    train: data/inner/train-*\n";
    let from = "- config_name: default\n  data_dir: data/inner\n";
    let both = "- config_name: default\n  data_dir: data\n  data_files: {test: \"inner/test-*\"}\n";
    for text in [mapping, from, both] {
        assert_eq!(open_with_card(folder.path(), text).unwrap().questions().len(), 1, "{text}");
    }
    let train = SetArgs { split: Some("train".to_owned()), ..SetArgs::default() };
    open_with_card(folder.path(), mapping).unwrap();
    assert_eq!(open(folder.path(), &train).unwrap().questions().len(), 2);
    // If the card cannot be parsed, a note says that file names decide.
    fs::rename(folder.path().join("data/inner/test-a.csv"), folder.path().join("test.csv")).unwrap();
    let dataset = open_with_card(folder.path(), "- config_name: default\n  data_files: &x y\n").unwrap();
    assert_eq!(read(&dataset).len(), 1);
    let summary = dataset.summary().join("\n");
    assert!(summary.contains("README.md cannot be read") && summary.contains("names of files decide"), "{summary}");
    let named = SetArgs { config_name: Some("default".to_owned()), ..SetArgs::default() };
    let problem = refusal(folder.path(), &named);
    assert!(problem.contains("README.md cannot be read"), "{problem}");
}
