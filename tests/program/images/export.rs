//! `export`: what is written for other tools is read back as the same questions with the same pixels.

use std::fs;
use std::path::Path;
use std::process::Command;

use crate::support::run::{Called, PROGRAM, called};
use crate::support::snapshot::redacted;
use crate::support::table::check_rows;
use darkqa_base::types::{Question, Rgb, Severity};
use darkqa_eval::internals::dataset::{DataSource, Dataset, SetArgs};
use darkqa_light::exposure::expose;
use image::{Rgb as Pixel, RgbImage};
use tempfile::TempDir;

/// Two frames with three questions, one of them with three choices and with what a table must quote.
fn data() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (name, shade) in [("a.png", 200), ("b.png", 120)] {
        let image = RgbImage::from_fn(16, 12, |x, y| Pixel([shade, x as u8 * 9, y as u8 * 9]));
        image.save(folder.path().join(name)).unwrap();
    }
    let questions = [
        r#"{"id":"q1","frame":"b.png","family":"presence","question":"Is there a sink?","choices":["yes","no"],"answer":"no"}"#,
        r#"{"id":"q2","frame":"a.png","family":"color","question":"What\tcolor, \"said\"?","choices":["red","dark, blue","grey"],"answer":"grey"}"#,
        r#"{"id":"q3","frame":"b.png","family":"closest","question":"Nearest?","choices":["chair","table"],"answer":"chair"}"#,
    ];
    fs::write(folder.path().join("questions.jsonl"), questions.join("\n")).unwrap();
    folder
}

fn run(data: &Path, kind: &str, out: &Path, flags: &[&str]) -> Called {
    called(Command::new(PROGRAM).args(["export", kind]).arg(data).arg("--out").arg(out).args(flags))
}

/// The content of questions, in the order of their words.
fn words(set: &Dataset) -> Vec<(String, Vec<String>, usize, String)> {
    let word = |question: &Question| {
        let choices = &question.choices;
        (question.text.clone(), choices.texts().to_vec(), choices.truth().unwrap(), question.family.to_string())
    };
    let mut words: Vec<_> = set.questions().iter().map(word).collect();
    words.sort();
    words
}

/// The pixels that a question is about, by its words.
fn pixels(set: &Dataset, text: &str) -> Rgb {
    let question = set.questions().iter().find(|question| question.text == text).unwrap();
    set.picture(&question.frame).unwrap().decode().unwrap()
}

#[test]
fn every_form_is_read_back() {
    let data = data();
    let original = DataSource::Path(data.path().to_owned()).open(None, &SetArgs::default()).unwrap();
    let name = original.name().to_owned();
    let rows = [
        ("vlmevalkit", format!("{name}_CONDITION.tsv")),
        ("imagefolder", "CONDITION".to_owned()),
        ("imagefolder", "CONDITION/metadata.jsonl".to_owned()),
        ("llava", "CONDITION/questions.jsonl".to_owned()),
    ];
    check_rows(rows, |(kind, file)| {
        let out = tempfile::tempdir().unwrap();
        run(data.path(), kind, out.path(), &["--levels", "L0,L2", "--variant", "ev"]).ended(0);
        for (condition, degraded) in [("L0", false), ("L2-ev", true)] {
            let path = out.path().join(file.replace("CONDITION", condition));
            let set = DataSource::Path(path.clone()).open(None, &SetArgs::default()).unwrap();
            assert_eq!(words(&set), words(&original), "{}", path.display());
            for question in original.questions() {
                let clean = original.picture(&question.frame).unwrap().decode().unwrap();
                let expected = if degraded { expose(&clean, Severity::L2) } else { clean };
                assert_eq!(pixels(&set, &question.text), expected, "{kind} {condition}");
            }
        }
    });
}

#[test]
fn a_table_holds_each_image_once() {
    let (data, out) = (data(), tempfile::tempdir().unwrap());
    run(data.path(), "vlmevalkit", out.path(), &["--levels", "L0"]).ended(0);
    let table = fs::read_dir(out.path()).unwrap().next().unwrap().unwrap().path();
    let mut reader = csv::ReaderBuilder::new().delimiter(b'\t').from_path(table).unwrap();
    assert_eq!(
        reader.headers().unwrap(),
        ["index", "image", "question", "answer", "category", "id", "A", "B", "C"].as_slice()
    );
    let rows: Vec<csv::StringRecord> = reader.records().map(Result::unwrap).collect();
    let images: Vec<bool> = rows.iter().map(|row| row[1].len() > 64).collect();
    assert_eq!(images, [true, true, false]);
    // The second question about a frame names the row of the first.
    assert_eq!((&rows[2][1], &rows[1][0], &rows[2][5]), ("0", "0", "q3"));
}

#[test]
fn noise_is_that_of_evaluation() {
    let (data, out, dark) = (data(), tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    run(data.path(), "imagefolder", out.path(), &["--levels", "L3", "--variant", "noise", "--seed", "5"]).ended(0);
    called(Command::new(PROGRAM).arg("synthesize").arg(data.path()).arg("--out").arg(dark.path()).args([
        "--levels",
        "L3",
        "--variant",
        "noise",
        "--seed",
        "5",
    ]))
    .ended(0);
    let open = |path: std::path::PathBuf| image::open(path).unwrap().into_rgb8();
    for name in ["a", "b"] {
        let exported = open(out.path().join(format!("L3-noise/images/{name}.png")));
        assert_eq!(exported, open(dark.path().join(format!("{name}_L3-noise.png"))), "{name}");
    }
}

#[test]
fn nothing_is_written_over_unasked() {
    let (data, out) = (data(), tempfile::tempdir().unwrap());
    let flags = ["--levels", "L0"];
    run(data.path(), "llava", out.path(), &flags).ended(0);
    let message = run(data.path(), "llava", out.path(), &flags).ended(2).stderr;
    insta::assert_snapshot!(
        redacted(&message),
        @"error: [TMP]/L0/questions.jsonl: the set exists already; --force overwrites it, another --out keeps both"
    );
    run(data.path(), "llava", out.path(), &["--levels", "L0", "--force"]).ended(0);
    let message = run(data.path(), "parquet", out.path(), &flags).ended(2).stderr;
    insta::assert_snapshot!(
        redacted(&message),
        @"error: invalid value 'parquet' for '<KIND>' [possible values: vlmevalkit, imagefolder, llava]"
    );
}
