//! Layouts of published sets.

use std::fs;

use serde_json::{Map, Value, json};

use super::super::settings::{LeaveOut, SeveralImages};
use super::fixture::{base64, bytes, png, row, set, set_with_features, write};
use super::{Read, digests, expected, map, open, read};
use crate::ready_made::SetArgs;

const FORMS: [&str; 5] = ["tsv", "csv", "json", "jsonl", "parquet"];

/// Questions of these rows, which must be the same in every format, and digests of their images.
fn in_every_form(rows: &[Map<String, Value>], args: &SetArgs) -> Vec<Read> {
    let mut first = None;
    for form in FORMS {
        let (_folder, path) = set(&format!("set.{form}"), rows);
        let dataset = open(&path, args).unwrap_or_else(|e| panic!("{form}: {e}"));
        let found = (read(&dataset), digests(&dataset));
        let first = first.get_or_insert_with(|| found.clone());
        assert_eq!(*first, found, "{form}");
    }
    first.unwrap().0
}

#[test]
fn option_cells_and_letter_answers_are_read() {
    // MMBench: an absent cell is not an option, a short image is the id of another row, a hint comes first.
    let rows = [
        row(
            json!({"index": 241, "question": "What colour?", "A": "red", "B": "green", "C": "blue", "answer": "B", "category": "colour", "l2-category": "x", "image": base64(1)}),
        ),
        row(
            json!({"index": 242, "question": "Which shape?", "hint": "It is drawn.", "A": "disc", "B": "square", "C": "nan", "answer": "A", "category": "shape", "l2-category": "x", "image": "241"}),
        ),
        row(
            json!({"index": 243, "question": "What colour?", "A": "red", "B": "green", "answer": "A", "category": "shape", "l2-category": "x", "image": base64(2)}),
        ),
    ];
    let questions = in_every_form(&rows, &SetArgs::default());
    assert_eq!(
        questions,
        [
            expected("241", "colour", "What colour?", &["red", "green", "blue"], "green", 1),
            expected("242", "shape", "It is drawn.\nWhich shape?", &["disc", "square"], "disc", 1),
            expected("243", "shape", "What colour?", &["red", "green"], "red", 2),
        ]
    );
}

#[test]
fn lists_of_options_and_numbers() {
    // AI2D, EmbSpatial, ScienceQA: options in a list, the answer counts from 0.
    let rows = [
        row(json!({"question": "What colour?", "options": ["red", "green"], "answer": 1, "image": bytes(1)})),
        row(json!({"question": "<image>What colour?", "options": ["a", "b", "c"], "answer": 0, "image": bytes(2)})),
    ];
    let questions = in_every_form(&rows, &SetArgs::default());
    assert_eq!((questions[0].4.as_str(), questions[1].4.as_str()), ("green", "a"));
    assert_eq!(questions[1].2, "What colour?");
    assert_eq!(questions[0].1, "other");
    // Without a column of ids, ids depend on the content.
    let mut turned = rows.to_vec();
    turned.reverse();
    let again = in_every_form(&turned, &SetArgs::default());
    assert_eq!((&again[1].0, &again[0].0), (&questions[0].0, &questions[1].0));
    assert_eq!(questions[0].0.len(), 12);
}

#[test]
fn options_in_a_list_text_or_a_cell_are_read() {
    for options in [
        json!("['it\\'s red', \"it's green\"]"),
        json!("[\"it's red\", \"it's green\"]"),
        json!("(a) it's red (b) it's green"),
        json!(["A. it's red", "B. it's green"]),
    ] {
        let rows =
            [row(json!({"id": "x", "question": "?", "Options": options, "Correct Answer": "(b)", "image": bytes(1)}))];
        let questions = in_every_form(&rows, &SetArgs::default());
        let choices = ["it's red", "it's green"];
        assert_eq!(questions, [expected("x", "other", "?", &choices, "it's green", 1)]);
    }
    let rows = [row(json!({"id": "x", "question": "?", "options": "red|green", "answer": "2", "image": bytes(1)}))];
    let args = map("options=options:split(|),answer=answer:index1");
    assert_eq!(in_every_form(&rows, &args)[0].4, "green");
}

#[test]
fn options_in_the_question_and_yes_or_no() {
    // RealWorldQA, NaturalBench, MMStar: two kinds in one file.
    let rows = [
        row(
            json!({"question": "What colour?\nA. red\nB. green\nPlease answer directly with only the letter of the correct option and nothing else.", "answer": "B", "image": bytes(1)}),
        ),
        row(json!({"question": "Is it larger? Please answer yes or no.", "answer": "No", "image": bytes(2)})),
    ];
    let questions = in_every_form(&rows, &SetArgs::default());
    let texts: Vec<_> = questions
        .iter()
        .map(|(_, _, text, choices, truth, _)| (text.as_str(), choices.join(","), truth.as_str()))
        .collect();
    assert_eq!(
        texts,
        [("What colour?", "red,green".to_owned(), "green"), ("Is it larger?", "yes,no".to_owned(), "no")]
    );
    let kept = SetArgs { keep_instructions: true, ..SetArgs::default() };
    assert_eq!(in_every_form(&rows, &kept)[1].2, "Is it larger? Please answer yes or no.");
}

fn yes_no_question(text: &str, answer: &str, red: u8) -> Map<String, Value> {
    row(json!({"question": text, "gt_answer": answer, "image": bytes(red)}))
}

#[test]
fn digits_mean_yes_or_no_only_in_yes_no_sets() {
    let rows = [yes_no_question("Is it red?", "1", 1), yes_no_question("Does it move?", "0", 2)];
    let truths: Vec<String> = in_every_form(&rows, &SetArgs::default()).into_iter().map(|read| read.4).collect();
    assert_eq!(truths, ["yes", "no"]);
    // The answer to "how many" is a number: the question is open, not a yes/no question.
    let rows = [yes_no_question("How many cups?", "1", 1), yes_no_question("How many cats?", "0", 2)];
    let (_folder, path) = set("set.json", &rows);
    assert!(super::refusal(&path, &SetArgs::default()).contains("no options in 2 of 2 rows"));
}

fn question_with_id(id: i64, colour: u8) -> Map<String, Value> {
    row(json!({"id": id, "question": "Is it there?", "answer": "yes", "image": bytes(colour)}))
}

#[test]
fn equal_images_share_the_lowest_id() {
    // POPE: many questions per image.
    let mut rows = vec![question_with_id(10, 1), question_with_id(9, 1), question_with_id(11, 2)];
    for turn in 0..3 {
        rows.rotate_left(turn);
        for form in FORMS {
            let (_folder, path) = set(&format!("set.{form}"), &rows);
            let dataset = open(&path, &SetArgs::default()).unwrap();
            let frames: Vec<&str> = dataset.frames().map(|frame| frame.0.as_str()).collect();
            assert_eq!(frames, ["11", "9"], "{form}");
        }
    }
}

fn question_with_one_id(text: &str) -> Map<String, Value> {
    row(json!({"question_id": "one.png", "question": text, "answer": "yes", "image": bytes(1)}))
}

#[test]
fn id_columns_with_duplicates_are_skipped() {
    let rows =
        [question_with_one_id("Is it red?"), question_with_one_id("Is it blue?"), question_with_one_id("Is it red?")];
    let questions = in_every_form(&rows, &SetArgs::default());
    assert_ne!(questions[0].0, questions[1].0);
    assert_eq!(questions[2].0, format!("{}-1", questions[0].0));
    let (_folder, path) = set("set.json", &rows);
    let summary = open(&path, &SetArgs::default()).unwrap().summary().join("\n");
    assert!(summary.contains("id = content (question_id does not tell all rows apart)"), "{summary}");
    assert!(summary.contains("questions that repeat an earlier one, with its image and options: 1;"), "{summary}");
}

#[test]
fn rows_that_cannot_be_asked_need_a_flag() {
    let rows = [
        row(
            json!({"id": 1, "question": "?", "choices": ["x", "y"], "answer": "x", "image_1": bytes(1), "image_2": null}),
        ),
        row(
            json!({"id": 2, "question": "?", "choices": ["x", "y"], "answer": "x", "image_1": bytes(1), "image_2": bytes(2)}),
        ),
        row(json!({"id": 3, "question": "?", "choices": ["x", "y"], "answer": "x", "image_1": null, "image_2": null})),
    ];
    let skip = Some(LeaveOut::Skip);
    let args = SetArgs { multi_image: Some(SeveralImages::Skip), no_image: skip, ..SetArgs::default() };
    let questions = in_every_form(&rows, &args);
    assert_eq!(questions.iter().map(|read| read.0.as_str()).collect::<Vec<_>>(), ["1"]);
    let (_folder, path) = set("set.parquet", &rows);
    let problem = super::refusal(&path, &SetArgs::default());
    for message in ["1 of 3 rows show 2 images; --multi-image skip", "no image in 1 of 3 rows; --skip no-image"] {
        assert!(problem.contains(message), "{problem}");
    }
    let summary = open(&path, &args).unwrap().summary().join("\n");
    assert!(summary.contains("left out: 1 of 3 rows (several images)"), "{summary}");
}

#[test]
fn list_with_one_image_is_one_image() {
    // SEED-Bench.
    let rows = [
        row(
            json!({"question_id": 7, "question": "?", "choice_a": "x", "choice_b": "y", "answer": "B", "question_type_id": 1, "image": [bytes(1)]}),
        ),
        row(
            json!({"question_id": 8, "question": "?", "choice_a": "x", "choice_b": "y", "answer": "A", "question_type_id": 2, "image": [bytes(2)]}),
        ),
    ];
    for form in ["json", "jsonl", "parquet"] {
        let (_folder, path) = set(&format!("set.{form}"), &rows);
        let questions = read(&open(&path, &SetArgs::default()).unwrap());
        assert_eq!(questions[0], expected("7", "1", "?", &["x", "y"], "y", 1), "{form}");
        assert_eq!(questions[1].5, 2);
    }
}

#[test]
fn image_folder_and_image_files_are_read() {
    let rows = [row(json!({"file_name": "0.png", "question": "?", "options": ["x", "y"], "answer": "y"}))];
    for (name, at) in [("test/metadata.csv", ""), ("test/metadata.jsonl", "test"), ("metadata.parquet", "")] {
        let (folder, path) = set(name, &rows);
        fs::write(path.parent().unwrap().join("0.png"), png(5)).unwrap();
        let dataset = open(&folder.path().join(at), &SetArgs::default()).unwrap();
        assert_eq!(read(&dataset)[0].5, 5, "{name}");
    }
    let rows = [row(json!({"Index": 3, "Question": "?", "Options": "(a) x (b) y", "Correct Answer": "(a)"}))];
    let (folder, path) = set("Questions.csv", &rows);
    fs::create_dir(folder.path().join("MMVP Images")).unwrap();
    fs::write(folder.path().join("MMVP Images/3.jpg"), png(6)).unwrap();
    assert_eq!(read(&open(&path, &map("image=MMVP Images/{Index}.jpg")).unwrap())[0].5, 6);
    let known = crate::parse_data_source(&format!("mmvp:{}", path.display())).unwrap();
    let dataset = known.open(None, &SetArgs::default()).unwrap();
    assert!(dataset.summary().join("\n").contains("read by the rules of MMVP: Tong et al."));
    assert_eq!(dataset.questions().len(), 1);
}

#[test]
fn rows_in_json_are_found_by_path() {
    let one = json!({"q": "?", "opts": ["x", "y"], "a": "x", "id": 1});
    let nested = json!({"info": 1, "images": [{"file_name": "0.png", "id": 9, "qa": [one]}]});
    let (folder, path) = set("set.json", &[]);
    fs::write(&path, nested.to_string()).unwrap();
    fs::write(folder.path().join("0.png"), png(4)).unwrap();
    let args = SetArgs { rows: Some("images.*.qa".into()), ..map("question=q,options=opts,answer=a") };
    assert_eq!(read(&open(&path, &args).unwrap()), [expected("1", "other", "?", &["x", "y"], "x", 4)]);
    let by_id = json!({"k1": {"question": "?", "options": ["x", "y"], "answer": "x", "image": base64(3)}});
    fs::write(&path, by_id.to_string()).unwrap();
    assert_eq!(read(&open(&path, &SetArgs::default()).unwrap())[0].5, 3);
}

fn choice_question(text: &str, red: u8) -> Map<String, Value> {
    row(json!({"question": text, "options": ["x", "y"], "answer": "x", "image": bytes(red)}))
}

fn texts_and_families(
    folder: &std::path::Path,
    config: Option<&str>,
    split: Option<&str>,
) -> Result<Vec<(String, String)>, String> {
    let args =
        SetArgs { config_name: config.map(str::to_owned), split: split.map(str::to_owned), ..SetArgs::default() };
    let dataset = open(folder, &args).map_err(|e| e.to_string())?;
    Ok(read(&dataset).into_iter().map(|read| (read.2, read.1)).collect())
}

fn pair(text: &str, family: &str) -> (String, String) {
    (text.to_owned(), family.to_owned())
}

/// A path in the folder; its parent is created.
fn path_in(folder: &std::path::Path, name: &str) -> std::path::PathBuf {
    let path = folder.join(name);
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    path
}

#[test]
fn repository_has_configurations_splits_and_shards() {
    let folder = tempfile::tempdir().unwrap();
    let card = "---\nconfigs:\n- config_name: one\n  data_files:\n  - split: test\n    path: one/test-*\n- config_name: two\n  data_files:\n  - split: val\n    path: two/*.parquet\n  - split: train\n    path: two/b.csv\n---\n";
    fs::write(path_in(folder.path(), "README.md"), card).unwrap();
    write(&path_in(folder.path(), "one/test-00000-of-00002.parquet"), &[choice_question("first", 1)]);
    write(&path_in(folder.path(), "one/test-00001-of-00002.parquet"), &[choice_question("second", 2)]);
    write(&path_in(folder.path(), "two/a.parquet"), &[choice_question("third", 3)]);
    write(&path_in(folder.path(), "two/b.csv"), &[choice_question("fourth", 4)]);
    assert!(
        texts_and_families(folder.path(), None, None)
            .unwrap_err()
            .contains("2 configurations, one, two; --read config=NAME")
    );
    assert!(texts_and_families(folder.path(), Some("three"), None).unwrap_err().contains("there are one, two"));
    assert_eq!(
        texts_and_families(folder.path(), Some("one"), None).unwrap(),
        [pair("first", "other"), pair("second", "other")]
    );
    assert!(
        texts_and_families(folder.path(), Some("two"), None)
            .unwrap_err()
            .contains("the splits train (files: 1), val (rows: 1); --read split=NAME")
    );
    assert_eq!(texts_and_families(folder.path(), Some("two"), Some("train")).unwrap(), [pair("fourth", "other")]);
    let all = texts_and_families(folder.path(), Some("all"), Some("all")).unwrap();
    assert_eq!(all, [pair("first", "one"), pair("second", "one"), pair("third", "two"), pair("fourth", "two")]);
    fs::remove_file(path_in(folder.path(), "one/test-00001-of-00002.parquet")).unwrap();
    assert!(texts_and_families(folder.path(), Some("one"), None).unwrap_err().contains("number 1 is missing"));
}

#[cfg(unix)]
#[test]
fn hub_cache_is_read_through_links() {
    let folder = tempfile::tempdir().unwrap();
    let cache = folder.path().join("datasets--org--name");
    let snapshot = cache.join("snapshots/abc");
    for name in ["snapshots/abc/data", "blobs", "refs"] {
        fs::create_dir_all(cache.join(name)).unwrap();
    }
    fs::write(cache.join("refs/main"), "abc").unwrap();
    let rows = [row(json!({"question": "?", "options": ["x", "y"], "answer": "x", "image": "pics/0.png"}))];
    write(&cache.join("blobs/set.parquet"), &rows);
    fs::write(cache.join("blobs/picture"), png(9)).unwrap();
    fs::create_dir_all(snapshot.join("data/pics")).unwrap();
    std::os::unix::fs::symlink("../../../blobs/set.parquet", snapshot.join("data/test-00000-of-00001.parquet"))
        .unwrap();
    std::os::unix::fs::symlink("../../../../blobs/picture", snapshot.join("data/pics/0.png")).unwrap();
    for place in [&cache, &snapshot] {
        let dataset = open(place, &SetArgs::default()).unwrap();
        assert_eq!(read(&dataset)[0].5, 9, "{}", place.display());
    }
}

#[test]
fn compressed_files_are_read() {
    let rows = [
        row(json!({"file_name": "pics/0.png", "question": "?", "options": ["x", "y"], "answer": "y"})),
        row(json!({"file_name": "pics/../pics/0.png", "question": "??", "options": ["x", "y"], "answer": "y"})),
    ];
    let (folder, path) = set("set.jsonl", &rows);
    let text = fs::read(&path).unwrap();
    let packed = folder.path().join("set.jsonl.gz");
    let mut encoder = flate2::write::GzEncoder::new(fs::File::create(&packed).unwrap(), flate2::Compression::fast());
    std::io::Write::write_all(&mut encoder, &text).unwrap();
    encoder.finish().unwrap();
    fs::create_dir(folder.path().join("pics")).unwrap();
    fs::write(folder.path().join("pics/0.png"), png(5)).unwrap();
    assert_eq!(read(&open(&packed, &SetArgs::default()).unwrap())[0].5, 5);
    let zip = folder.path().join("set.zip");
    pack(&zip, &[("test/metadata.jsonl", &text), ("test/pics/0.png", &png(6)), ("__MACOSX/metadata.csv", b"x")]);
    let dataset = open(&zip, &SetArgs::default()).unwrap();
    let frames: Vec<&str> = dataset.frames().map(|frame| frame.0.as_str()).collect();
    assert_eq!((frames, read(&dataset)[1].5), (vec!["test/pics/0.png"], 6));
    // Embedded images are read from the decompressed copy.
    let rows = [row(json!({"id": 1, "question": "?", "options": ["x", "y"], "answer": "y", "image": bytes(7)}))];
    let (folder, path) = set("data/test.parquet", &rows);
    let zip = folder.path().join("set.zip");
    pack(&zip, &[("data/test.parquet", &fs::read(&path).unwrap())]);
    assert_eq!(read(&open(&zip, &SetArgs::default()).unwrap())[0].5, 7);
}

/// Writes a ZIP file with these entries.
pub(super) fn pack(path: &std::path::Path, entries: &[(&str, &[u8])]) {
    let mut zip = zip::ZipWriter::new(fs::File::create(path).unwrap());
    for (name, bytes) in entries {
        let options = zip::write::SimpleFileOptions::default();
        zip.start_file(*name, options).unwrap();
        std::io::Write::write_all(&mut zip, bytes).unwrap();
    }
    zip.finish().unwrap();
}

/// Answers of two rows with these fields, whose column `answer` has the classes 0 and 1 with these names.
fn class_answers(names: [&str; 2], fields: &Value) -> Vec<String> {
    let rows = [0, 1].map(|class| {
        let mut row = row(fields.clone());
        row.insert("image".to_owned(), json!(base64(class)));
        row.insert("answer".to_owned(), json!(class));
        row
    });
    let features = json!({"answer": {"names": names, "_type": "ClassLabel"}});
    let (_folder, path) = set_with_features(&rows, &features);
    let set = open(&path, &SetArgs::default()).unwrap();
    read(&set).into_iter().map(|read| read.4).collect()
}

#[test]
fn class_labels_are_read_by_name() {
    let yes_or_no = json!({"question": "Is it red?"});
    assert_eq!(class_answers(["yes", "no"], &yes_or_no), ["yes", "no"]);
    assert_eq!(class_answers(["no", "yes"], &yes_or_no), ["no", "yes"]);
    let listed = json!({"question": "Which?", "options": ["cup", "ball"]});
    assert_eq!(class_answers(["ball", "cup"], &listed), ["ball", "cup"]);
    assert_eq!(class_answers(["B", "A"], &listed), ["ball", "cup"]);
    let columns = json!({"question": "Which?", "option1": "cup", "option2": "ball"});
    let numbered = class_answers(["option1", "option2"], &columns);
    assert_eq!(numbered, ["cup", "ball"]);
}
