//! Small files and replies that would fill the memory: each is refused or read within it, and what is honest beside
//! them is taken.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::Write as _;
use std::os::unix::fs::FileExt as _;
use std::time::Duration;

use parquet::data_type::{ByteArray, ByteArrayType};
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::parser::parse_message_type;
use serde_json::{Value, json};

use crate::robustness::hostile::process::{Finished, Running, program};
use crate::support::endpoint::{Answer, MockEndpoint};
use crate::support::lerobot::Set;
use crate::support::onnx;
use crate::support::run::{Bench, files, records, words};
use crate::support::snapshot::redacted;

/// The memory that no call takes, in bytes.
const MOST: u64 = 1 << 30;

/// The result of a call that took less memory than any may.
fn call(bench: &Bench, line: &str) -> Finished {
    let mut command = program(&bench.path(""));
    command.args(words(line)).env("OPENAI_API_KEY", "k");
    let log = tempfile::tempdir().unwrap();
    let finished = Running::start(&mut command, log.path()).end(Duration::from_mins(5), None);
    assert!(!finished.is_late, "{line}");
    assert_eq!(finished.signal, None, "{line}");
    assert!(finished.memory < MOST, "{line}: {} MB", finished.memory >> 20);
    finished
}

fn stderr(finished: &Finished) -> String {
    String::from_utf8_lossy(&finished.stderr).into_owned()
}

/// The bytes of a reply that is as long as one may be, with many small values in one field.
fn reply(field: &str, value: &str) -> Vec<u8> {
    let message = r#""choices":[{"index":0,"message":{"content":"brown"},"finish_reason":"stop"}]"#;
    let many = value.repeat((15 << 20) / value.len());
    let usage = r#""usage":{"prompt_tokens":7,"completion_tokens":1}"#;
    format!("{{{message},\"{field}\":[{many}null],{usage}}}").into_bytes()
}

#[test]
fn nested_small_values_are_read() {
    let bench = Bench::with_questions(1);
    let error = |count: usize| {
        let details = "{\"a\":1},".repeat(count);
        format!("{{\"error\":{{\"message\":\"too dark\",\"details\":[{details}1]}}}}")
    };
    let (errors, inner) = (error(2_000_000), error(1_500_000));
    let nested = json!({"error": {"message": inner}}).to_string();
    let rows = [
        (200, reply("x", "{\"a\":1},"), 0),
        (200, reply("x", "[],"), 0),
        (400, errors.as_bytes()[..errors.len() / 2].to_vec(), 1),
        (400, errors.into_bytes(), 1),
        (400, nested.into_bytes(), 1),
    ];
    for (at, (status, body, code)) in rows.into_iter().enumerate() {
        let mock = MockEndpoint::answering(move |_| Answer::new(status, body.clone()));
        let line =
            format!("--model m --base-url {} --data set.jsonl --levels L0 --retries 0 --out run{at}", mock.base_url());
        let finished = call(&bench, &line);
        assert_eq!(finished.code, Some(code), "{at}: {}", stderr(&finished));
        let record = &records(&bench.path(&format!("run{at}")))[0];
        if code == 0 {
            assert_eq!(record["outcome"], "right", "{record}");
            // The tokens stand behind the long list.
            assert_eq!(record["usage"]["prompt_tokens"], 7, "{record}");
        }
    }
}

#[test]
fn record_keeps_ends_of_long_reply() {
    let bench = Bench::with_questions(1);
    let long = format!("I look. {}The answer is (C).", "Hm. ".repeat(1 << 20));
    let mock = MockEndpoint::answering(move |_| Answer::text(&long));
    let line = format!("--model m --base-url {} --data set.jsonl --levels L0 --retries 0 --out run", mock.base_url());
    assert_eq!(call(&bench, &line).code, Some(0));
    let record = &records(&bench.path("run"))[0];
    let text = record["reply"].as_str().unwrap();
    assert!(text.len() <= 64 << 10, "{}", text.len());
    assert!(text.starts_with("I look.") && text.ends_with("(C)."));
    assert!(text.contains("bytes omitted …]"), "{record}");
    assert_eq!(record["lenient"]["chosen"], 2, "{record}");
}

/// A Parquet file of `rows` equal rows.
fn parquet(rows: usize) -> Vec<u8> {
    let columns = ["id", "image", "question", "A", "B", "answer"];
    let fields = columns.map(|name| format!("required binary {name} (utf8);"));
    let schema = format!("message rows {{ {} }}", fields.concat());
    let schema = parse_message_type(&schema).unwrap().into();
    let mut bytes = Vec::new();
    let properties = WriterProperties::builder().build().into();
    let mut file = SerializedFileWriter::new(&mut bytes, schema, properties).unwrap();
    let mut group = file.next_row_group().unwrap();
    let cells = ["q", "a.png", "What color is it?", "blue", "brown", "brown"];
    for cell in cells {
        let mut column = group.next_column().unwrap().unwrap();
        let values = vec![ByteArray::from(cell); rows];
        let typed = column.typed::<ByteArrayType>();
        typed.write_batch(&values, None, None).unwrap();
        column.close().unwrap();
    }
    group.close().unwrap();
    file.close().unwrap();
    bytes
}

#[test]
fn oversized_sets_are_refused() {
    let bench = Bench::with_questions(1);
    bench.file("small.parquet", parquet(1));
    let large = parquet(1_500_000);
    assert!(large.len() < 1 << 20, "{}", large.len());
    bench.file("large.parquet", large);
    let mut archive = zip::ZipWriter::new(File::create(bench.path("large.zip")).unwrap());
    let options = zip::write::SimpleFileOptions::default();
    archive.start_file("set.jsonl", options).unwrap();
    let row = json!({"image": "a.png", "question": "Is it?", "choices": ["yes", "no"], "answer": "no"});
    let rows = format!("{row}\n").repeat(10_000);
    for _ in 0..120 {
        archive.write_all(rows.as_bytes()).unwrap();
    }
    archive.finish().unwrap();
    for name in ["large.parquet", "large.zip"] {
        let line = format!("--model random --data {name} --levels L0 --out run");
        let finished = call(&bench, &line);
        assert_eq!(finished.code, Some(2), "{name}");
        let text = stderr(&finished);
        assert!(text.contains("more than 1000000 rows") && text.contains(name), "{text}");
    }
    let line = "--model random --data small.parquet --levels L0 --out small";
    let finished = call(&bench, line);
    assert_eq!(finished.code, Some(0), "{}", stderr(&finished));
}

#[test]
fn many_rows_of_lerobot_are_refused() {
    for (rows, problem) in [
        (5_000_001, "5000001 rows; at most 5000000 in a file are read"),
        (4_900_000, "4900000 frames of observation.images.front left out"),
    ] {
        let bench = Bench::new();
        let set = Set { version: "v2.1", lengths: vec![rows], videos: true, ..Set::default() };
        set.write_tables(&bench.path("set"));
        let line = "import lerobot set --camera observation.images.front --every 0 --out out";
        let finished = call(&bench, line);
        let text = stderr(&finished);
        assert_eq!(finished.code, Some(2), "{text}");
        assert!(text.contains(problem), "{text}");
    }
}

#[test]
fn oversized_archives_are_refused() {
    let bench = Bench::with_questions(1);
    // Entries of the directory alone, then its end; the number of them is in the record of the 64-bit form.
    let (count, entry) = (1_200_000_u64, {
        let mut entry = b"PK\x01\x02".to_vec();
        entry.resize(28, 0);
        entry.extend(1_u16.to_le_bytes());
        entry.resize(46, 0);
        entry.push(b'a');
        entry
    });
    let mut archive = entry.repeat(count as usize);
    let length = archive.len() as u64;
    archive.extend(b"PK\x06\x06");
    archive.extend(44_u64.to_le_bytes());
    archive.extend([45, 0, 45, 0, 0, 0, 0, 0, 0, 0, 0, 0]);
    for number in [count, count, length, 0] {
        archive.extend(number.to_le_bytes());
    }
    archive.extend(b"PK\x06\x07\0\0\0\0");
    archive.extend(length.to_le_bytes());
    archive.extend(1_u32.to_le_bytes());
    archive.extend(b"PK\x05\x06\0\0\0\0");
    archive.extend([0xFF; 12]);
    archive.extend([0, 0]);
    bench.file("set.zip", archive);
    let finished = call(&bench, "--model random --data set.zip --levels L0 --out run");
    assert_eq!(finished.code, Some(2));
    let text = stderr(&finished);
    insta::assert_snapshot!(
        redacted(&text),
        @"error: set.zip: more than 500000 entries, which are not read; unpack it, and name its folder"
    );
}

/// Makes a file sparse and of 8 TB.
fn enlarge(path: &std::path::Path) {
    File::create(path).unwrap().set_len(8 << 40).unwrap();
}

#[test]
fn sparse_files_are_not_read() {
    let bench = Bench::with_questions(2);
    let line = "--model random --data set.jsonl --levels L3 --images-cache store --out run1";
    assert_eq!(call(&bench, line).code, Some(0));
    let stored = files(&bench.path("store"));
    let images: Vec<_> = stored.iter().filter(|path| path.extension().is_some_and(|end| end == "img")).collect();
    assert!(!images.is_empty());
    for image in images {
        let end = fs::read(image).unwrap();
        enlarge(image);
        // The end of an entry, whose lengths do not fit.
        let file = File::options().write(true).open(image).unwrap();
        let place = (8_u64 << 40) - end.len() as u64;
        file.write_all_at(&end, place).unwrap();
    }
    let line = line.replace("run1", "run2");
    let finished = call(&bench, &line);
    assert_eq!(finished.code, Some(0), "{}", stderr(&finished));
    insta::assert_snapshot!(redacted(&stderr(&finished)), @"
    WARN --images-cache: store/v1/[DIGEST].img is damaged, and made again; so is each further one
    WARN --images-cache: store is full, and no image in it is unused for 14 days; further ones are not stored; a
       larger --images-cache size than 20 makes room
    ");
    // Replies come in any order.
    let [first, second] = ["run1", "run2"].map(|run| {
        records(&bench.path(run))
            .into_iter()
            .map(|record| (record["key"].to_string(), record["image"].clone()))
            .collect::<BTreeMap<String, Value>>()
    });
    assert_eq!(first, second);
    for name in ["a.png", "set.jsonl"] {
        enlarge(&bench.path(name));
        let finished = call(&bench, "--model random --data set.jsonl --levels L0 --out run3");
        assert_eq!(finished.code, Some(2), "{name}");
        assert!(stderr(&finished).contains(name), "{}", stderr(&finished));
    }
}

#[test]
fn many_models_are_reported_without_a_ranking() {
    let bench = Bench::with_questions(2);
    let line = "--model random --data set.jsonl --levels L0,L3 --no-parquet --out run";
    assert_eq!(call(&bench, line).code, Some(0));
    let one = records(&bench.path("run"));
    let mut all = String::new();
    for model in 0..900 {
        for record in &one {
            let mut record = record.clone();
            record["model"] = format!("m{model}").into();
            let digits = record["key"].as_str().unwrap().replace('-', "");
            record["key"] = format!("{model:04x}{}", &digits[4..]).into();
            all += &record.to_string();
            all.push('\n');
        }
    }
    bench.file("run/records.jsonl", all);
    let manifest = fs::read_to_string(bench.path("run/manifest.json")).unwrap();
    let mut manifest: Value = serde_json::from_str(&manifest).unwrap();
    let model = manifest["columns"]["model"]["random"].clone();
    let models = (0..900).map(|at| (format!("m{at}"), model.clone()));
    manifest["columns"]["model"] = models.collect::<serde_json::Map<_, _>>().into();
    bench.file("run/manifest.json", manifest.to_string());
    let finished = call(&bench, "report run --out report");
    assert_eq!(finished.code, Some(0), "{}", stderr(&finished));
    let text = String::from_utf8_lossy(&finished.stdout);
    assert!(text.contains("Too many models to rank them"), "{text}");
}

#[test]
fn slow_loading_model_is_refused() {
    let bench = Bench::with_questions(1);
    onnx::slow_to_load().write(&bench.path(""), "slow.onnx");
    onnx::gain(0.5).write(&bench.path(""), "quick.onnx");
    let line = |model: &str, seconds: u32| {
        format!("enhance {model}.onnx a.png --offline --llie-anyway --llie-timeout {seconds} --out {model}")
    };
    let finished = call(&bench, &line("slow", 1));
    assert_eq!(finished.code, Some(2), "{}", stderr(&finished));
    insta::assert_snapshot!(redacted(&stderr(&finished)), @"
    error: slow.onnx: takes longer than [TIME] to load; allow more with --llie-options timeout=SECONDS (0: no
        limit)
    ");
    assert!(finished.took < Duration::from_mins(1), "{finished:?}");
    let finished = call(&bench, &line("quick", 60));
    assert_eq!(finished.code, Some(0), "{}", stderr(&finished));
}
