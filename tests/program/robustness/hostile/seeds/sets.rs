//! Ready-made sets in all forms, and what a set needs beside it.

use std::sync::Arc;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use parquet::data_type::{ByteArray, ByteArrayType};
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::parser::parse_message_type;
use serde_json::{Value, json};

use crate::support::frames;
use crate::support::run::Bench;

pub(super) fn make(bench: &Bench) {
    let questions = (0..3).map(|i| {
        json!({
            "id": format!("q{i}"), "image": (["a.png", "b.png"][i % 2]), "family": "color",
            "question": format!("What color is it, {i}?"),
            "choices": ["red", "blue", "brown"], "answer": "brown",
        })
    });
    bench.file("set.jsonl", lines(questions));
    let rows = json!({"items": [
        {"index": 1, "image": "a.png", "question": "Which?", "A": "x", "B": "y", "C": "z", "answer": "B", "category": "c"},
        {"index": 2, "image": "a.png", "question": "Which one?", "A": "x", "B": "y", "C": "", "answer": "A", "category": "d"},
    ]});
    bench.file("set.json", rows.to_string());
    let code = STANDARD.encode(frames::png(60));
    bench.file(
        "set.tsv",
        format!("index\timage\tquestion\tA\tB\tanswer\tcategory\n1\t{code}\tWhich?\tx\ty\tB\tc\n2\t1\tWhich one?\tx\ty\tA\tc\n"),
    );
    bench.file(
        "set.csv",
        "id,image,question,options,answer\n1,a.png,\"Which, then?\",\"['x', 'y', \"\"z\"\"]\",B\n2,a.png,Which?,\"[\"\"x\"\", \"\"y\"\"]\",A\n",
    );
    bench.file("set.parquet", parquet());
    bench.file("asked/a.png", frames::png(20));
    bench.file("asked/b.png", frames::png(120));
    let asked = [
        json!({"id": "a1", "frame": "a.png", "family": "presence", "question": "Is there a \"lamp\" {{here}}?", "choices": ["yes", "no"], "answer": "no"}),
        json!({"id": "b1", "frame": "b.png", "family": "presence", "question": "Is there a bed?", "choices": ["yes", "no"], "answer": "yes"}),
    ];
    bench.file("asked/questions.jsonl", lines(asked));
    let paired = [
        json!({"id": "a1", "frame": "a.png", "question": "Is it dark?", "choices": ["yes", "no"], "answer": "no"}),
        json!({"id": "b1", "frame": "b.png", "question": "Is it dark?", "choices": ["yes", "no"], "answer": "no"}),
    ];
    bench.file("paired.jsonl", lines(paired));
    let bank =
        json!({"id": "lamp", "question": "Is there a lamp in it?", "choices": ["yes", "no"], "family": "presence"});
    bench.file("bank.jsonl", lines([bank]));
    bench.file("subset.json", "[\"q1\", \"q3\"]");
}

fn lines(values: impl IntoIterator<Item = Value>) -> String {
    values.into_iter().map(|value| value.to_string() + "\n").collect()
}

/// A file of two rows with an image in each.
fn parquet() -> Vec<u8> {
    let schema = "message schema { required binary id (UTF8); required binary question (UTF8); required group image { required binary bytes; } required binary A (UTF8); required binary B (UTF8); required binary answer (UTF8); }";
    let schema = Arc::new(parse_message_type(schema).unwrap());
    let mut file = Vec::new();
    let properties = Arc::new(WriterProperties::builder().build());
    let mut writer = SerializedFileWriter::new(&mut file, schema, properties).unwrap();
    let picture = frames::png(80);
    let columns: [[&[u8]; 2]; 6] =
        [[b"1", b"2"], [b"Which?", b"Which one?"], [&picture, &picture], [b"x", b"x"], [b"y", b"y"], [b"A", b"B"]];
    let mut group = writer.next_row_group().unwrap();
    for values in columns {
        let values = values.map(|value| ByteArray::from(value.to_vec()));
        let mut column = group.next_column().unwrap().unwrap();
        let typed = column.typed::<ByteArrayType>();
        typed.write_batch(&values, None, None).unwrap();
        column.close().unwrap();
    }
    group.close().unwrap();
    writer.close().unwrap();
    file
}
